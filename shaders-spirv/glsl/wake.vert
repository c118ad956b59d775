#version 460
#extension GL_GOOGLE_include_directive : require
// A strip across the track of a boat, from one of its points to the next.
#include "frame.glsl"
#include "lens.glsl"
#include "wake_block.glsl"

layout(location = 0) out vec3 place;
layout(location = 1) out vec3 side;
layout(location = 2) out vec4 track;  // behind the bow, to starboard, speed, age
layout(location = 4) flat out WakeHead head;
layout(location = 3) out vec4 water;  // place on the water, share that is drawn, height of waves

// Columns to each side: closer where the hull went.
float column(int i, float beam, float reach) {
    float near = min(0.7 * beam, 0.5 * reach);
    int off = abs(i - 4);
    float at = off == 4 ? reach : off == 3 ? 0.5 * (near + reach) : 0.5 * float(off) * near;
    return i < 4 ? -at : at;
}

void main() {
    head = wakes[draw.index].head;
    WakePoint p = wakes[draw.index].points[gl_InstanceIndex + (gl_VertexIndex & 1)];
    int i = gl_VertexIndex >> 1;
    float aside = column(i, wakes[draw.index].head.hull.y, p.place.w);
    place = p.place.xyz + aside * p.side.xyz;
    side = p.side.xyz;
    track = vec4(p.track.x, aside, p.track.y, p.track.z);
    water = vec4(p.world.xy + aside * p.world.zw, i == 0 || i == 8 ? 0.0 : p.track.w, p.side.w);
    gl_Position = clip_from_camera(place);
}
