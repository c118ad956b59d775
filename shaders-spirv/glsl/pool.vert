#version 460
#extension GL_GOOGLE_include_directive : require
// A corner of the pool of light that a low lamp makes on the sea about its foot: a disc of rings and sectors.
#include "frame.glsl"
#include "lens.glsl"
#include "pool_block.glsl"

layout(location = 0) out vec3 light;

const float TAU = 6.2831853;

// What falls flat on the sea so far from the foot, for an intensity of 1.
float flat_light(float off) {
    float squared = off * off + pool.foot.w * pool.foot.w;
    return pool.foot.w / (squared * sqrt(squared));
}

void main() {
    int ring = gl_InstanceIndex / POOL_SECTORS + (gl_VertexIndex & 1);
    int sector = gl_InstanceIndex % POOL_SECTORS + (gl_VertexIndex >> 1);
    // Rings stand closer where light falls off faster.
    float share = float(ring) / float(POOL_RINGS);
    float off = pool.aside.w * share * share;
    float angle = float(sector) * (TAU / float(POOL_SECTORS));
    vec3 in_camera = pool.foot.xyz + (pool.aside.xyz * cos(angle) + pool.away.xyz * sin(angle)) * off;
    // Nothing is left at the rim.
    light = pool.light.rgb * max(flat_light(off) - flat_light(pool.aside.w), 0.0);
    gl_Position = clip_from_camera(in_camera);
}
