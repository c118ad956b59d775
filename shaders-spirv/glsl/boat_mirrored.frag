#version 460
#extension GL_GOOGLE_include_directive : require
// A boat without a texture, mirrored in the sea: its light is found at the corners.
#include "coded_light.glsl"

layout(location = 0) in vec3 around;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(coded(around), 1.0);
}
