#version 460
#extension GL_GOOGLE_include_directive : require
// Waves and foam that a boat under way leaves on the water, as a change of the video's linear light. Output is premultiplied.
//
// Waves: Kelvin's stationary phase. A wave of direction angle a to the track has the wavenumber k0 / cos^2 a, k0 = g / U^2; at a place
// x behind the bow and y aside, those with tan a = t are seen that solve y (1 + 2 t^2) = x t: a transverse and a diverging one, none
// beyond y = x / root 8. Their strength by wavenumber is that of a slender hull (Benzaquen, Darmon & Raphael 2014: a Gaussian that is longer
// than wide), their height the host's. They tilt the water, which then mirrors another part of the sky (Fresnel, n = 1.34).
// Foam: 0.55 of the light (Whitlock, Bartlett & Gurganus 1982), gone by exp(-t / 3.53 s) (Monahan, Davidson & Spiel 1982), beneath it
// clouds of bubbles that last four times as long.
#include "frame.glsl"
#include "wake_block.glsl"
#include "wake_light.glsl"
#include "wake_foam.glsl"
#include "foam_sunlit.glsl"

// As wake.vert has them.
layout(location = 0) in vec4 from_eye;
layout(location = 1) in vec4 track;
layout(location = 2) in vec4 water;
layout(location = 3) in vec4 foam;
layout(location = 4) in vec3 shade;
layout(location = 5) flat in WakeLight light;

layout(location = 0) out vec4 colour;

// Slope beyond which waves break: of Stokes' steepest wave, 0.443, a wide margin.
const float SLOPE_MAX = 0.35;
// Slope below which nothing of a wave is seen, as the host's waves_within_m has it.
const float SLOPE_SEEN = 0.003;
const float TAU = 6.2831853;

// Sine of so many turns, within 0.001.
float sine_of_turns(float turns) {
    float f = turns - floor(turns + 0.5);
    float s = f * (8.0 - 16.0 * abs(f));
    return s * (0.775 + 0.225 * abs(s));
}

// Fresnel's formula for unpolarised light on water, n = 1.34, over a common denominator: one division is dear enough.
float fresnel(float c) {
    float inside = sqrt(0.7956 + c * c);
    float a = c + inside, b = 1.7956 * c + inside;
    float s = (c - inside) * b, p = (1.7956 * c - inside) * a, all = a * b;
    return 0.5 * (s * s + p * p) / (all * all);
}

// Never negative, and rounded off where a rough sea has no edge.
float positive(float v, float mean_square_slope) {
    return 0.5 * (v + sqrt(v * v + mean_square_slope));
}

// Share of the sky that a sea mirrors which is tilted by `slope_to_eye` along the line of sight `down`wards, and share of the higher
// sky: what wake_light's colours are multiplied with.
vec2 mirrored_share(float down, float slope_to_eye, float mean_square_slope) {
    float cosine = min(positive(down + slope_to_eye, mean_square_slope), 1.0);
    float t = min(positive(down + 2.0 * slope_to_eye, mean_square_slope) * (1.0 / 0.6), 1.0);
    return fresnel(cosine) * vec2(1.0, t * t * (3.0 - 2.0 * t));
}

// One of the two waves at a place behind the bow and aside: slope backwards and outwards, and how steep it is. `t` is the tangent of
// its angle, `right` and `below` a pixel's step on the track, `own` the hull's spectrum by both parts of the wavenumber.
vec3 wave(float t, vec2 at, float k0, float strength, vec2 own, vec2 right, vec2 below, out float turns) {
    float secant2 = 1.0 + t * t, kx = k0 * sqrt(secant2), k = k0 * secant2;
    turns = kx * (at.x - t * at.y) * (1.0 / TAU);
    // Waves much longer than the hull are not raised.
    float long_ones = k * light.hull.x * (1.0 / TAU);
    long_ones *= long_ones;
    float a = strength * long_ones / (1.0 + long_ones), fall = kx * kx * (own.x + t * t * own.y);
    if (a * k < SLOPE_SEEN || fall > 9.0) {
        return vec3(0.0);
    }
    // As many waves as pixels cannot be drawn.
    a *= 1.0 - smoothstep(0.8, 2.4, kx * (abs(right.x - t * right.y) + abs(below.x - t * below.y)));
    a *= exp2(-fall);
    // Steeper ones have broken: they stay at the limit.
    return vec3((-min(a, SLOPE_MAX / k) * sine_of_turns(turns) * kx) * vec2(1.0, -t), a * k);
}

// Slope of the water at a place behind the bow and aside, backwards and outwards, and how much of it breaks.
vec3 waves(float x, float y, vec2 right, vec2 below) {
    float k0 = track.z, sharp = from_eye.w;
    float behind = max(x, 0.02 * light.hull.x);
    // Tangent of the angle off the track and its inverse, by one division.
    float aside = max(y, 1e-3 * behind), over = 1.0 / (aside * behind);
    float q = aside * aside * over, inverse = behind * behind * over;
    float inside = 1.0 - 8.0 * q * q;
    float beyond = max(-inside, 0.0) * sharp;
    if (track.w < 1e-3 || beyond >= 5.0) {
        return vec3(0.0);
    }
    // Wind and sea make it uneven.
    float strength = track.w * exp2(-1.442695 * beyond) * inversesqrt(sqrt(max(inside, 0.0) + 1.0 / sharp))
        * (0.55 + 0.9 * noise(water.xy * 0.2));
    float root = sqrt(max(inside, 0.0));
    float transverse = min(0.25 * (1.0 - root) * inverse, 0.7071), diverging = max(0.25 * (1.0 + root) * inverse, 0.7071);
    // A bow is a tenth of the hull's length: half of the square, by the logarithm's base.
    vec2 own = vec2(0.1, 0.15) * light.hull.xy;
    own *= 0.7213475 * own;
    float turns_one, turns_two;
    vec3 one = wave(transverse, vec2(behind, y), k0, strength, own, right, below, turns_one);
    vec3 two = wave(diverging, vec2(behind, y), k0, strength, own, right, below, turns_two);
    vec2 slope = one.xy + two.xy;
    slope *= min(1.0, SLOPE_MAX * inversesqrt(max(dot(slope, slope), 1e-8)));
    float breaking = 0.0;
    if (max(one.z, two.z) > 0.3) {
        float crest = max(one.z * sine_of_turns(turns_one + 0.25), two.z * sine_of_turns(turns_two + 0.25));
        breaking = smoothstep(0.3, 0.5, crest);
    }
    return vec3(slope, breaking);
}

// Cover of foam and of bubbles at a place behind the bow and aside.
vec2 foam_at(float x, float y) {
    float length_m = light.hull.x, beam = light.hull.y, start = water.w;
    vec2 cover = vec2(0.0);
    // Thrown aside at the bow, it falls back along the side and drifts off.
    float from_start = x - start;
    if (foam.z > 0.02 && from_start > 0.0) {
        float entry = 1.0 - clamp((x - 0.02 * length_m) / (0.4 * length_m), 0.0, 1.0);
        float edge = 0.5 * beam * (1.0 - entry * entry);
        float across = (y - edge - 0.06 * beam - 0.1 * from_start) / (0.07 * beam + 0.06 * from_start);
        if (abs(across) < 2.2) {
            cover = vec2(smoothstep(0.0, 0.05 * length_m, from_start) * foam.z * exp2(-1.442695 * across * across));
        }
    }
    // Behind the stern the water is mixed.
    if (x > 0.96 * length_m && y < 1.44 * foam.w) {
        float half_width = foam.w * (0.8 + 0.4 * noise(water.xy * (1.0 / 1.9)));
        float inside = (1.0 - smoothstep(0.55, 1.2, y / half_width)) * smoothstep(-0.04, 0.02, x / length_m - 1.0);
        cover = max(cover, inside * foam.xy);
    }
    return cover;
}

void main() {
    float x = track.x, y = abs(track.y), share = water.z, haze = light.hull.z;
    float outward = track.y < 0.0 ? -1.0 : 1.0;
    vec2 right = dFdx(track.xy), below = dFdy(track.xy), moved = fwidth(water.xy);
    // A step to port of the track is one inwards.
    vec3 wave = waves(x, y, vec2(right.x, right.y * outward), vec2(below.x, below.y * outward));

    // Foam, and crests that break.
    vec2 cover = foam_at(x, y);
    cover.x = max(cover.x, 0.8 * wave.z);
    // What pixels do not show of the lace is evenly spread.
    float white = 0.0, lace = 0.5;
    if (cover.x > 0.02) {
        float shown;
        lace = foam_lace(water.xy, max(moved.x, moved.y), shown);
        float soft = mix(0.5, 0.22, shown);
        float threshold = 1.0 + soft - cover.x * (1.0 + 2.0 * soft);
        white = smoothstep(threshold - soft, threshold + soft, 0.5 + 1.6 * (lace - 0.5)) * share;
    }

    // How the tilted water looks from here. Backwards is against the boat's way; water that rises away from the eye faces it.
    float clear = 1.0 - haze, covered = 0.0;
    vec3 added = vec3(0.0);
    if (max(abs(wave.x), abs(wave.y)) * share > SLOPE_SEEN) {
        vec3 ray = normalize(from_eye.xyz);
        float down = max(ray.z, 1e-4);
        float to_eye = (wave.x * ray.x + wave.y * outward * ray.y) * share;
        vec2 level = mirrored_share(down, 0.0, light.hull.w);
        vec2 more = mirrored_share(down, to_eye, light.hull.w) - level;
        float luminance = light.body.a + level.x * light.mirrored.a + level.y * light.higher.a;
        float brighter = more.x * light.mirrored.a + more.y * light.higher.a;
        covered = clamp(-brighter / max(luminance, 1e-4), 0.0, 0.7) * clear;
        added = clamp(more.x * light.mirrored.rgb + more.y * light.higher.rgb, 0.0, 1.0) * clear;
    }

    // Bubbles beneath the surface make the water pale, foam hides it.
    float pale = 0.25 * cover.y * share;
    vec3 foamed = light.foam.rgb;
    if (max(white, pale) > 0.0) {
        foamed = foam_light(foamed, light.shade_foam.rgb, light.shade_box, shade);
    }
    vec3 paleness = mix(foamed * vec3(0.42, 0.60, 0.58), frame.horizon.rgb, haze);
    added = mix(added, paleness, pale);
    covered = 1.0 - (1.0 - covered) * (1.0 - pale);
    // Foam is uneven: thick where the lace is.
    vec3 whiteness = mix(foamed * (0.5 + lace), frame.horizon.rgb, haze);
    colour = vec4(mix(added, whiteness, white), 1.0 - (1.0 - covered) * (1.0 - white));
}
