#version 460
#extension GL_GOOGLE_include_directive : require
// Light of lamps: added, it hides nothing.
#include "dither.glsl"

layout(location = 0) in vec3 light;

layout(location = 0) out vec4 colour;

void main() {
    colour = vec4(dithered(light), 0.0);
}
