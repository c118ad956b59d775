// Tracks of boats and what they leave on the water (set 0, binding 7). Lengths in metres, camera space unless said otherwise.
const int TRACK_POINTS = 32;

struct WakePoint {
    vec4 place;  // xyz; w: how far the track reaches to each side
    vec4 side;   // xyz: unit vector to starboard; w: height of the highest waves one length off
    vec4 world;  // xy: where it is on the water, modulo the foam's repeat; zw: to starboard there
    vec4 track;  // behind the bow, speed (m/s), seconds since the boat's middle was here, share that is drawn
};

// What is the same for all of a wake. Fragment shaders get it as a flat input: a driver that runs on the processor reads that once, and
// a storage buffer for every pixel.
struct WakeHead {
    vec4 up;    // xyz: unit vector upwards; w: roughness of the sea as the root of its mean square slope
    vec4 hull;  // length, beam, share of light that haze replaces, height of what the bow throws up
    vec4 foam;  // rgb: light of whole foam; w: how much of it the hull throws up
    vec4 sea;   // rgb: what the sea's model is multiplied with to give the sea of the picture
    // The boat's shadow: rows of the matrix from camera space to texels of the shadow map and nearness to the sun; the texels that
    // are the boat's, none where it throws no shadow; rgb: light of whole foam in it.
    vec4 shade_rows[3];
    vec4 shade_box;
    vec4 shade_foam;
};

struct WakeBlock {
    WakeHead head;
    WakePoint points[TRACK_POINTS];
};

layout(std430, set = 0, binding = 7) readonly buffer Wakes {
    WakeBlock wakes[];
};

// A place in camera space as the shadow map has it: texels, and nearness to the sun. What is farther from the sun than the map holds lies
// behind all that is in it.
vec3 shade_place(WakeHead head, vec3 place) {
    vec4 at = vec4(place, 1.0);
    return vec3(dot(head.shade_rows[0], at), dot(head.shade_rows[1], at), max(dot(head.shade_rows[2], at), 0.0));
}

layout(push_constant) uniform DrawBlock {
    vec4 rect;
    uint index;  // which boat
    uint first;
} draw;
