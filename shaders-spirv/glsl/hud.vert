#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "hud_block.glsl"

layout(location = 0) out vec2 uv;
layout(location = 1) out vec2 local;
layout(location = 2) flat out uint instance;

void main() {
    HudQuad quad = quads[gl_InstanceIndex];
    gl_Position = clip_from_pixels(corner(quad.rect, gl_VertexIndex));
    uv = corner(quad.uv, gl_VertexIndex);
    // Pixels from the rectangle's middle, for the shapes.
    local = corner(quad.rect, gl_VertexIndex) - 0.5 * (quad.rect.xy + quad.rect.zw);
    instance = gl_InstanceIndex;
}
