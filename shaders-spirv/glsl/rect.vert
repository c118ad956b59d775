#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"

// Rectangles of the screen in pixels (set 0, binding 5), one for each instance.
layout(std430, set = 0, binding = 5) readonly buffer Rects {
    vec4 rects[];
};

layout(push_constant) uniform DrawBlock {
    vec4 rect;   // added to each: how far each side is moved
    uint index;  // which boat
    uint first;  // the first rectangle
} draw;

void main() {
    gl_Position = clip_from_pixels(corner(rects[draw.first + gl_InstanceIndex] + draw.rect, gl_VertexIndex));
}
