#version 460
#extension GL_GOOGLE_include_directive : require
// What a hull throws up: sheets of foam that stand on the water, one along each side from where the bow meets it, one behind the stern.
#include "frame.glsl"
#include "lens.glsl"
#include "wake_block.glsl"

layout(location = 0) out vec4 spray;  // place on the water, height in the sheet (0 to 1), cover
layout(location = 1) out vec3 shade;
layout(location = 2) flat out WakeHead head;

// Steps along a sheet.
const int STEPS = 10;

// The track so many metres behind the bow.
WakePoint on_track(float along) {
    uint i = draw.index;
    int before = 0;
    while (before < TRACK_POINTS - 2 && wakes[i].points[before + 2].track.x > wakes[i].points[before + 1].track.x
        && wakes[i].points[before + 1].track.x < along) {
        ++before;
    }
    WakePoint a = wakes[i].points[before], b = wakes[i].points[before + 1];
    float share = clamp((along - a.track.x) / max(b.track.x - a.track.x, 1e-3), 0.0, 1.0);
    return WakePoint(mix(a.place, b.place, share), mix(a.side, b.side, share), mix(a.world, b.world, share),
        mix(a.track, b.track, share));
}

void main() {
    uint i = draw.index;
    head = wakes[i].head;
    float length_m = head.hull.x, beam = head.hull.y, high = head.hull.w;
    float speed = max(wakes[i].points[1].track.y, 0.3);
    float froude = speed * inversesqrt(9.81 * length_m);
    bool stern = gl_InstanceIndex == 2;
    float step = float(gl_VertexIndex >> 1) / float(STEPS);
    // A planing boat meets the water farther aft.
    float start = stern ? 0.96 : mix(0.02, 0.38, smoothstep(0.5, 1.1, froude));
    float along = start + step * (stern ? 1.2 : 1.04 - start);
    float gone = along - start;
    float profile = stern ? 0.8 * smoothstep(0.0, 0.2, gone) * exp(-1.5 * gone) : smoothstep(0.0, 0.07, gone) * exp(-1.3 * gone);
    float entry = clamp((along - 0.02) / 0.4, 0.0, 1.0);
    float edge = 0.5 * beam * (1.0 - (1.0 - entry) * (1.0 - entry)) + 0.03 * beam + 0.05 * gone * length_m;
    float height = high * profile;
    WakePoint p = on_track(along * length_m);
    vec3 foot = p.place.xyz, side = normalize(p.side.xyz);
    // Too low for the picture's rows, it is drawn as high as they are and as much fainter.
    float row = 1.5 * max(foot.z, 0.1) / frame.focal.y;
    float shown = max(height, row);
    float top = float(gl_VertexIndex & 1);
    float aside = (stern ? 0.0 : edge + 0.4 * top * height) * (gl_InstanceIndex == 0 ? -1.0 : 1.0);
    spray.xy = p.world.xy + p.world.zw * aside;
    spray.z = top;
    // Nothing stands where a sheet begins and ends.
    float ends = smoothstep(0.0, 0.1, step) * (1.0 - smoothstep(0.75, 1.0, step));
    // Seen along itself it is a line, which foam is not.
    float facing = smoothstep(0.1, 0.5, abs(dot(normalize(foot), side)));
    spray.w = head.foam.w * ends * facing * height / shown;
    vec3 place = foot + side * aside + head.up.xyz * (top * shown - 0.05 * shown);
    shade = shade_place(head, place);
    gl_Position = clip_from_camera(place);
}
