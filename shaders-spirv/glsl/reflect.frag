#version 460
#extension GL_GOOGLE_include_directive : require
// The sea with a boat in it: each pixel takes from the layers what belongs to its own brightness, so that the waves of the video go
// through the reflection. Output is premultiplied: it covers what the boat hides of a pixel's light and adds what is seen
// of it.
#include "frame.glsl"
#include "water_block.glsl"
#include "hull_line.glsl"
#include "lobe_sizes.glsl"

layout(push_constant) uniform ReflectBlock {
    vec4 rect;
    uint index;
    uint first;
    float foot;    // pixels above the hull-water line that are drawn, along the hull
    float last_step;
    vec4 tangent;  // tangent below the horizontal: for each pixel right and down, and at pixel (0, 0); last column of the layers
    vec4 mean;     // sea's mean luma: coefficients of the tangent's root; smallest root
    vec4 spread;   // its standard deviation; largest root
    vec4 place;    // as in the boat's block of lobes
    vec4 span;     // as there
    vec4 sky_most; // as there
} draw;

// The video beneath, as codes.
layout(set = 1, binding = 0) uniform sampler2D video;
layout(set = 1, binding = 1) uniform sampler2D thrown;
layout(set = 1, binding = 2) uniform sampler2D taken;

layout(location = 0) out vec4 colour;

// Standard deviations from the mean of a dark and a bright pixel, as the host's TONE_OUTER; smallest spread, as its SPREAD_MIN.
const float TONE = 1.15;
const float SPREAD_MIN = 0.004;
// Brighter and darker ones count as so many times that, as the host's TONE_MOST.
const float TONE_MOST = 1.5;

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

float curve(vec4 c, float x) {
    return c.x + x * (c.y + x * c.z);
}

// How much more there is at a tone, of a layer whose last channel says what a bright pixel has more; all channels change alike.
float times(float part, float tone) {
    return max(1.0 + tone * (2.0 * part - 1.0), 0.0);
}

void main() {
    vec2 at = gl_FragCoord.xy;
    vec2 from_anchor = at - waters[draw.index].anchor, down = waters[draw.index].down;
    float across = dot(from_anchor, vec2(down.y, -down.x));
    float line = hull_line_at(draw.index, across);
    float below = dot(from_anchor, down) - line;
    float near = max(draw.place.x + line * draw.place.y, 1e-5);
    // Water above the line is a wave before the hull, as far from it as one as far below.
    float beneath = max(near + abs(below) * draw.place.y, 1e-5);
    float far = draw.place.z * (1.0 / near - 1.0 / beneath);
    float at_step = sqrt(max(far * draw.place.w, 0.0)) * draw.last_step;
    // Beside the hull there is sea above the line, farther off than the boat.
    float column = hull_column(draw.index, across);
    float foot = column < 0.0 || column > float(HULL_LINE_COLUMNS - 1) ? 0.0 : draw.foot;
    if (below < -foot || at_step >= draw.last_step) {
        discard;
    }
    float side = draw.span.z + draw.span.w * at_step;
    float over = clamp((across - draw.span.x + side) / (draw.span.y + 2.0 * side), 0.0, 1.0) * draw.tangent.w;
    vec2 uv = (vec2(over, at_step + float(int(draw.index) * STEPS)) + 0.5) / vec2(textureSize(thrown, 0));
    vec3 code = texelFetch(video, ivec2(at), 0).rgb;
    float luma = dot(code, LUMINANCE);
    float tangent_root = clamp(sqrt(max(dot(draw.tangent.xy, at) + draw.tangent.z, 0.0)), draw.mean.w, draw.spread.w);
    float tone = (luma - curve(draw.mean, tangent_root)) / (max(curve(draw.spread, tangent_root), SPREAD_MIN) * TONE);
    tone = clamp(tone, -TONE_MOST, TONE_MOST);
    vec4 root = texture(thrown, uv), away = texture(taken, uv);
    vec3 added = root.rgb * root.rgb * times(root.a, tone);
    // sRGB code to linear light within 0.002.
    vec3 light = code * (code * (code * 0.305306011 + 0.682171111) + 0.012522878);
    // Light over what waves mirror of the sky is the sun's glitter, of which a boat hides little.
    float of_sky = min(max(curve(draw.sky_most, at_step / draw.last_step), 0.0) / max(dot(light, LUMINANCE), 1e-6), 1.0);
    vec3 share = min(away.rgb * times(away.a, tone), 1.0) * of_sky;
    // As much of the water is covered as its most hidden channel asks for; what is then too little of the others is given back.
    float cover = max(max(share.r, share.g), share.b);
    colour = vec4(added + light * (cover - share), cover);
}
