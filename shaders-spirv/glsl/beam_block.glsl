// The light of the gun's searchlight: cells of a grid (push constants), and its nodes (set 0, binding 10).
layout(push_constant) uniform BeamBlock {
    ivec4 cells;  // the first one's column and row, how many of the row, nodes of a row
    vec4 haze;    // what a node's haze is multiplied with; pixels from node to node
    vec4 sea;     // the same of its sea; the last is unused
} beam;

struct BeamNode {
    vec2 light;  // of the air, and of the sea
};
