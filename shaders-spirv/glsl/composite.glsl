// The boats' layer over the video: the mean of a pixel's samples is its premultiplied light and its coverage. The layer holds
// roots of light.

layout(constant_id = 0) const int SAMPLES = 4;

layout(set = 1, binding = 0) uniform sampler2DMS layer;

// The mean of the samples of a pixel.
vec4 mean_of_samples(ivec2 at) {
    vec4 sum = vec4(0.0);
    for (int i = 0; i < SAMPLES; ++i) {
        vec4 root = texelFetch(layer, at, i);
        sum += vec4(root.rgb * root.rgb, root.a);
    }
    return sum / float(SAMPLES);
}
