#version 460
#extension GL_GOOGLE_include_directive : require
// Boats over the video, with the camera's noise on them.
#include "frame.glsl"
#include "composite.glsl"
#include "noise.glsl"

layout(location = 0) out vec4 colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    colour = mean_of_samples(at);
    if (colour.a == 0.0) {
        discard;
    }
    // Noise is scaled by cover; the video below brings its own for the rest.
    colour.rgb = max(colour.rgb + colour.a * camera_noise(at, colour.rgb / colour.a), 0.0);
}
