// One drawn boat (set 0, binding 1). Directions and planes are in the boat's own space, so normals need no transform.
// Most flares and fires that light one boat.
const int BOAT_LAMPS = 4;

struct BoatBlock {
    vec4 camera_from_boat[3];  // rows
    vec4 water_plane;          // dot(plane, (p, 1)): metres above the mean water
    vec4 horizon_plane;        // positive above the line of sight over the sea's horizon
    vec4 sun;                  // xyz: unit vector towards the sun; w: metres off the surface at which its shadow is looked up
    vec4 eye;                  // xyz: the eye; w: share of the light that haze replaces
    vec4 lobes[9];             // light of the whole sky: its lobes' radiances
    vec4 shadow_from_boat[3];  // rows: to texels of the shadow map and nearness to the sun
    vec4 shadow_box;           // the texels that are the boat's: lowest and highest place at which they are looked up
    vec4 lamps[BOAT_LAMPS];    // xyz: a lamp that lights it, metres; w is unused
    vec4 lamp_lights[BOAT_LAMPS];  // rgb: linear radiance of white matt that faces it a metre off, less what air takes on the way
    vec4 air;                  // rgb: lamplight of the air before it
};

layout(std430, set = 0, binding = 1) readonly buffer Boats {
    BoatBlock boats[];
};

layout(push_constant) uniform DrawBlock {
    vec4 rect;   // x0, y0, x1, y1 in pixels, for quads
    uint index;  // which boat
    uint first;
} draw;
