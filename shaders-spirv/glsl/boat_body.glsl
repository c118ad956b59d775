// A boat's corner to clip space, and its light.
#include "frame.glsl"
#include "lens.glsl"
#include "boat_block.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec3 albedo;
// What the corner sees of the sky's lobes and of the sea.
layout(location = 4) in vec4 sky0;
layout(location = 5) in vec4 sky1;
layout(location = 6) in vec2 sky2;
// The sun's light by way of the boat's other faces, by where the sun stands.
layout(location = 7) in vec4 thrown;

// Whether there may be a searchlight, flares, fires.
layout(constant_id = 2) const bool LAMPLIGHT = false;

// Light that the corner sends to the eye: of sky and sea, with haze, and of the sun, if nothing is before it; below nothing where it faces
// away. A texture's colours and the haze come later. Both are found here and not at every pixel: matt light varies little over the triangles
// of a boat, and small triangles cost by the fragment and by what is handed to it. In the sea's mirror nobody sees a shadow: its light is
// one colour.
layout(location = 0) out vec3 around_out;
#ifdef MIRRORED
const uint UV = 1;
#else
const uint UV = 4;
layout(location = 1) out vec3 sun_out;
// Where the shadow map is looked up: within the triangle; and within the boat's own place in the map, since beyond it lie other boats', or
// what was never drawn. A triangle thinner than a step of the rasteriser's grid covers samples outside itself.
layout(location = 2) centroid out vec3 shade_out;
layout(location = 3) flat out vec4 shade_box;
#endif
#ifdef TEXTURED
layout(location = UV) out vec2 uv_out;
#endif

out gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[2];
};

vec3 lit_around(BoatBlock boat) {
    vec3 sky = boat.lobes[0].rgb * sky0.x + boat.lobes[1].rgb * sky0.y + boat.lobes[2].rgb * sky0.z
        + boat.lobes[3].rgb * sky0.w + boat.lobes[4].rgb * sky1.x + boat.lobes[5].rgb * sky1.y
        + boat.lobes[6].rgb * sky1.z + boat.lobes[7].rgb * sky1.w + boat.lobes[8].rgb * sky2.x;
    float by_faces = max(thrown.x + dot(thrown.yzw, boat.sun.xyz), 0.0);
    return albedo * (max(sky, 0.0) + frame.sea.rgb * sky2.y + frame.sun.rgb * by_faces);
}

// Light of the gun's searchlight, which stands so close to the eye that little is seen that it does not light.
vec3 lit_by_searchlight(BoatBlock boat, vec3 in_camera) {
    vec3 ray = in_camera - frame.lamp.xyz;
    float squared = max(dot(ray, ray), 1.0);
    vec3 off = cross(ray, frame.beam.xyz);
    float fall = exp(-frame.lamp.w * dot(off, off) / squared) * step(0.0, dot(ray, frame.beam.xyz));
    float facing = max(dot(normal, normalize(boat.eye.xyz - position)), 0.0);
    return albedo * (frame.beam.w * fall * facing * (1.0 - boat.eye.w) / squared);
}

// Light of flares and fires: what the corner faces of them, without shadows.
vec3 lit_by_lamps(BoatBlock boat) {
    vec3 sum = vec3(0.0);
    for (int i = 0; i < BOAT_LAMPS; i++) {
        vec3 towards = boat.lamps[i].xyz - position;
        float squared = max(dot(towards, towards), 1.0);
        sum += boat.lamp_lights[i].rgb * (max(dot(normal, towards), 0.0) * inversesqrt(squared) / squared);
    }
    return albedo * sum;
}

void main() {
    vec4 p = vec4(position, 1.0);
    BoatBlock boat = boats[draw.index];
    vec3 in_camera =
        vec3(dot(boat.camera_from_boat[0], p), dot(boat.camera_from_boat[1], p), dot(boat.camera_from_boat[2], p));
    gl_Position = clip_from_camera(in_camera);
    gl_ClipDistance[0] = dot(boat.water_plane, p);
    gl_ClipDistance[1] = dot(boat.horizon_plane, p);
    around_out = lit_around(boat);
    if (LAMPLIGHT) {
        around_out += lit_by_searchlight(boat, in_camera) + lit_by_lamps(boat);
    }
    vec3 sun = albedo * frame.sun.rgb * dot(normal, boat.sun.xyz);
#ifdef MIRRORED
    around_out += max(sun, 0.0);
#else
    sun_out = sun;
    // A little off the surface, so that it does not shade itself by the map's texels.
    vec4 off = vec4(position + normal * boat.sun.w, 1.0);
    shade_out = vec3(dot(boat.shadow_from_boat[0], off), dot(boat.shadow_from_boat[1], off), dot(boat.shadow_from_boat[2], off));
    shade_box = boat.shadow_box;
#endif
#ifdef TEXTURED
    uv_out = uv;
#else
    around_out = mix(around_out, frame.horizon.rgb, boat.eye.w);
#ifndef MIRRORED
    if (LAMPLIGHT) {
        around_out += boat.air.rgb;
    }
    sun_out *= 1.0 - boat.eye.w;
#endif
#endif
}
