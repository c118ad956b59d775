#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "boat_block.glsl"

// A rectangle of the screen.
void main() {
    gl_Position = clip_from_pixels(corner(draw.rect, gl_VertexIndex));
}
