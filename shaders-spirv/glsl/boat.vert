#version 460
#extension GL_GOOGLE_include_directive : require
#include "frame.glsl"
#include "lens.glsl"
#include "boat_block.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec3 albedo;

layout(location = 0) out vec3 position_out;
layout(location = 1) out vec3 normal_out;
layout(location = 2) out vec2 uv_out;
layout(location = 3) out vec3 albedo_out;

out gl_PerVertex {
    vec4 gl_Position;
    float gl_ClipDistance[2];
};

void main() {
    vec4 p = vec4(position, 1.0);
    BoatBlock boat = boats[draw.index];
    gl_Position = clip_from_camera(
        vec3(dot(boat.camera_from_boat[0], p), dot(boat.camera_from_boat[1], p), dot(boat.camera_from_boat[2], p)));
    gl_ClipDistance[0] = dot(boat.water_plane, p);
    gl_ClipDistance[1] = dot(boat.horizon_plane, p);
    position_out = position;
    normal_out = normal;
    uv_out = uv;
    albedo_out = albedo;
}
