// The camera's noise: as strong as the video's at that light, another in each pixel and picture.

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
    vec4 mixed = frame.noise[2], grain = frame.noise[3];
    // As large as the picture's pixels are on the screen.
    ivec2 own = ivec2((vec2(at) + 0.5) * grain.y);
    ivec2 pair = grain.z > 0.5 ? ivec2(own.x >> 1, own.y) : own;
    uint picture = uint(grain.x);
    uint pixel = scrambled(scrambled(picture) + uint(own.x) + (uint(own.y) << 16));
    uint colour = scrambled(scrambled(~picture) + uint(pair.x) + (uint(pair.y) << 16));
    float green = normal(pixel), reds = normal(colour), blues = normal(scrambled(colour));
    float rest = sqrt(max(1.0 - dot(mixed.zw, mixed.zw), 0.0));
    vec3 even = vec3(mixed.x * green + mixed.y * reds, green, mixed.z * green + mixed.w * reds + rest * blues);
    return even * sqrt(frame.noise[0].rgb + frame.noise[1].rgb * light);
}
