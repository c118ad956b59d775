#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "boat_block.glsl"

// Whether the model has a texture.
layout(constant_id = 0) const bool TEXTURED = false;
// Samples a pixel of the layer drawn to: a texture's alpha becomes coverage of that many steps.
layout(constant_id = 1) const uint SAMPLES = 4;

layout(set = 1, binding = 0) uniform sampler2D skin;

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec3 albedo;

layout(location = 0) out vec4 colour;

void main() {
    BoatBlock boat = boats[draw.index];
    vec3 reflectance = albedo;
    int mask = -1;
    if (TEXTURED) {
        vec4 texel = texture(skin, uv);
        // Covered samples in a fixed order: neighbouring triangles of one picture then agree.
        uint covered = uint(texel.a * float(SAMPLES) + 0.5);
        if (covered == 0) {
            discard;
        }
        mask = int((1u << covered) - 1u);
        reflectance *= texel.rgb;
    }
    gl_SampleMask[0] = mask;
    // Shells are seen from both sides; the side that is seen is the one that is lit.
    vec3 n = normalize(normal);
    n = dot(n, boat.eye.xyz - position) < 0.0 ? -n : n;
    float up = dot(n, boat.water_plane.xyz);
    vec3 ambient = mix(frame.sea.rgb, frame.sky.rgb, 0.5 + 0.5 * up);
    vec3 light = frame.sun.rgb * max(dot(n, boat.sun.xyz), 0.0) + ambient;
    colour = vec4(mix(reflectance * light, frame.horizon.rgb, boat.eye.w), 1.0);
}
