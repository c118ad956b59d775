#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "light_block.glsl"

void main() {
    gl_Position = vec4(clip_from_pixels(corner(light.rect, gl_VertexIndex)).xy, light.depth, 1.0);
}
