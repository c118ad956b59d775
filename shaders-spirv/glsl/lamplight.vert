#version 460
#extension GL_GOOGLE_include_directive : require
// A corner of a cell.
#include "frame.glsl"
#include "lamplight_block.glsl"

layout(push_constant) uniform LamplightBlock {
    ivec4 cells;  // the first one's column and row, how many of the row, nodes of a row
    float cell_px;  // pixels from node to node
} lamplight;

layout(location = 0) out vec3 light;

void main() {
    ivec2 place = lamplight.cells.xy + ivec2(gl_InstanceIndex + (gl_VertexIndex & 1), gl_VertexIndex >> 1);
    light = nodes[place.y * lamplight.cells.w + place.x].light.rgb;
    gl_Position = clip_from_pixels(vec2(place) * lamplight.cell_px);
}
