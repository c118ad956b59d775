#version 460
#extension GL_GOOGLE_include_directive : require
// A boat's light on the sea: Nelson 2009, "Full Reflection" shader, equations 4 to 8, and "Physics" shader, equations 9 to 16. The
// video is compared as sRGB codes, as the thesis does; what is mixed is linear light. Output is premultiplied: it covers alpha of the
// sea and adds light.
#include "frame.glsl"
#include "water_block.glsl"
#include "hull_line.glsl"
#include "water_methods.glsl"

// One of the METHOD_ constants, and one of the SHADOW_ ones.
layout(constant_id = 0) const uint METHOD = METHOD_FULL;
layout(constant_id = 1) const uint SHADOW = SHADOW_NONE;

layout(push_constant) uniform DrawBlock {
    vec4 rect;
    uint index;
    uint first;
} draw;

// The video beneath, as codes.
layout(set = 1, binding = 0) uniform sampler2D video;
// The boats mirrored in the sea, premultiplied linear light; for METHOD_FULL, softened by soften.frag.
layout(set = 1, binding = 1) uniform sampler2D mirror;
// What field.frag found.
layout(set = 1, binding = 2) uniform sampler2D field;

layout(location = 0) out vec4 colour;

// How far sideways a wave moves the reflection, in parts of how far down.
const float SIDEWAYS = 0.35;

vec3 code_at(vec2 pixel) {
    return texelFetch(video, ivec2(clamp(pixel, vec2(0.0), frame.size - 1.0)), 0).rgb;
}

// Where a pixel lies in the mirror layer.
vec2 mirror_uv(vec2 at) {
    return at * waters[draw.index].mirror_scale + waters[draw.index].mirror_offset;
}

// The mirrored boat at a pixel.
vec4 mirror_at(vec2 at) {
    vec4 bounds = waters[draw.index].mirror_bounds;
    return texture(mirror, clamp(mirror_uv(at), bounds.xy, bounds.zw));
}

// Sine of the normalised mean, 0 to 1 for -1 to 1, and the share of the reflection that the wave lets stand.
vec2 field_at(vec2 at) {
    return texture(field, at / (vec2(textureSize(field, 0)) * vec2(4.0, 2.0))).rg;
}

// In which a wave moves the reflection.
vec2 wave_direction() {
    vec2 down = waters[draw.index].down;
    return down + SIDEWAYS * vec2(down.y, -down.x);
}

// Eq. 4 and 5 as published, at every pixel.
float normalised_mean(vec2 at, vec3 here) {
    float least = 1e9, greatest = 0.0, sum = 0.0;
    for (int n = 1; n <= 9; ++n) {
        float gradient = distance(here, code_at(at + vec2(0.0, float(n))));
        least = min(least, gradient);
        greatest = max(greatest, gradient);
        sum += gradient;
    }
    // 0 / 0 on a flat patch. What follows may be NaN: the caller's limit test is written so that it is discarded.
    return 2.0 / (greatest - least) * (sum / 9.0 - greatest) + 1.0;
}

#include "water_mirror.glsl"
#include "water_full.glsl"
#include "water_physics.glsl"
#include "water_baked.glsl"

// Share of the mirrored light and the mirrored light itself, premultiplied.
vec4 reflection(vec2 at, float across, float below, float line) {
    switch (METHOD) {
        case METHOD_MIRROR: return plain_mirror(at, below);
        case METHOD_FULL_AS_PUBLISHED: return full_as_published(at, below);
        case METHOD_FULL: return full_corrected(at, below);
        case METHOD_PHYSICS_AS_PUBLISHED: return physics_as_published(at, across, below, line);
        case METHOD_PHYSICS: return physics_corrected(at, across, below, line);
    }
    return vec4(0.0);
}

void main() {
    uint i = draw.index;
    vec2 at = gl_FragCoord.xy;
    vec2 from_anchor = at - waters[i].anchor;
    vec2 down = waters[i].down;
    // Where on the hull-water line this pixel's column stands, and how far below it the pixel is.
    float across = dot(from_anchor, vec2(down.y, -down.x));
    float column = hull_column(i, across);
    float held = clamp(column, 0.0, float(HULL_LINE_COLUMNS - 1));
    float line = hull_line(i, held);
    float below = dot(from_anchor, down) - line;
    if (below < 0.0) {
        discard;
    }
    vec4 mirrored = reflection(at, across, below, line);
    if (SHADOW == SHADOW_NONE) {
        if (mirrored.a == 0.0) {
            discard;
        }
        colour = mirrored;
        return;
    }
    // Eq. 7. As published it is not clamped by itself; beyond its reach there is no shadow either way.
    float proportion = clamp(waters[i].shadow - below * waters[i].shadow_fall, 0.0, 1.0);
    if (METHOD == METHOD_BAKED) {
        // Within its reach of one, faded over the last third.
        proportion = kept_off(below, line) * min(3.0 * proportion, 1.0);
    }
    float lit;
    if (METHOD == METHOD_FULL_AS_PUBLISHED || METHOD == METHOD_PHYSICS_AS_PUBLISHED) {
        // Eq. 8 as published: halved wherever there is any shadow at all.
        lit = proportion > 0.0 && column == held ? 0.5 * (1.0 - proportion) : 1.0;
    } else {
        // Corrected: nothing is halved where the shadow ends, and beyond the ends of the hull it fades over a quarter of its depth.
        float beyond = abs(column - held) / waters[i].columns.y;
        float depth = waters[i].shadow / waters[i].shadow_fall;
        lit = 1.0 - proportion * clamp(1.0 - 4.0 * beyond / depth, 0.0, 1.0);
    }
    if (lit == 1.0 && mirrored.a == 0.0) {
        discard;
    }
    colour = vec4(mirrored.rgb * lit, 1.0 - (1.0 - mirrored.a) * lit);
}
