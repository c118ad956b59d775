// Nelson 2009, "Full Reflection" shader, equations 4 to 6, as published and corrected.
struct FullPublishedBlock {
    float alpha;        // share of the mirrored light at the hull-water line
    float alpha_fall;   // alpha / k of eq. 6, per pixel
    float shift;        // largest shift of the mirror coordinate, pixels
    float shift_limit;  // beyond it the reflection is discarded, pixels
    vec2 blur;          // step of the box blur, texture coordinates
    vec2 bright;        // brightness below and above which the video passes through
};

struct FullBlock {
    float alpha;        // as above
    float alpha_fall;
    float shift;        // largest shift of the mirror coordinate, pixels
    float shift_limit;  // it stops there, pixels
    float shift_near;   // share of the largest shift at the hull-water line
    float shift_grow;   // how that share grows, per pixel below the line
    vec2 pad;
};

layout(std140, set = 0, binding = 8) uniform FullsPublished {
    FullPublishedBlock full_published_blocks[WATERS_MAX];
};
layout(std140, set = 0, binding = 8) uniform Fulls {
    FullBlock full_blocks[WATERS_MAX];
};

// 3x3 box from four bilinear fetches: 2/3 of a texel beyond the middle weighs two texels of a row as 1 and 1/2.
vec4 blurred(vec2 at, vec2 texel) {
    vec4 sum = vec4(0.0), bounds = waters[draw.index].mirror_bounds;
    for (int i = 0; i < 4; ++i) {
        vec2 corner = vec2((i & 1) == 0 ? -1.0 : 1.0, (i & 2) == 0 ? -1.0 : 1.0);
        sum += texture(mirror, clamp(at + corner * texel * 0.6667, bounds.xy, bounds.zw));
    }
    return 0.25 * sum;
}

vec4 full_as_published(vec2 at, float below) {
    FullPublishedBlock b = full_published_blocks[draw.index];
    float alpha = b.alpha - below * b.alpha_fall;
    if (alpha <= 0.0) {
        return vec4(0.0);
    }
    vec3 here = code_at(at);
    float luma = dot(here, vec3(0.299, 0.587, 0.114));
    if (luma < b.bright.x || luma > b.bright.y) {
        return vec4(0.0);
    }
    float shift = sin(normalised_mean(at, here)) * b.shift;
    // Not "greater, then discard": NaN, which compares false, is discarded too.
    if (!(abs(shift) <= b.shift_limit)) {
        return vec4(0.0);
    }
    return alpha * blurred(mirror_uv(at) + shift * waters[draw.index].mirror_scale, b.blur);
}

// At a grazing angle waves move a reflection up and down much more than sideways, and the more the farther below the hull it is. What
// goes beyond the limit stays at it: discarded, it would leave specks of bare water in a dark reflection.
vec4 full_corrected(vec2 at, float below) {
    FullBlock b = full_blocks[draw.index];
    float alpha = b.alpha - below * b.alpha_fall;
    if (alpha <= 0.0) {
        return vec4(0.0);
    }
    vec2 wave = field_at(at);
    float shift = clamp((wave.x * 2.0 - 1.0) * b.shift, -b.shift_limit, b.shift_limit);
    shift *= min(b.shift_near + below * b.shift_grow, 1.0);
    return alpha * wave.y * mirror_at(at + shift * wave_direction());
}
