// Tracers, splashes and strikes: profiles around an axis on the screen. Premultiplied; light without coverage is added.
#include "frame.glsl"
#include "round_block.glsl"

#ifdef HIDDEN
// Boats may stand before it: the depth of their layer, valid here.
layout(set = 1, binding = 0) uniform sampler2DMS boats_depth;
#endif

layout(location = 0) out vec4 colour;

float hash(vec2 p) {
    p = fract(p * vec2(0.1031, 0.1030));
    p += dot(p, p.yx + 33.33);
    return fract((p.x + p.y) * p.x * 7.31);
}

float noise(vec2 p) {
    vec2 i = floor(p), f = fract(p);
    f = f * f * (3.0 - 2.0 * f);
    return mix(mix(hash(i), hash(i + vec2(1, 0)), f.x), mix(hash(i + vec2(0, 1)), hash(i + vec2(1, 1)), f.x), f.y);
}

// A core that hides what is behind it and a glow that only adds light.
vec4 tracer(RoundBlock r, float along, float across, float width) {
    float d = across / width;
    float core = exp(-6.0 * d * d);
    float glow = 0.18 * exp(-0.7 * d * d);
    return vec4(r.colour.rgb * (core + glow), core * r.colour.a);
}

// A column that is torn at its edges and at its top, and thinner where it is higher.
vec4 splash(RoundBlock r, float along, float across, float width) {
    if (along < 0.0 || along > 1.0) {
        return vec4(0.0);
    }
    float d = abs(across) / width;
    float torn = noise(vec2(across / width * 4.0 + r.seed, along * 7.0 - r.seed));
    float body = smoothstep(1.0, 0.3, d + 0.55 * torn * (0.3 + along));
    float top = smoothstep(1.0, 0.55, along + 0.35 * torn);
    float alpha = body * top * r.colour.a;
    return vec4(r.colour.rgb * (0.75 + 0.25 * torn) * alpha, alpha);
}

// A flash with sparks.
vec4 strike(RoundBlock r, vec2 from_middle, float width) {
    float d = length(from_middle) / width;
    float angle = atan(from_middle.y, from_middle.x);
    float ray = noise(vec2(angle * 4.0 + r.seed, r.seed));
    float core = exp(-14.0 * d * d);
    float sparks = smoothstep(0.55, 0.95, ray) * smoothstep(1.0, 0.1, d);
    float light = (core + 0.8 * sparks) * r.colour.a;
    return vec4(r.colour.rgb * light, min(core * r.colour.a, 1.0));
}

// Smoke: a ball that is torn at its edges, and hides by its optical depth.
vec4 smoke(RoundBlock r, vec2 from_middle, float width, float before) {
    vec2 p = from_middle / width;
    float squared = dot(p, p), ends = r.half_width.y * r.half_width.y;
    if (squared > ends) {
        return vec4(0.0);
    }
    float torn = noise(p * 1.6 + r.seed) * 0.65 + noise(p * 4.1 - r.seed) * 0.35;
    // Nothing is left where the puff's rectangle ends.
    float fall = max(exp(-squared) - exp(-ends), 0.0) / (1.0 - exp(-ends));
    float hides = 1.0 - exp(-r.colour.a * fall * before * clamp(2.6 * torn - 0.5, 0.0, 2.0));
    return vec4(r.colour.rgb * (0.7 + 0.6 * torn) * hides, hides);
}

// A flame: tongues that lick upwards. It shines, and hides a little.
vec4 flame(RoundBlock r, vec2 from_middle, float width, float before) {
    vec2 p = from_middle / width;
    float torn = noise(vec2(p.x * 2.2 + r.seed, p.y * 1.1 - r.seed));
    float d = length(p * vec2(1.15, 0.7)) + 0.7 * (torn - 0.5);
    float light = smoothstep(1.0, 0.15, d) * before;
    return vec4(r.colour.rgb * light, 0.35 * light);
}

void main() {
    RoundBlock r = rounds[draw.index];
    vec2 at = gl_FragCoord.xy;
    vec2 axis = r.to.xy - r.from.xy;
    float squared = max(dot(axis, axis), 1e-6);
    float along = dot(at - r.from.xy, axis) / squared;
    float held = clamp(along, 0.0, 1.0);
    float before = 1.0;
#ifdef HIDDEN
    float hull = texelFetch(boats_depth, ivec2(at), 0).r, own = mix(r.from.z, r.to.z, held);
    if (r.from.w > 0.0) {
        // Of a ball so much is seen as lies before the hull.
        float behind = frame.near / max(own, 1e-9) - frame.near / max(hull, 1e-9);
        before = hull > 0.0 ? clamp(0.5 - 0.5 * behind / r.from.w, 0.0, 1.0) : 1.0;
    } else if (hull > own) {
        discard;
    }
#endif
    float width = max(mix(r.half_width.x, r.half_width.y, held), 0.5);
    vec2 nearest = mix(r.from.xy, r.to.xy, held);
    vec2 side = vec2(axis.y, -axis.x) * inversesqrt(squared);
    if (r.kind == ROUND_TRACER) {
        colour = tracer(r, along, distance(at, nearest), width);
    } else if (r.kind == ROUND_SPLASH) {
        colour = splash(r, along, dot(at - r.from.xy, side), width);
    } else if (r.kind == ROUND_SMOKE) {
        colour = smoke(r, at - r.from.xy, width, before);
    } else if (r.kind == ROUND_FLAME) {
        colour = flame(r, at - r.from.xy, width, before);
    } else {
        colour = strike(r, at - r.from.xy, width);
    }
    if (colour == vec4(0.0)) {
        discard;
    }
}
