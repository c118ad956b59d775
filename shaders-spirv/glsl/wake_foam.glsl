// The lace of foam: even noise that is fixed to the water.

uint mixed(uvec2 v) {
    // PCG (Jarzynski & Olano 2020), two to one.
    v = v * 1664525u + 1013904223u;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> 16;
    v.x += v.y * 1664525u;
    return v.x ^ (v.x >> 16);
}

float corner_value(ivec2 at) {
    return float(mixed(uvec2(at)) >> 8) * (1.0 / 16777216.0);
}

// Between 0 and 1.
float noise(vec2 at) {
    vec2 low = floor(at), part = at - low;
    ivec2 i = ivec2(low);
    part *= part * (3.0 - 2.0 * part);
    return mix(mix(corner_value(i), corner_value(i + ivec2(1, 0)), part.x),
        mix(corner_value(i + ivec2(0, 1)), corner_value(i + ivec2(1, 1)), part.x), part.y);
}

// Lace of three sizes at a place on the water (metres), each as far as pixels that are `footprint` metres wide show it; `shown` is
// the share of it that they do show.
float foam_lace(vec2 place, float footprint, out float shown) {
    vec3 sizes = vec3(1.3, 0.45, 0.16);
    vec3 seen = vec3(0.36, 0.36, 0.28) * (1.0 - smoothstep(vec3(0.3), vec3(0.8), footprint / sizes));
    shown = seen.x + seen.y + seen.z;
    return 0.5 + seen.x * (noise(place / sizes.x) - 0.5) + seen.y * (noise(place / sizes.y) - 0.5)
        + seen.z * (noise(place / sizes.z) - 0.5);
}
