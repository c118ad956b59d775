// The plain mirror picture, faded by eq. 6.
struct MirrorBlock {
    float alpha;       // share of the mirrored light at the hull-water line
    float alpha_fall;  // alpha / k of eq. 6, per pixel
    vec2 pad;
};

layout(std140, set = 0, binding = 8) uniform Mirrors {
    MirrorBlock mirror_blocks[WATERS_MAX];
};

vec4 plain_mirror(vec2 at, float below) {
    MirrorBlock b = mirror_blocks[draw.index];
    float alpha = b.alpha - below * b.alpha_fall;
    return alpha > 0.0 ? alpha * mirror_at(at) : vec4(0.0);
}
