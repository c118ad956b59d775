#version 460
#extension GL_GOOGLE_include_directive : require
// A boat's mirror image collapsed to bands of height: each texel is the mean of a column's stretch, premultiplied linear light.
#include "frame.glsl"
#include "water_block.glsl"
#include "hull_line.glsl"
#include "lobe_block.glsl"

layout(push_constant) uniform DrawBlock {
    vec4 rect;
    uint index;
    uint first;
} draw;

layout(set = 1, binding = 0) uniform sampler2D mirror;

layout(location = 0) out vec4 colour;

// Fetches to a texel, across and up.
const ivec2 TAPS = ivec2(2, 5);

// Lower edge of a band, metres, as the host's band_edge_m.
float edge(float band) {
    return boats[draw.index].board.x * pow(band / float(boats[draw.index].sizes.x), 1.8);
}

void main() {
    uint i = draw.index;
    vec4 board = boats[i].board;
    int band = int(gl_FragCoord.y) - int(i) * BANDS;
    vec2 down = waters[i].down, right = vec2(down.y, -down.x);
    vec2 low = waters[i].mirror_bounds.xy, high = waters[i].mirror_bounds.zw;
    float from = edge(float(band)), to = edge(float(band + 1));
    // Where the mirrored boat ends at the water its texels are half empty: what is fetched lies wholly within others.
    vec2 texel = 1.0 / (waters[i].mirror_scale * vec2(textureSize(mirror, 0)));
    float wet = 1.5 * max(texel.x, texel.y);
    vec4 sum = vec4(0.0);
    for (int x = 0; x < TAPS.x; ++x) {
        float across = board.y + (floor(gl_FragCoord.x) + (float(x) + 0.5) / float(TAPS.x)) * board.z;
        float line = hull_line_at(i, across);
        for (int y = 0; y < TAPS.y; ++y) {
            float height = mix(from, to, (float(y) + 0.5) / float(TAPS.y));
            vec2 at = waters[i].anchor + right * across + down * (line + max(height * board.w, wet));
            vec2 uv = at * waters[i].mirror_scale + waters[i].mirror_offset;
            sum += texture(mirror, clamp(uv, low, high));
        }
    }
    colour = sum / float(TAPS.x * TAPS.y);
}
