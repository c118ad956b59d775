#version 460
#extension GL_GOOGLE_include_directive : require
// Nelson 2009, eq. 4 and 5, corrected: how the video's brightness changes downwards, and whether it is so bright or dark that the
// video passes through, once for each FIELD_CELL of the screen. Seen
// at a grazing angle waves are long and low, so a cell is wider than high. A mean over four pixels, and bilinear fetches of the
// cells, take the camera's noise off; and it costs an eighth of doing it at every pixel.
#include "frame.glsl"
#include "water_block.glsl"

layout(push_constant) uniform DrawBlock {
    vec4 rect;
    uint index;
    uint first;
} draw;

// The video beneath, as codes, bilinear.
layout(set = 1, binding = 0) uniform sampler2D video;

// The sine of the normalised mean, 0 to 1 for -1 to 1; and the share of the reflection that the wave lets stand.
layout(location = 0) out vec2 wave;

// Pixels of the screen to a cell.
const vec2 FIELD_CELL = vec2(4.0, 2.0);

// Mean of the 2 x 2 pixels around a corner: one fetch.
vec3 mean_code(vec2 corner) {
    return texture(video, corner / frame.size).rgb;
}

void main() {
    vec2 at = gl_FragCoord.xy * FIELD_CELL;
    vec2 down = waters[draw.index].down * waters[draw.index].step;
    vec3 here = mean_code(at);
    float least = 1e9, greatest = 0.0, sum = 0.0;
    for (int n = 1; n <= 9; ++n) {
        float gradient = distance(here, mean_code(at + down * float(n)));
        least = min(least, gradient);
        greatest = max(greatest, gradient);
        sum += gradient;
    }
    // What differs less than the camera's noise is flat, and a flat patch does not shift.
    float spread = greatest - least;
    float n = (2.0 * (sum / 9.0 - greatest) + spread) / max(spread, waters[draw.index].flat_spread);
    float bright = dot(here, vec3(0.299, 0.587, 0.114));
    vec4 passes = waters[draw.index].passes;
    float kept = smoothstep(passes.x, passes.y, bright) * (1.0 - smoothstep(passes.z, passes.w, bright));
    wave = vec2(0.5 * sin(n) + 0.5, kept);
}
