// The light of searchlight, flares and fires at nodes of a grid over the screen (set 0, binding 10).
struct LamplightNode {
    vec4 air;   // rgb: light of the air before everything; a: pixels from node to node
    vec4 both;  // rgb: the same and that of the sea; a: nodes of a row
};

layout(std430, set = 0, binding = 10) readonly buffer LamplightNodes {
    LamplightNode nodes[];
};

// Light of the air before a pixel, between the nodes. It is that of the whole line of sight: what lies behind a boat is little.
vec3 air_at(vec2 pixel) {
    vec2 place = clamp(pixel, vec2(0.0), frame.size - 0.01) / nodes[0].air.a;
    int columns = int(nodes[0].both.a);
    ivec2 cell = ivec2(place);
    vec2 share = place - vec2(cell);
    int first = cell.y * columns + cell.x;
    vec3 upper = mix(nodes[first].air.rgb, nodes[first + 1].air.rgb, share.x);
    vec3 lower = mix(nodes[first + columns].air.rgb, nodes[first + columns + 1].air.rgb, share.x);
    return mix(upper, lower, share.y);
}
