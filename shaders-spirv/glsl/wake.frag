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
#include "wake_foam.glsl"

layout(location = 0) in vec3 place;
layout(location = 1) in vec3 side;
layout(location = 2) in vec4 track;
layout(location = 3) in vec4 water;
layout(location = 4) flat in WakeHead head;

layout(location = 0) out vec4 colour;

const float G = 9.81;
// Slope beyond which waves break: of Stokes' steepest wave, 0.443, a wide margin.
const float SLOPE_MAX = 0.35;
const float TAU = 6.2831853;
// Seconds after which waves are no longer drawn, as the host's WAVES_S.
const float WAVES_S = 9.0;

float fresnel(float c) {
    float inside = sqrt(0.7956 + c * c);
    float s = (c - inside) / (c + inside), p = (1.7956 * c - inside) / (1.7956 * c + inside);
    return 0.5 * (s * s + p * p);
}

// Never negative, and rounded off where a rough sea has no edge.
float positive(float v, float rough) {
    return 0.5 * (v + sqrt(v * v + rough * rough));
}

// Light of a sea tilted by `slope` along the line of sight `down`wards, before it is fitted to the picture.
vec3 sea_light(float down, float slope_to_eye, float rough) {
    float cosine = min(positive(down + slope_to_eye, rough), 1.0);
    float up = positive(down + 2.0 * slope_to_eye, rough);
    vec3 sky = mix(frame.horizon.rgb, frame.sky.rgb, smoothstep(0.0, 0.6, up));
    // What comes out of clear to greenish water, as a share of a white matt surface (Mobley 1994, fig. 3.27).
    vec3 body = vec3(0.008, 0.016, 0.018) * (frame.sun.rgb + frame.sky.rgb);
    float mirrored = fresnel(cosine);
    return mirrored * sky + (1.0 - mirrored) * body;
}

// One of the two waves: slope backwards and outwards, and how steep it is. `t` is the tangent of its angle, `right` and `below` what a
// pixel's step is on the track.
vec3 wave(float t, vec2 at, float k0, float strength, vec2 hull, vec2 right, vec2 below, out float phase) {
    float secant = sqrt(1.0 + t * t);
    float k = k0 * secant * secant;
    vec2 turns = k0 * secant * vec2(1.0, -t);
    phase = dot(turns, at);
    // As many waves as pixels cannot be drawn.
    float seen = 1.0 - smoothstep(0.8, 2.4, abs(dot(turns, right)) + abs(dot(turns, below)));
    // A bow is a tenth of the hull's length, and waves much longer than the hull are not raised.
    vec2 own = turns * vec2(0.1, 0.15) * hull;
    float long_ones = k * hull.x / TAU;
    long_ones *= long_ones;
    float a = strength * seen * long_ones / (1.0 + long_ones) * exp(-0.5 * min(dot(own, own), 80.0));
    float steep = a * k;
    // Steeper ones have broken: they stay at the limit.
    a *= min(1.0, SLOPE_MAX / max(steep, 1e-4));
    return vec3(-a * sin(phase) * turns, steep);
}

// Foam's cover at a place and the cover of bubbles.
vec2 foam(float x, float y, float speed, float age, float length_m, float beam, float uneven) {
    float froude = speed * inversesqrt(G * length_m);
    float strength = smoothstep(0.12, 0.45, froude);
    float half_s = 0.5 * length_m / max(speed, 0.5);
    float since_bow = max(age + half_s, 0.0), since_stern = max(age - half_s, 0.0);
    // A planing boat meets the water farther aft.
    float start = length_m * mix(0.04, 0.4, smoothstep(0.5, 1.1, froude));
    float entry = clamp((x - 0.02 * length_m) / (0.4 * length_m), 0.0, 1.0);
    float edge = 0.5 * beam * (1.0 - (1.0 - entry) * (1.0 - entry));
    // Thrown aside at the bow, it falls back along the side and drifts off.
    float from_start = max(x - start, 0.0);
    float middle = edge + 0.06 * beam + 0.1 * from_start, width = 0.07 * beam + 0.06 * from_start;
    float across = (y - middle) / width;
    float bow = smoothstep(0.0, 0.05 * length_m, x - start) * exp(-across * across - since_bow / 3.53);
    // Behind the stern the water is mixed: wide as the hull, and wider by the fifth root of the distance.
    float behind = max(x - length_m, 0.0);
    float half_width = 0.5 * beam * pow(1.0 + behind / beam, 0.2) * (0.8 + 0.4 * uneven);
    float inside = (1.0 - smoothstep(0.55, 1.2, y / half_width)) * smoothstep(-0.04, 0.02, x / length_m - 1.0);
    float stern = inside * (0.85 * exp(-since_stern / 3.53) + 0.15 * exp(-since_stern / 10.0));
    float bubbles = max(inside * exp(-since_stern / 14.0), 0.7 * bow);
    return strength * vec2(max(0.7 * bow, stern), bubbles);
}

void main() {
    float length_m = head.hull.x, beam = head.hull.y, haze = head.hull.z, rough = head.up.w;
    float x = track.x, y = abs(track.y), speed = max(track.z, 0.3), share = water.z;
    float outward = track.y < 0.0 ? -1.0 : 1.0;

    vec2 right = dFdx(track.xy), below = dFdy(track.xy), moved = fwidth(water.xy);
    float footprint = max(moved.x, moved.y);
    // A step to port of the track is one inwards.
    right.y *= outward;
    below.y *= outward;

    // Waves: gone before foam is, they have run off.
    float behind = max(x, 0.02 * length_m);
    float k0 = G / (speed * speed);
    float q = max(y / behind, 1e-3);
    float inside = 1.0 - 8.0 * q * q;
    float r = length(vec2(behind, y));
    // At the wedge's edge both waves meet: rounded off within a stretch that shrinks about as Airy's function does.
    float edge = inversesqrt(max(k0 * r, 0.1));
    float beyond = max(-inside, 0.0) / edge;
    float fresh = clamp(1.0 - track.w / WAVES_S, 0.0, 1.0);
    float strength = 0.4 * water.w * fresh * fresh * smoothstep(0.0, 0.25 * length_m, x);
    vec2 slope = vec2(0.0);
    float breaking = 0.0;
    if (strength > 1e-3 && beyond < 5.0) {
        strength *= pow(length_m / (y + 0.1 * r + 0.3 * length_m), 0.345) * exp(-beyond)
            * inversesqrt(sqrt(max(inside, 0.0) + edge));
        // Wind and sea make it uneven.
        strength *= 0.55 + 0.9 * noise(water.xy / 5.0);
        float root = sqrt(max(inside, 0.0));
        float transverse = min(2.0 * q / (1.0 + root), 0.7071), diverging = max((1.0 + root) / (4.0 * q), 0.7071);
        vec2 at = vec2(behind, y), hull = head.hull.xy;
        float phase_one, phase_two;
        vec3 one = wave(transverse, at, k0, strength, hull, right, below, phase_one);
        vec3 two = wave(diverging, at, k0, strength, hull, right, below, phase_two);
        slope = one.xy + two.xy;
        slope *= min(1.0, SLOPE_MAX / max(length(slope), 1e-4));
        if (max(one.z, two.z) > 0.3) {
            breaking = smoothstep(0.3, 0.5, max(one.z * cos(phase_one), two.z * cos(phase_two)));
        }
    }

    // Foam, and crests that break.
    vec2 cover = vec2(0.0);
    // Nothing of it is farther off the track than this.
    if (y < beam + 0.25 * x) {
        cover = foam(x, y, speed, track.w, length_m, beam, noise(water.xy / 1.9));
    }
    cover.x = max(cover.x, 0.8 * breaking);
    // What pixels do not show of the lace is evenly spread.
    float white = 0.0, lace = 0.5;
    if (cover.x > 0.02) {
        float shown;
        lace = foam_lace(water.xy, footprint, shown);
        float soft = mix(0.5, 0.22, shown);
        float threshold = 1.0 + soft - cover.x * (1.0 + 2.0 * soft);
        white = smoothstep(threshold - soft, threshold + soft, 0.5 + 1.6 * (lace - 0.5)) * share;
    }

    // How the tilted water looks from here. Backwards is against the boat's way.
    float clear = 1.0 - haze, covered = 0.0;
    vec3 added = vec3(0.0);
    if (max(abs(slope.x), abs(slope.y)) * share > 0.003) {
        vec3 ray = normalize(place), up = head.up.xyz;
        float down = max(-dot(ray, up), 1e-4);
        vec3 back = cross(side, up);
        // Water that rises away from the eye faces it.
        float to_eye = (slope.x * dot(ray, back) + slope.y * outward * dot(ray, side)) * share;
        vec3 flat_light = sea_light(down, 0.0, rough) * head.sea.rgb;
        vec3 light = sea_light(down, to_eye, rough) * head.sea.rgb;
        const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
        float ratio = dot(light, LUMINANCE) / max(dot(flat_light, LUMINANCE), 1e-4);
        covered = clamp(1.0 - ratio, 0.0, 0.7) * clear;
        added = clamp(light - flat_light, 0.0, 1.0) * clear;
    }

    // Bubbles beneath the surface make the water pale, foam hides it.
    float pale = 0.25 * cover.y * share;
    vec3 paleness = mix(head.foam.rgb * vec3(0.42, 0.60, 0.58), frame.horizon.rgb, haze);
    added = mix(added, paleness, pale);
    covered = 1.0 - (1.0 - covered) * (1.0 - pale);
    // Foam is uneven: thick where the lace is.
    vec3 whiteness = mix(head.foam.rgb * (0.5 + lace), frame.horizon.rgb, haze);
    colour = vec4(mix(added, whiteness, white), 1.0 - (1.0 - covered) * (1.0 - white));
}
