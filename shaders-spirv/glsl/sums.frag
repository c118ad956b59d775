#version 460
// Running sums along the bands: the texel of column n holds the columns before it, so that the mean of any stretch is one difference.

layout(set = 0, binding = 0) uniform sampler2D bands;

layout(location = 0) out vec4 colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 sum = vec4(0.0);
    for (int x = 0; x < at.x; ++x) {
        sum += texelFetch(bands, ivec2(x, at.y), 0);
    }
    colour = sum;
}
