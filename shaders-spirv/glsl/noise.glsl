// The camera's noise: as strong as the video's at that light, another in each pixel and frame.

// A number scrambled (Jarzynski & Olano 2020, "Hash functions for GPU rendering": pcg).
uint scrambled(uint number) {
    uint state = number * 747796405u + 2891336453u;
    uint word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// About normal, of mean 0 and variance 1: the sum of four bytes.
float normal(uint number) {
    uint pairs = (number & 0x00ff00ffu) + ((number >> 8) & 0x00ff00ffu);
    return (float((pairs & 0xffffu) + (pairs >> 16)) - 510.0) * (1.0 / 147.8);
}

vec3 camera_noise(ivec2 at, vec3 light) {
    uint frame_number = uint(frame.noise_read.w);
    uint pixel = scrambled(scrambled(frame_number) + uint(at.x) + (uint(at.y) << 16));
    ivec2 shared_by = frame.noise_shot.w > 0.5 ? ivec2(at.x >> 1, at.y) : at;
    uint first = scrambled(scrambled(~frame_number) + uint(shared_by.x) + (uint(shared_by.y) << 16));
    float green = normal(pixel), reds = normal(first), blues = normal(scrambled(first));
    vec4 mixed = frame.noise_mix;
    float rest = sqrt(max(1.0 - dot(mixed.zw, mixed.zw), 0.0));
    vec3 even = vec3(mixed.x * green + mixed.y * reds, green, mixed.z * green + mixed.w * reds + rest * blues);
    return even * sqrt(frame.noise_read.rgb + frame.noise_shot.rgb * light);
}
