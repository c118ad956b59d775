#version 460
// The mirror layer at a third of its size: the mean of 3 x 3 texels (Nelson 2009, the shader's box blur), premultiplied. Done once
// for each texel and not for each pixel of the sea, and what the layer samples too coarsely does not flicker.

layout(set = 0, binding = 0) uniform sampler2D mirror;

layout(location = 0) out vec4 colour;

void main() {
    ivec2 first = ivec2(gl_FragCoord.xy) * 3;
    vec4 sum = vec4(0.0);
    for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 3; ++x) {
            sum += texelFetch(mirror, first + ivec2(x, y), 0);
        }
    }
    colour = sum / 9.0;
}
