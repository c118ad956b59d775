#version 460
#extension GL_GOOGLE_include_directive : require
// What a cell of water throws back of a boat, and what share of the cell's own light the boat takes from it: for a dark, a middling and a
// bright pixel; and the colour of that share, with the luminance above which light is the sun's. It changes slowly over the screen, so a cell is a few pixels; boats add up. As the host's
// reflection::compose.
#include "frame.glsl"
#include "water_block.glsl"
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

// Pixels of the screen to a cell.
const vec2 CELL = vec2(4.0, 2.0);
// No narrower a stretch of hull is asked for, half of it in pixels.
const float HALF_WIDTH_MIN = 1.5;

float hull_line(int column) {
    return waters[draw.index].hull_line[column >> 2][column & 3];
}

vec4 running(float place, int row) {
    float held = clamp(place, 0.0, float(COLUMNS));
    int first = min(int(held), COLUMNS - 1);
    return mix(texelFetch(sums, ivec2(first, row), 0), texelFetch(sums, ivec2(first + 1, row), 0), held - float(first));
}

void main() {
    uint i = draw.index;
    vec4 place = boats[i].place, board = boats[i].board;
    vec2 from_anchor = gl_FragCoord.xy * CELL - waters[i].anchor;
    vec2 down = waters[i].down;
    float across = dot(from_anchor, vec2(down.y, -down.x));
    float column = clamp((across - waters[i].columns.x) * waters[i].columns.y, 0.0, float(HULL_LINE_COLUMNS - 1));
    int first = min(int(column), HULL_LINE_COLUMNS - 2);
    float line = mix(hull_line(first), hull_line(first + 1), column - float(first));
    float below = dot(from_anchor, down) - line;
    float near = max(place.x + line * place.y, 1e-5);
    // Water above the line is a wave before the hull, as far from it as one as far below.
    float tangent = max(near + abs(below) * place.y, 1e-5);
    float far = place.z * (1.0 / near - 1.0 / tangent);
    float at_step = sqrt(max(far * place.w, 0.0)) * float(STEPS - 1);
    int low = min(int(at_step), STEPS - 2);
    float part = at_step - float(low);
    // Cells that lie half above the line keep the hull's foot wet where they are blended into those below.
    if (below < -boats[i].foot.x || at_step >= float(STEPS - 1)) {
        discard;
    }
    float pixels = board.w * near / place.x;
    float scale = 1.0 / board.z;
    vec4 sum[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    vec4 hue = vec4(0.0);
    for (int band = 0; band < BANDS; ++band) {
        vec4 thrown = mix(boats[i].lobes[low][3 * band], boats[i].lobes[low + 1][3 * band], part);
        vec4 taken = mix(boats[i].lobes[low][3 * band + 1], boats[i].lobes[low + 1][3 * band + 1], part);
        if (max(max(thrown.x, thrown.y), thrown.z) < 1e-4) {
            continue;
        }
        float centre = (across + thrown.w * pixels - board.y) * scale;
        float reach = max(taken.w * pixels, HALF_WIDTH_MIN) * scale;
        int row = int(i) * BANDS + band;
        vec4 seen = (running(centre + reach, row) - running(centre - reach, row)) / (2.0 * reach);
        sum[0] += seen * vec4(thrown.xxx, taken.x);
        sum[1] += seen * vec4(thrown.yyy, taken.y);
        sum[2] += seen * vec4(thrown.zzz, taken.z);
        hue += seen.w * taken.y * mix(boats[i].lobes[low][3 * band + 2], boats[i].lobes[low + 1][3 * band + 2], part);
    }
    dark = sum[0];
    middle = sum[1];
    bright = sum[2];
    coloured = hue;
}
