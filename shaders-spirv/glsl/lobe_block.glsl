// What the sea throws back of one boat (set 0, binding 6); the host's side is core's reflection::Lobes.

// Largest sizes; the host's are in interface.rs.
const int BANDS = 10;  // of height
const int STEPS = 20;  // away from the hull

struct LobeBlock {
    vec2 place;             // tangent below the horizontal at the anchor, 1 / pixels to a tangent of 1
    vec2 pad;
    vec4 board;             // height of the boat (m), across position of its picture's first column, pixels to a column, pixels to a metre
    vec4 span;              // across position of the hull's left end, its width, how much farther the reflection goes to each side at the hull and a step, pixels
    ivec4 sizes;            // of this boat: bands, steps, columns of its picture, columns of its layers
    vec4 lobes[STEPS][2 * BANDS];  // by distance and band: thrown back, more of it by a bright pixel, metres aside, half width in metres (less than 0: no more bands); taken away by channel, more of it from a bright pixel
};

layout(std430, set = 0, binding = 6) readonly buffer Lobes {
    LobeBlock boats[];
};
