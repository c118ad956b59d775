// Noise that hides the steps of eight bits in light that fades slowly over the dark: interleaved gradient noise (Jimenez 2014, "Next
// generation post processing in Call of Duty: Advanced Warfare"), one step wide.

// Linear light between two codes of sRGB near black, and how it grows with the root of the light.
const float STEP = 1.0 / (12.92 * 255.0);
const float STEP_GROWS = 0.0069;

vec3 dithered(vec3 light) {
    float noise = fract(52.9829189 * fract(dot(floor(gl_FragCoord.xy), vec2(0.06711056, 0.00583715)))) - 0.5;
    return max(light + noise * max(vec3(STEP), STEP_GROWS * sqrt(light)) * step(0.0, light - 1e-6), 0.0);
}
