#version 460
#extension GL_GOOGLE_include_directive : require
// What water throws back of a boat, and what share of the water's own light the boat takes from it: for a dark, a middling and a bright
// pixel; and the colour of that share, with the luminance above which light is the sun's. A texel is a place across the hull and a step
// away from it, as many as the boat is large in the picture. As the host's reflection::compose. Roots are
// written: what is small keeps its digits.
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

layout(location = 0) out vec4 dark;
layout(location = 1) out vec4 middle;
layout(location = 2) out vec4 bright;
layout(location = 3) out vec4 coloured;

// No narrower a stretch of hull is asked for, half of it in pixels.
const float HALF_WIDTH_MIN = 1.5;

vec4 running(float place, int row) {
    int columns = boats[draw.index].sizes.z;
    float held = clamp(place, 0.0, float(columns));
    int first = min(int(held), columns - 1);
    return mix(texelFetch(sums, ivec2(first, row), 0), texelFetch(sums, ivec2(first + 1, row), 0), held - float(first));
}

void main() {
    uint i = draw.index;
    vec4 place = boats[i].place, board = boats[i].board, span = boats[i].span;
    int column = int(gl_FragCoord.x), at_step = int(gl_FragCoord.y) - int(i) * STEPS;
    float side = span.z + span.w * float(at_step);
    float across = span.x - side + (span.y + 2.0 * side) * float(column) / float(boats[i].sizes.w - 1);
    float pixels = board.w * max(place.x + hull_line_at(i, across) * place.y, 1e-5) / place.x;
    float scale = 1.0 / board.z;
    vec4 sum[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    vec4 hue = vec4(0.0);
    for (int band = 0; band < boats[i].sizes.x; ++band) {
        vec4 thrown = boats[i].lobes[at_step][3 * band];
        vec4 taken = boats[i].lobes[at_step][3 * band + 1];
        // No band from here on is seen at this step.
        if (taken.w < 0.0) {
            break;
        }
        float centre = (across + thrown.w * pixels - board.y) * scale;
        float reach = max(taken.w * pixels, HALF_WIDTH_MIN) * scale;
        int row = int(i) * BANDS + band;
        vec4 seen = (running(centre + reach, row) - running(centre - reach, row)) / (2.0 * reach);
        sum[0] += seen * vec4(thrown.xxx, taken.x);
        sum[1] += seen * vec4(thrown.yyy, taken.y);
        sum[2] += seen * vec4(thrown.zzz, taken.z);
        hue += seen.w * taken.y * boats[i].lobes[at_step][3 * band + 2];
    }
    dark = sqrt(max(sum[0], 0.0));
    middle = sqrt(max(sum[1], 0.0));
    bright = sqrt(max(sum[2], 0.0));
    // Only its ratios count.
    coloured = sqrt(max(0.5 * hue, 0.0));
}
