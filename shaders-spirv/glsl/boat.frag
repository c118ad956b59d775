#version 460
#extension GL_GOOGLE_include_directive : require
// A boat without a texture: its light is found at the corners, and what hides the sun at the pixel.
#include "coded_light.glsl"
#include "sunlit.glsl"

layout(location = 0) in vec3 around;
layout(location = 1) in vec3 sun;
layout(location = 2) centroid in vec3 shade;
layout(location = 3) flat in vec4 shade_box;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(coded(around + sunlit(sun, shade, shade_box)), 1.0);
}
