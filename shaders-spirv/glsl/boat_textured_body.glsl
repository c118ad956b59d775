// A boat with a texture: what is transparent in it is not there.
#include "frame.glsl"
#include "boat_block.glsl"
#include "coded_light.glsl"

// Samples a pixel of the layer drawn to: a texture's alpha becomes coverage of that many steps.
layout(constant_id = 1) const uint SAMPLES = 4;

layout(location = 0) in vec3 around;
#ifdef MIRRORED
layout(set = 1, binding = 0) uniform sampler2D skin;
layout(location = 1) in vec2 uv;
#else
#include "sunlit.glsl"
layout(set = 2, binding = 0) uniform sampler2D skin;
layout(location = 1) in vec3 sun;
layout(location = 2) centroid in vec3 shade;
layout(location = 3) flat in vec4 shade_box;
layout(location = 4) in vec2 uv;
#endif

layout(location = 0) out vec4 colour;

void main() {
    vec4 texel = texture(skin, uv);
    // Covered samples in a fixed order: neighbouring triangles of one picture then agree.
    uint covered = uint(texel.a * float(SAMPLES) + 0.5);
    if (covered == 0) {
        discard;
    }
    gl_SampleMask[0] = int((1u << covered) - 1u);
#ifdef MIRRORED
    vec3 light = around;
#else
    vec3 light = around + sunlit(sun, shade, shade_box);
#endif
    vec3 seen = mix(light * texel.rgb, frame.horizon.rgb, boats[draw.index].eye.w);
#ifndef MIRRORED
    seen += boats[draw.index].air.rgb;
#endif
    colour = vec4(coded(seen), 1.0);
}
