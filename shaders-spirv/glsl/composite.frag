#version 460
// The boats' layer over the video: the mean of a pixel's samples is its premultiplied light and its coverage. The layer holds
// roots of light.

layout(constant_id = 0) const int SAMPLES = 4;

layout(set = 1, binding = 0) uniform sampler2DMS layer;

layout(location = 0) out vec4 colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < SAMPLES; ++i) {
        vec4 root = texelFetch(layer, at, i);
        sum += vec4(root.rgb * root.rgb, root.a);
    }
    if (sum.a == 0.0) {
        discard;
    }
    colour = sum / float(SAMPLES);
}
