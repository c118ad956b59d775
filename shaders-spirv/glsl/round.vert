#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "round_block.glsl"

void main() {
    gl_Position = clip_from_pixels(corner(draw.rect, gl_VertexIndex));
}
