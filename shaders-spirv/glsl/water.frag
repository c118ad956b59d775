#version 460
#extension GL_GOOGLE_include_directive : require
// A boat's light on the sea: Nelson 2009, "Full Reflection" shader, equations 4 to 8, and "Physics" shader, equations 9 to 16. The
// video is compared as sRGB codes, as the thesis does; what is mixed is linear light. Output is premultiplied: it covers alpha of the
// sea and adds light.
#include "frame.glsl"
#include "water_block.glsl"
#include "hull_line.glsl"

// 0 none, 1 plain mirror; Full Reflection: 2 as printed, 3 singular cases mended; Physics: 4 as printed, 5 mended; 6 none, and the shadow as the light has it.
layout(constant_id = 0) const uint METHOD = 3;
// Shadow level, 0 to 2.
layout(constant_id = 1) const uint SHADOW = 0;

layout(push_constant) uniform DrawBlock {
    vec4 rect;
    uint index;
    uint first;
} draw;

// The video beneath, as codes.
layout(set = 1, binding = 0) uniform sampler2D video;
// The boats mirrored in the sea, premultiplied linear light; mended, softened by soften.frag.
layout(set = 1, binding = 1) uniform sampler2D mirror;

// Mended: what field.frag found.
layout(set = 1, binding = 2) uniform sampler2D field;

// Physics, mended: waves of the sea's spectrum, each radians a metre away from the eye and to the right, metres high, phase at the anchor.
const int WAVES = 8;
layout(std430, set = 0, binding = 6) readonly buffer WavesBlock {
    vec4 list[];
} waves;

layout(location = 0) out vec4 colour;

// Mended: how far sideways a wave moves the reflection, in parts of how far down.
const float SIDEWAYS = 0.35;

vec3 code_at(vec2 pixel) {
    return texelFetch(video, ivec2(clamp(pixel, vec2(0.0), frame.size - 1.0)), 0).rgb;
}

// Eq. 4 and 5 as printed, at every pixel.
float normalised_mean(vec2 at, vec3 here) {
    float least = 1e9, greatest = 0.0, sum = 0.0;
    for (int n = 1; n <= 9; ++n) {
        float gradient = distance(here, code_at(at + vec2(0.0, float(n))));
        least = min(least, gradient);
        greatest = max(greatest, gradient);
        sum += gradient;
    }
    // 0 / 0 on a flat patch. What follows may be no number: the caller's limit test is written so that it is discarded.
    return 2.0 / (greatest - least) * (sum / 9.0 - greatest) + 1.0;
}

// 3x3 box from four bilinear fetches: 2/3 of a texel beyond the middle weighs two texels of a row as 1 and 1/2.
vec4 blurred(vec2 at, vec2 texel, vec4 bounds) {
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        vec2 corner = vec2((i & 1) == 0 ? -1.0 : 1.0, (i & 2) == 0 ? -1.0 : 1.0);
        sum += texture(mirror, clamp(at + corner * texel * 0.6667, bounds.xy, bounds.zw));
    }
    return 0.25 * sum;
}

// Eq. 9 and 10, or the spectrum: height of the water and its slope away from the eye at a place (metres from the eye and to the right).
vec2 wave_at(float depth, float right) {
    uint i = draw.index;
    if (METHOD == 4) {
        float height = waters[i].alpha, freq = waters[i].alpha_fall;
        float swell = waters[i].shift_near, swell_freq = waters[i].shift_grow;
        return vec2(
            height * sin(freq * depth) + height * sin(freq * right) + swell * sin(swell_freq * depth)
                + swell * sin(swell_freq * right),
            height * freq * cos(freq * depth) + height * freq * cos(freq * right)
                + swell * swell_freq * cos(swell_freq * depth) + swell * swell_freq * cos(swell_freq * right));
    }
    // From the anchor, where the host knows the phases: no digits are lost at any distance.
    vec2 from_anchor = vec2(depth - waters[i].passes.z / waters[i].passes.x, right);
    vec2 sum = vec2(0.0);
    for (int n = 0; n < WAVES; ++n) {
        vec4 w = waves.list[n];
        float phase = dot(w.xy, from_anchor) + w.w;
        sum += w.z * vec2(cos(phase), -w.x * sin(phase));
    }
    return sum;
}

// Whether the line of sight, mirrored by the wave at a pixel, meets the ship: eq. 11 to 16. `below` and `line` are pixels.
bool meets_ship(float across, float below, float line) {
    uint i = draw.index;
    float tangent0 = waters[i].passes.x, per_pixel = waters[i].passes.y, eye = waters[i].passes.z;
    float ship = eye / (tangent0 + line * per_pixel);
    float depth = eye / (tangent0 + (line + below) * per_pixel);
    vec2 wave = wave_at(depth, across * per_pixel * depth);
    vec2 to_eye = normalize(vec2(-depth, eye - wave.x));
    vec2 normal;
    if (METHOD == 4) {
        // The intercepts of the tangent: infinite at every crest and trough.
        float x_inter = -wave.x / wave.y + depth;
        float y_inter = wave.y * -depth + wave.x;
        normal = normalize(vec2(y_inter, x_inter));
    } else {
        normal = vec2(-wave.y, 1.0) / sqrt(1.0 + wave.y * wave.y);
    }
    vec2 mirrored = 2.0 * normal * dot(normal, to_eye) - to_eye;
    float height = mirrored.y / mirrored.x * (ship - depth) + wave.x;
    bool away = METHOD == 4 || (mirrored.x > 0.0 && dot(normal, to_eye) > 0.0);
    // No number is within no bounds.
    return away && height >= 0.0 && height < waters[i].passes.w;
}

// IEC 61966-2-1.
vec3 linear_of(vec3 code) {
    return mix(code / 12.92, pow((code + 0.055) / 1.055, vec3(2.4)), greaterThan(code, vec3(0.04045)));
}

// Table 1: the nine pixels about this one, each the ship mirrored with the same shift as in the other shader where it is met, else the
// video. As printed the kernel blurs both, and the whole ocean; here only what has the ship in one of the nine. Mended it blurs the
// ship alone: the camera's own pixels stay sharp.
vec4 physics(vec2 at, float across, float below, float line, vec2 move) {
    uint i = draw.index;
    vec2 down = waters[i].down, right = vec2(down.y, -down.x);
    vec4 bounds = waters[i].mirror_bounds;
    vec4 sum = vec4(0.0);
    vec3 behind = vec3(0.0);
    bool any_hit = false;
    for (int n = 0; n < 9; ++n) {
        vec2 step = vec2(float(n % 3 - 1), float(n / 3 - 1));
        float weight = n == 4 ? 0.5 : 1.0 / 16.0;
        vec4 here = vec4(0.0);
        if (meets_ship(across + dot(step, right), below + dot(step, down), line)) {
            vec2 uv = (at + step + move) * waters[i].mirror_scale + waters[i].mirror_offset;
            here = texture(mirror, clamp(uv, bounds.xy, bounds.zw));
            any_hit = any_hit || here.a > 0.0;
        }
        sum += weight * here;
        if (METHOD == 4) {
            behind += weight * (1.0 - here.a) * linear_of(code_at(at + step));
        }
    }
    return METHOD == 4 && any_hit ? vec4(sum.rgb + behind, 1.0) : sum;
}

// Share of the mirrored light and the mirrored light itself, premultiplied.
vec4 reflection(vec2 at, float across, float below, float line) {
    uint i = draw.index;
    if (METHOD == 0 || METHOD == 6) {
        return vec4(0.0);
    }
    vec2 uv = at * waters[i].mirror_scale + waters[i].mirror_offset;
    vec4 bounds = waters[i].mirror_bounds;
    float limit = waters[i].shift_limit;
    vec2 down = waters[i].down;
    if (METHOD == 4) {
        float shift = sin(normalised_mean(at, code_at(at))) * waters[i].shift;
        return abs(shift) <= limit ? physics(at, across, below, line, vec2(shift)) : vec4(0.0);
    }
    if (METHOD == 5) {
        vec2 wave = texture(field, at / (vec2(textureSize(field, 0)) * vec2(4.0, 2.0))).rg;
        float shift = clamp((wave.x * 2.0 - 1.0) * waters[i].shift, -limit, limit);
        return waters[i].alpha * physics(at, across, below, line, shift * (down + SIDEWAYS * vec2(down.y, -down.x)));
    }
    // Eq. 6.
    float alpha = waters[i].alpha - below * waters[i].alpha_fall;
    if (alpha <= 0.0) {
        return vec4(0.0);
    }
    if (METHOD == 1) {
        return alpha * texture(mirror, clamp(uv, bounds.xy, bounds.zw));
    }
    if (METHOD == 2) {
        vec3 here = code_at(at);
        float bright = dot(here, vec3(0.299, 0.587, 0.114));
        if (bright < waters[i].passes.y || bright > waters[i].passes.z) {
            return vec4(0.0);
        }
        float shift = sin(normalised_mean(at, here)) * waters[i].shift;
        // Not "greater, then discard": what is no number is discarded too.
        if (!(abs(shift) <= waters[i].shift_limit)) {
            return vec4(0.0);
        }
        return alpha * blurred(uv + shift * waters[i].mirror_scale, waters[i].blur, bounds);
    }
    // Mended: at a grazing angle waves move a reflection up and down much more than sideways, and the more the farther below
    // the hull it is. What goes beyond the limit stays at it: discarded, it would leave specks of bare water in a dark
    // reflection.
    vec2 wave = texture(field, at / (vec2(textureSize(field, 0)) * vec2(4.0, 2.0))).rg;
    float shift = clamp((wave.x * 2.0 - 1.0) * waters[i].shift, -limit, limit);
    shift *= min(waters[i].shift_near + below * waters[i].shift_grow, 1.0);
    vec2 move = shift * (down + SIDEWAYS * vec2(down.y, -down.x));
    return alpha * wave.y * texture(mirror, clamp(uv + move * waters[i].mirror_scale, bounds.xy, bounds.zw));
}

// Share of the sea's light that the hull keeps from a pixel: of the light that comes out of the water, what the part of the sky gave
// that the hull hides (a wall seen under the angle a hides (1 - cos a) / 2), and the sun where its shadow lies. `below` and `line` are
// pixels.
float kept_off(float below, float line) {
    uint i = draw.index;
    float tangent0 = waters[i].passes.x, per_pixel = waters[i].passes.y, eye = waters[i].passes.z, high = waters[i].passes.w;
    float near = tangent0 + line * per_pixel;
    float from_hull = eye / near - eye / (near + below * per_pixel);
    float hidden = 0.5 - 0.5 * from_hull * inversesqrt(from_hull * from_hull + high * high);
    float in_shadow = 1.0 - smoothstep(0.75, 1.05, from_hull / max(waters[i].shift, 1e-3));
    return waters[i].alpha * hidden + waters[i].alpha_fall * in_shadow;
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
    if (SHADOW == 0) {
        if (mirrored.a == 0.0) {
            discard;
        }
        colour = mirrored;
        return;
    }
    // Eq. 7. As printed it is not clamped by itself; beyond its reach there is no shadow either way.
    float proportion = clamp(waters[i].shadow - below * waters[i].shadow_fall, 0.0, 1.0);
    if (METHOD == 6) {
        // Within its reach of one, faded over the last third.
        proportion = kept_off(below, line) * min(3.0 * proportion, 1.0);
    }
    float lit;
    if (METHOD == 2 || METHOD == 4) {
        // Eq. 8 as printed: halved wherever there is any shadow at all.
        lit = proportion > 0.0 && column == held ? 0.5 * (1.0 - proportion) : 1.0;
    } else {
        // Mended: nothing is halved where the shadow ends, and beyond the ends of the hull it fades over a quarter of its depth.
        float beyond = abs(column - held) / waters[i].columns.y;
        float depth = waters[i].shadow / waters[i].shadow_fall;
        lit = 1.0 - proportion * clamp(1.0 - 4.0 * beyond / depth, 0.0, 1.0);
    }
    if (lit == 1.0 && mirrored.a == 0.0) {
        discard;
    }
    colour = vec4(mirrored.rgb * lit, 1.0 - (1.0 - mirrored.a) * lit);
}
