#version 460
// A corner of a boat as the sun sees it, on the place of the boat that it may shade.

// To the place of the boat that may be shaded, clip space (vertex push constants).
layout(push_constant) uniform ShadowBlock {
    vec4 clip_from_boat[3];  // rows
} shadow;

layout(location = 0) in vec3 position;

void main() {
    vec4 p = vec4(position, 1.0);
    gl_Position = vec4(
        dot(shadow.clip_from_boat[0], p), dot(shadow.clip_from_boat[1], p), dot(shadow.clip_from_boat[2], p), 1.0);
}
