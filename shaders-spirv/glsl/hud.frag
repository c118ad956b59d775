#version 460
#extension GL_GOOGLE_include_directive : require
#include "hud_shapes.glsl"

// Which of the three draws this is: 0 plates, 1 shapes, 2 glyphs. Each is compiled without the others.
layout(constant_id = 0) const uint KIND = 0;

layout(set = 1, binding = 0) uniform sampler2D glyphs;

layout(location = 0) in vec2 uv;
layout(location = 1) in vec2 local;
layout(location = 2) flat in vec4 paint;
layout(location = 3) flat in vec3 half_size_edge;
layout(location = 4) flat in uint shape;

layout(location = 0) out vec4 colour;

// Distances in pixels, negative inside.
float box(vec2 p, vec2 half_size, float radius) {
    vec2 q = abs(p) - half_size + radius;
    return length(max(q, 0.0)) + min(max(q.x, q.y), 0.0) - radius;
}

float triangle(vec2 p, float r) {
    // Upright, its sides at 60 degrees, standing on the rectangle's lower edge.
    vec2 q = vec2(abs(p.x), p.y);
    return max(dot(q - vec2(0.0, -r), vec2(0.894427, -0.447214)), q.y - r);
}

float distance_to(uint kind, vec2 p, float r) {
    switch (kind) {
        case SHAPE_DISC: return length(p) - r;
        case SHAPE_RING: return abs(length(p) - 0.75 * r) - 0.25 * r;
        case SHAPE_CROSS: {
            vec2 d = vec2(p.x + p.y, p.x - p.y) * 0.707107;
            return min(box(d, vec2(1.25 * r, 0.28 * r), 0.0), box(d, vec2(0.28 * r, 1.25 * r), 0.0));
        }
        case SHAPE_TRIANGLE: return triangle(p, r);
        case SHAPE_BARRED: {
            vec2 d = vec2(p.x + p.y, p.x - p.y) * 0.707107;
            float ring = abs(length(p) - 0.83 * r) - 0.17 * r;
            return min(ring, max(box(d, vec2(r, 0.16 * r), 0.0), length(p) - r));
        }
        case SHAPE_DIAMOND: return (abs(p.x) + abs(p.y) - r) * 0.707107;
        default: return box(p, vec2(r), 0.0);
    }
}

void main() {
    float cover;
    if (KIND == 0) {
        cover = clamp(0.5 - box(local, half_size_edge.xy, half_size_edge.z), 0.0, 1.0);
    } else if (KIND == 1) {
        float r = min(half_size_edge.x, half_size_edge.y);
        cover = clamp(0.5 - distance_to(shape, local, r), 0.0, 1.0);
    } else {
        // Glyphs stand on whole pixels.
        cover = texelFetch(glyphs, ivec2(uv), 0).r;
    }
    float alpha = paint.a * cover;
    colour = vec4(paint.rgb * alpha, alpha);
}
