#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "hud_block.glsl"

layout(location = 0) out vec2 uv;
layout(location = 1) out vec2 local;
// All of the quad that the fragment shader needs: a driver that runs on the processor reads a flat input once and a storage
// buffer for every pixel.
layout(location = 2) flat out vec4 colour;
layout(location = 3) flat out vec3 half_size_edge;
layout(location = 4) flat out uint shape;

void main() {
    HudQuad quad = quads[gl_InstanceIndex];
    gl_Position = clip_from_pixels(corner(quad.rect, gl_VertexIndex));
    uv = corner(quad.uv, gl_VertexIndex);
    // Pixels from the rectangle's middle, for the shapes.
    local = corner(quad.rect, gl_VertexIndex) - 0.5 * (quad.rect.xy + quad.rect.zw);
    colour = quad.colour;
    half_size_edge = vec3(0.5 * (quad.rect.zw - quad.rect.xy), quad.edge);
    shape = quad.shape;
}
