#version 460
// The camera's bytes to sRGB codes: no light is computed here, so the target's UNORM view takes them as they are.

// 0 YUYV, 1 NV12, 2 RGB.
layout(constant_id = 0) const uint FORMAT = 0;
// Whether picture and screen differ in size.
layout(constant_id = 1) const bool SCALED = false;

layout(push_constant) uniform VideoBlock {
    vec2 scale;   // picture pixels for each screen pixel
    vec2 offset;  // picture position of the screen's upper left corner
    ivec2 size;   // the picture's, in pixels
} video;

// YUYV: Y0 U Y1 V as one texel, twice. NV12: Y, and U V. RGB: bytes, twice.
layout(set = 0, binding = 0) uniform samplerBuffer luma;
layout(set = 0, binding = 1) uniform samplerBuffer chroma;

layout(location = 0) out vec4 colour;

// Y, U, V or R, G, B of one picture pixel, 0 to 1.
vec3 raw(ivec2 at) {
    if (FORMAT == 0) {
        vec4 pair = texelFetch(luma, (at.y * video.size.x + at.x) >> 1);
        return vec3((at.x & 1) == 0 ? pair.x : pair.z, pair.yw);
    } else if (FORMAT == 1) {
        vec2 uv = texelFetch(chroma, ((at.y >> 1) * video.size.x + at.x) >> 1).xy;
        return vec3(texelFetch(luma, at.y * video.size.x + at.x).x, uv);
    } else {
        int i = (at.y * video.size.x + at.x) * 3;
        return vec3(texelFetch(luma, i).x, texelFetch(luma, i + 1).x, texelFetch(luma, i + 2).x);
    }
}

// Limited-range BT.601 (ITU-R BT.601-7, 2.5) for the YUV formats.
vec3 to_rgb(vec3 c) {
    if (FORMAT == 2) {
        return c;
    }
    float y = c.x * (255.0 / 219.0) - 16.0 / 219.0;
    vec2 uv = c.yz * (255.0 / 224.0) - 128.0 / 224.0;
    return vec3(y + 1.402 * uv.y, y - 0.344136 * uv.x - 0.714136 * uv.y, y + 1.772 * uv.x);
}

void main() {
    vec3 c;
    if (SCALED) {
        vec2 at = clamp(gl_FragCoord.xy * video.scale + video.offset - 0.5, vec2(0.0), vec2(video.size - 1));
        ivec2 low = ivec2(at);
        ivec2 high = min(low + 1, video.size - 1);
        vec2 part = at - vec2(low);
        vec3 upper = mix(raw(low), raw(ivec2(high.x, low.y)), part.x);
        vec3 lower = mix(raw(ivec2(low.x, high.y)), raw(high), part.x);
        c = mix(upper, lower, part.y);
    } else {
        c = raw(ivec2(gl_FragCoord.xy));
    }
    colour = vec4(to_rgb(c), 1.0);
}
