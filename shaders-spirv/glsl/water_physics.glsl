// Nelson 2009, "Physics" shader, equations 9 to 16 and table 1, as published and corrected.
struct PhysicsPublishedBlock {
    float height;      // of the waves, metres
    float frequency;   // radians a metre
    float swell;       // the same of the swell
    float swell_frequency;
    float shift;       // largest shift of the mirror coordinate, pixels
    float shift_limit; // beyond it the reflection is discarded, pixels
    vec2 pad;
    vec4 sight;        // tangent below the horizontal at the hull-water line's anchor, its change by pixel; height of the eye and of the ship, m
};

struct PhysicsBlock {
    float share;       // of the light that is mirrored
    float shift;       // largest shift of the mirror coordinate, pixels
    float shift_limit; // it stops there, pixels
    float pad;
    vec4 sight;        // as above
};

layout(std140, set = 0, binding = 8) uniform PhysicsPublished {
    PhysicsPublishedBlock physics_published_blocks[WATERS_MAX];
};
layout(std140, set = 0, binding = 8) uniform Physics {
    PhysicsBlock physics_blocks[WATERS_MAX];
};

// Corrected: waves of the sea's spectrum, each radians a metre away from the eye and to the right, metres high, phase at the anchor.
const int PHYSICS_WAVES = 8;
layout(std140, set = 0, binding = 9) uniform WavesBlock {
    vec4 list[PHYSICS_WAVES];
} spectrum;

vec4 line_of_sight() {
    return METHOD == METHOD_PHYSICS ? physics_blocks[draw.index].sight : physics_published_blocks[draw.index].sight;
}

// Eq. 9 and 10, or the spectrum: height of the water and its slope away from the eye at a place (metres from the eye and to the right).
vec2 wave_at(float depth, float right) {
    if (METHOD == METHOD_PHYSICS_AS_PUBLISHED) {
        PhysicsPublishedBlock b = physics_published_blocks[draw.index];
        return vec2(
            b.height * sin(b.frequency * depth) + b.height * sin(b.frequency * right) + b.swell * sin(b.swell_frequency * depth)
                + b.swell * sin(b.swell_frequency * right),
            b.height * b.frequency * cos(b.frequency * depth) + b.height * b.frequency * cos(b.frequency * right)
                + b.swell * b.swell_frequency * cos(b.swell_frequency * depth)
                + b.swell * b.swell_frequency * cos(b.swell_frequency * right));
    }
    // From the anchor, where the host knows the phases: no digits are lost at any distance.
    vec4 sight = line_of_sight();
    vec2 from_anchor = vec2(depth - sight.z / sight.x, right);
    vec2 sum = vec2(0.0);
    for (int n = 0; n < PHYSICS_WAVES; ++n) {
        vec4 w = spectrum.list[n];
        float phase = dot(w.xy, from_anchor) + w.w;
        sum += w.z * vec2(cos(phase), -w.x * sin(phase));
    }
    return sum;
}

// Whether the line of sight, mirrored by the wave at a pixel, meets the ship: eq. 11 to 16. `below` and `line` are pixels.
bool meets_ship(float across, float below, float line) {
    vec4 sight = line_of_sight();
    float tangent0 = sight.x, per_pixel = sight.y, eye = sight.z;
    float ship = eye / (tangent0 + line * per_pixel);
    float depth = eye / (tangent0 + (line + below) * per_pixel);
    vec2 wave = wave_at(depth, across * per_pixel * depth);
    vec2 to_eye = normalize(vec2(-depth, eye - wave.x));
    vec2 normal;
    if (METHOD == METHOD_PHYSICS_AS_PUBLISHED) {
        // The intercepts of the tangent: infinite at every crest and trough.
        float x_inter = -wave.x / wave.y + depth;
        float y_inter = wave.y * -depth + wave.x;
        normal = normalize(vec2(y_inter, x_inter));
    } else {
        normal = vec2(-wave.y, 1.0) / sqrt(1.0 + wave.y * wave.y);
    }
    vec2 mirrored = 2.0 * normal * dot(normal, to_eye) - to_eye;
    float height = mirrored.y / mirrored.x * (ship - depth) + wave.x;
    bool away = METHOD == METHOD_PHYSICS_AS_PUBLISHED || (mirrored.x > 0.0 && dot(normal, to_eye) > 0.0);
    // NaN compares false: it meets nothing.
    return away && height >= 0.0 && height < sight.w;
}

// IEC 61966-2-1.
vec3 linear_of(vec3 code) {
    return mix(code / 12.92, pow((code + 0.055) / 1.055, vec3(2.4)), greaterThan(code, vec3(0.04045)));
}

// Table 1: the nine pixels about this one, each the ship mirrored with the same shift as in the other shader where it is met, else the
// video. As published the kernel blurs both, and the whole ocean; here only what has the ship in one of the nine. Corrected it blurs the
// ship alone: the camera's own pixels stay sharp.
vec4 physics_kernel(vec2 at, float across, float below, float line, vec2 move) {
    vec2 down = waters[draw.index].down, right = vec2(down.y, -down.x);
    vec4 sum = vec4(0.0);
    vec3 behind = vec3(0.0);
    bool any_hit = false;
    for (int n = 0; n < 9; ++n) {
        vec2 step = vec2(float(n % 3 - 1), float(n / 3 - 1));
        float weight = n == 4 ? 0.5 : 1.0 / 16.0;
        vec4 here = vec4(0.0);
        if (meets_ship(across + dot(step, right), below + dot(step, down), line)) {
            here = mirror_at(at + step + move);
            any_hit = any_hit || here.a > 0.0;
        }
        sum += weight * here;
        if (METHOD == METHOD_PHYSICS_AS_PUBLISHED) {
            behind += weight * (1.0 - here.a) * linear_of(code_at(at + step));
        }
    }
    return METHOD == METHOD_PHYSICS_AS_PUBLISHED && any_hit ? vec4(sum.rgb + behind, 1.0) : sum;
}

vec4 physics_as_published(vec2 at, float across, float below, float line) {
    PhysicsPublishedBlock b = physics_published_blocks[draw.index];
    float shift = sin(normalised_mean(at, code_at(at))) * b.shift;
    return abs(shift) <= b.shift_limit ? physics_kernel(at, across, below, line, vec2(shift)) : vec4(0.0);
}

vec4 physics_corrected(vec2 at, float across, float below, float line) {
    PhysicsBlock b = physics_blocks[draw.index];
    float shift = clamp((field_at(at).x * 2.0 - 1.0) * b.shift, -b.shift_limit, b.shift_limit);
    return b.share * physics_kernel(at, across, below, line, shift * wave_direction());
}
