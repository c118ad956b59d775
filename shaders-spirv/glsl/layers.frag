#version 460
#extension GL_GOOGLE_include_directive : require
// What water throws back of a boat, and what share of the water's own light the boat takes from it: by channel, in the mean, with the
// part by which it is more where the water is bright. A texel is a place across the hull and a step away from it, as many as
// the boat is large in the picture. As the host's reflection::compose. Light is written by its root, which keeps the digits of what
// is small.
#include "frame.glsl"
#include "water_block.glsl"
#include "hull_line.glsl"
#include "lobe_block.glsl"

layout(push_constant) uniform DrawBlock {
    vec4 rect;
    uint index;
    uint first;
} draw;

layout(set = 1, binding = 0) uniform sampler2D sums;

layout(location = 0) out vec4 thrown_out;
layout(location = 1) out vec4 taken_out;

// No narrower a stretch of hull is asked for, half of it in pixels.
const float HALF_WIDTH_MIN = 1.5;

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

vec4 running(float place, int row) {
    int columns = boats[draw.index].sizes.z;
    float held = clamp(place, 0.0, float(columns));
    int first = min(int(held), columns - 1);
    return mix(texelFetch(sums, ivec2(first, row), 0), texelFetch(sums, ivec2(first + 1, row), 0), held - float(first));
}

float part(vec3 light, float more) {
    return 0.5 + 0.5 * more / max(dot(light, LUMINANCE), 1e-6);
}

void main() {
    uint i = draw.index;
    vec2 place = boats[i].place;
    vec4 board = boats[i].board, span = boats[i].span;
    int column = int(gl_FragCoord.x), at_step = int(gl_FragCoord.y) - int(i) * STEPS;
    float side = span.z + span.w * float(at_step);
    float across = span.x - side + (span.y + 2.0 * side) * float(column) / float(boats[i].sizes.w - 1);
    float pixels = board.w * max(place.x + hull_line_at(i, across) * place.y, 1e-5) / place.x;
    float scale = 1.0 / board.z;
    vec3 thrown = vec3(0.0), taken = vec3(0.0);
    // Luminance that a bright pixel has more.
    float thrown_more = 0.0, taken_more = 0.0;
    for (int band = 0; band < boats[i].sizes.x; ++band) {
        vec4 lobe = boats[i].lobes[at_step][2 * band];
        // No band from here on is seen at this step.
        if (lobe.w < 0.0) {
            break;
        }
        vec4 away = boats[i].lobes[at_step][2 * band + 1];
        float centre = (across + lobe.z * pixels - board.y) * scale;
        float reach = max(lobe.w * pixels, HALF_WIDTH_MIN) * scale;
        int row = int(i) * BANDS + band;
        vec4 seen = (running(centre + reach, row) - running(centre - reach, row)) / (2.0 * reach);
        thrown += seen.rgb * lobe.x;
        thrown_more += dot(seen.rgb, LUMINANCE) * lobe.y;
        taken += seen.a * away.rgb;
        taken_more += seen.a * away.a;
    }
    thrown_out = vec4(sqrt(max(thrown, 0.0)), part(thrown, thrown_more));
    taken_out = vec4(taken, part(taken, taken_more));
}
