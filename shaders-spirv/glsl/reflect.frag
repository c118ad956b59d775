#version 460
#extension GL_GOOGLE_include_directive : require
// The sea with a boat in it: each pixel takes from the layers what belongs to its own brightness, so that the waves of the video go
// through the reflection. Output is premultiplied: it covers what the boat hides of a pixel's light and adds what is seen
// of it.
#include "reflect_block.glsl"

// The video beneath, as codes.
layout(set = 1, binding = 0) uniform sampler2D video;
layout(set = 1, binding = 1) uniform sampler2D thrown;
layout(set = 1, binding = 2) uniform sampler2D taken;

// As reflect.vert has it.
layout(location = 0) noperspective in vec4 place;

layout(location = 0) out vec4 colour;

// Least brightness over the mean for as much more, as the host's SPREAD_MIN * TONE_OUTER / TONE_GAIN.
const float SPREAD_MIN = 0.00306667;
// Most steps of that, as the host's TONE_MOST * TONE_GAIN.
const float TONE_MOST = 4.5;

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

float curve(vec4 c, float x) {
    return c.x + x * (c.y + x * c.z);
}

// How much more there is at a tone, of a layer whose last channel says what a bright pixel has more; all channels change alike.
float times(float part, float tone) {
    return max(1.0 + tone * (2.0 * part - 1.0), 0.0);
}

void main() {
    float near = max(draw.place.x + place.y * draw.place.y, 1e-5);
    // Water above the line is a wave before the hull, as far from it as one as far below.
    float below = abs(place.z);
    float at_step = min(sqrt(draw.place.z * below / (near * (near + below * draw.place.y))), draw.last_step);
    float side = draw.span.z + draw.span.w * at_step;
    float over = clamp((place.x - draw.span.x + side) / (draw.span.y + 2.0 * side), 0.0, 1.0) * draw.tangent.w;
    vec2 uv = vec2(over + 0.5, at_step + draw.first_row) * draw.texel;
    vec3 code = texelFetch(video, ivec2(gl_FragCoord.xy), 0).rgb;
    float luma = dot(code, LUMINANCE);
    float tangent_root = clamp(sqrt(max(place.w, 0.0)), draw.mean.w, draw.spread.w);
    float tone = (luma - curve(draw.mean, tangent_root)) / max(curve(draw.spread, tangent_root), SPREAD_MIN);
    tone = clamp(tone, -TONE_MOST, TONE_MOST);
    vec4 root = texture(thrown, uv), away = texture(taken, uv);
    vec3 added = root.rgb * root.rgb * times(root.a, tone);
    // sRGB code to linear light within 0.002.
    vec3 light = code * (code * (code * 0.305306011 + 0.682171111) + 0.012522878);
    // Light over what waves mirror of the sky is the sun's glitter, of which a boat hides little.
    float of_sky = min(max(curve(draw.sky_most, at_step), 0.0) / max(dot(light, LUMINANCE), 1e-6), 1.0);
    vec3 share = min(away.rgb * times(away.a, tone), 1.0) * of_sky;
    // As much of the water is covered as its most hidden channel asks for; what is then too little of the others is given back.
    float cover = max(max(share.r, share.g), share.b);
    colour = vec4(added + light * (cover - share), cover);
}
