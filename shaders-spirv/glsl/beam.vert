#version 460
#extension GL_GOOGLE_include_directive : require
// A corner of a cell.
#include "frame.glsl"
#include "beam_block.glsl"

layout(std430, set = 0, binding = 10) readonly buffer BeamNodes {
    BeamNode nodes[];
};

layout(location = 0) out vec2 light;

void main() {
    ivec2 node = beam.cells.xy + ivec2(gl_InstanceIndex + (gl_VertexIndex & 1), gl_VertexIndex >> 1);
    light = nodes[node.y * beam.cells.w + node.x].light;
    gl_Position = clip_from_pixels(vec2(node) * beam.haze.w);
}
