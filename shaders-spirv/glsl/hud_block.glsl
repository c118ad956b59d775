// One rectangle of the head-up display (set 0, binding 4).
struct HudQuad {
    vec4 rect;    // x0, y0, x1, y1 in pixels
    vec4 uv;      // the same corners in the glyph atlas, texels
    vec4 colour;  // linear light, straight alpha
    uint shape;   // what fills it, SHAPE_*
    float edge;   // plate: radius of its corners, pixels
    float pad0;
    float pad1;
};

layout(std430, set = 0, binding = 4) readonly buffer Quads {
    HudQuad quads[];
};
