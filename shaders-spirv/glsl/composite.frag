#version 460
#extension GL_GOOGLE_include_directive : require
// Boats over the video.
#include "composite.glsl"

layout(location = 0) out vec4 colour;

void main() {
    colour = mean_of_samples(ivec2(gl_FragCoord.xy));
    if (colour.a == 0.0) {
        discard;
    }
}
