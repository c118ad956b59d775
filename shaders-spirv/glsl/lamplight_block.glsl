// The light of searchlight, flares and fires at nodes of a grid over the screen (set 0, binding 10).
struct LamplightNode {
    vec4 light;  // rgb: light of air and sea; a is unused
};

layout(std430, set = 0, binding = 10) readonly buffer LamplightNodes {
    LamplightNode nodes[];
};
