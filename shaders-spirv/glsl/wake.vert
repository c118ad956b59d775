#version 460
#extension GL_GOOGLE_include_directive : require
// A strip across the track of a boat, from one of its points to the next. What changes slowly along and across a wake is found at the
// corners and not at every pixel.
#include "frame.glsl"
#include "lens.glsl"
#include "wake_block.glsl"
#include "wake_light.glsl"

// From the eye, metres: backwards along the track, to starboard, downwards; root of the radians from the bow. At the wedge's edge both
// waves meet: rounded off within a stretch that shrinks by that, about as Airy's function does.
layout(location = 0) out vec4 from_eye;
// Metres behind the bow and to starboard; wavenumber of the transverse waves, 1 / m; amplitude of waves before their own spectrum, metres.
layout(location = 1) out vec4 track;
// Place on the water, metres; share that is drawn; metres behind the bow at which spray begins.
layout(location = 2) out vec4 water;
// Cover of foam behind the stern, of its bubbles, and of foam beside the hull; half width of the mixed water, metres.
layout(location = 3) out vec4 foam;
layout(location = 4) out vec3 shade;
layout(location = 5) flat out WakeLight light;

const float G = 9.81;
// Seconds after which waves are no longer drawn, as the host's WAVES_S.
const float WAVES_S = 9.0;

// Two columns to each side. A wake is cut into few pieces: a driver that runs on the processor shades whole blocks of pixels, and a
// block once for each piece that has a part in it.
float column(int i, float beam, float reach) {
    int off = abs(i - 2);
    float at = off == 2 ? reach : 0.5 * float(off) * (min(0.7 * beam, 0.5 * reach) + reach);
    return i < 2 ? -at : at;
}

// Amplitude of waves at a place behind the bow and aside: gone before foam is, they have run off; less with the distance from the bow.
float wave_height(float x, float y, float highest, float age, float length_m) {
    float fresh = clamp(1.0 - age / WAVES_S, 0.0, 1.0);
    float far = y + 0.1 * length(vec2(max(x, 0.02 * length_m), y)) + 0.3 * length_m;
    return 0.4 * highest * fresh * fresh * smoothstep(0.0, 0.25 * length_m, x) * pow(length_m / far, 0.345);
}

// What `foam` holds.
vec4 foam_cover(float x, float froude, float speed, float age, float length_m, float beam) {
    float half_s = 0.5 * length_m / max(speed, 0.5);
    float since_bow = max(age + half_s, 0.0), since_stern = max(age - half_s, 0.0);
    float stern = 0.85 * exp(-since_stern / 3.53) + 0.15 * exp(-since_stern / 10.0);
    // The water behind is mixed as wide as the hull, and wider by the fifth root of the distance.
    float half_width = 0.5 * beam * pow(1.0 + max(x - length_m, 0.0) / beam, 0.2);
    vec3 cover = vec3(stern, exp(-since_stern / 14.0), 0.7 * exp(-since_bow / 3.53));
    return vec4(smoothstep(0.12, 0.45, froude) * cover, half_width);
}

void main() {
    WakeHead head = wakes[draw.index].head;
    WakePoint p = wakes[draw.index].points[gl_InstanceIndex + (gl_VertexIndex & 1)];
    int i = gl_VertexIndex >> 1;
    float length_m = head.hull.x, beam = head.hull.y;
    float x = p.track.x, speed = max(p.track.y, 0.3), age = p.track.z;
    float froude = speed * inversesqrt(G * length_m);
    float aside = column(i, beam, p.place.w);
    vec3 place = p.place.xyz + aside * p.side.xyz;
    vec3 up = head.up.xyz;
    float k0 = G / (speed * speed);
    float sharp = sqrt(max(k0 * length(vec2(max(x, 0.02 * length_m), aside)), 0.1));
    from_eye = vec4(dot(place, cross(p.side.xyz, up)), dot(place, p.side.xyz), -dot(place, up), sharp);
    track = vec4(x, aside, k0, wave_height(x, abs(aside), p.side.w, age, length_m));
    // A planing boat meets the water farther aft.
    float start = length_m * mix(0.04, 0.4, smoothstep(0.5, 1.1, froude));
    water = vec4(p.world.xy + aside * p.world.zw, i == 0 || i == 4 ? 0.0 : p.track.w, start);
    foam = foam_cover(x, froude, speed, age, length_m, beam);
    shade = shade_place(head, place);
    light = wake_light(head);
    gl_Position = clip_from_camera(place);
}
