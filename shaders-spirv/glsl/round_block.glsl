// One tracer, splash or strike (set 0, binding 3).
struct RoundBlock {
    vec4 from;        // one end of the axis: pixels, depth (near / distance), reach before and behind that, metres
    vec4 to;          // the other end
    vec4 colour;      // linear light and opacity, or optical depth
    vec2 half_width;  // at both ends, pixels; of smoke the second is the radius at which it ends, half widths
    uint kind;        // ROUND_*
    float seed;       // tells one from another
};

const uint ROUND_TRACER = 0;
const uint ROUND_SPLASH = 1;
const uint ROUND_STRIKE = 2;
const uint ROUND_SMOKE = 3;
const uint ROUND_FLAME = 4;

layout(std430, set = 0, binding = 3) readonly buffer Rounds {
    RoundBlock rounds[];
};

layout(push_constant) uniform DrawBlock {
    vec4 rect;   // the pixels that it can cover
    uint index;  // which one
    uint first;
} draw;
