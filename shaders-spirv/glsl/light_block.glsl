// A point of light on an image (push constants).
layout(push_constant) uniform LightBlock {
    vec4 rect;    // the pixels of the screen that it can reach
    vec2 at;      // its place, the image's own pixels
    float depth;  // near / distance
    float sharp;  // 1 / (2 sigma^2) of its core, per squared pixel of the image
    vec4 core;    // linear light in the middle of the core; the last is unused
    vec4 glow;    // that of the glow about it; the last is 1 / its squared radius, per squared pixel
} light;
