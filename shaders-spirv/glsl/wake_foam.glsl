// The lace of foam: even noise that is fixed to the water.

// From 0 to 2^24: a place's number, scrambled once; its upper bits are even.
float corner_value(uint number) {
    number = (number ^ (number >> 15)) * 0x2c1b3c6du;
    return float(int((number ^ (number >> 13)) >> 8));
}

// Between 0 and 1.
float noise(vec2 at) {
    const uint COLUMN = 0x9e3779b1u, ROW = 0x85ebca77u;
    vec2 low = floor(at), part = at - low;
    ivec2 i = ivec2(low);
    uint first = uint(i.x) * COLUMN + uint(i.y) * ROW;
    part *= part * (3.0 - 2.0 * part);
    return mix(mix(corner_value(first), corner_value(first + COLUMN), part.x),
        mix(corner_value(first + ROW), corner_value(first + COLUMN + ROW), part.x), part.y) * (1.0 / 16777216.0);
}

// Lace of three sizes at a place on the water (metres), each as far as pixels that are `footprint` metres wide show it; `shown` is
// the share of it that they do show.
float foam_lace(vec2 place, float footprint, out float shown) {
    vec3 seen = vec3(0.36, 0.36, 0.28)
        * (1.0 - smoothstep(vec3(0.3), vec3(0.8), footprint * vec3(1.0 / 1.3, 1.0 / 0.45, 1.0 / 0.16)));
    shown = seen.x + seen.y + seen.z;
    float lace = 0.5;
    if (seen.x > 0.0) {
        lace += seen.x * (noise(place * (1.0 / 1.3)) - 0.5);
    }
    if (seen.y > 0.0) {
        lace += seen.y * (noise(place * (1.0 / 0.45)) - 0.5);
    }
    if (seen.z > 0.0) {
        lace += seen.z * (noise(place * (1.0 / 0.16)) - 0.5);
    }
    return lace;
}
