// The camera's bytes to sRGB codes, several pixels at once: a fragment writes one to four screen pixels as packed R, G, B, A
// bytes. Bytes are read as whole words. No light is computed here: codes go through as they are.

// 0 YUYV, 1 NV12, 2 RGB.
layout(constant_id = 0) const uint FORMAT = 0;
// Whether picture and screen differ in size.
layout(constant_id = 1) const bool SCALED = false;
// Pixels a fragment; divides the screen's width.
layout(constant_id = 2) const int RUN = 4;
// Whether the four pixels of a fragment share four neighbours of a row and the next four. The picture's width is then a multiple of
// four, and it is not made smaller.
layout(constant_id = 3) const bool FOURS = false;

layout(push_constant) uniform VideoBlock {
    vec2 scale;   // picture pixels for each screen pixel
    vec2 offset;  // picture position of the screen's upper left corner
    ivec2 size;   // the picture's, in pixels
} video;

// Little endian words of the picture. In fours, a texel holds four pixels: two words of YUYV, three of RGB.
layout(set = 0, binding = 0) uniform usamplerBuffer words;
// NV12: words of the second plane.
layout(set = 0, binding = 1) uniform usamplerBuffer chroma_words;

#ifdef OVERLAID
// What lies over the picture, the size of the screen: premultiplied light as sRGB codes, and cover, as they lie in memory.
layout(set = 1, binding = 0) uniform usampler2D overlay;
#endif

layout(location = 0) out uvec4 pixels;

// Codes to the nearest byte. By signed numbers: processors convert these in one step, and unsigned ones in many.
uint pack(vec3 c) {
    ivec3 u = ivec3(clamp(c + 0.5, 0.0, 255.5));
    return uint(u.x | (u.y << 8) | (u.z << 16)) | 0xff000000u;
}

vec4 bytes(uint w) {
    return vec4(ivec4(w & 255u, (w >> 8) & 255u, (w >> 16) & 255u, w >> 24));
}

uint byte(uint w, int i) {
    return (w >> ((i & 3) * 8)) & 255u;
}

// Limited-range BT.601 (ITU-R BT.601-7, 2.5): what chroma adds to each channel, and luma at full range.
vec3 tint(vec2 uv) {
    uv = uv * (255.0 / 224.0) - 128.0 * 255.0 / 224.0;
    return vec3(1.402 * uv.y, -0.344136 * uv.x - 0.714136 * uv.y, 1.772 * uv.x);
}

vec4 full_range(vec4 y) {
    return y * (255.0 / 219.0) - 16.0 * 255.0 / 219.0;
}

// Y, U, V or R, G, B of four picture pixels from `x` on, a multiple of four, in the lower bytes of each.
uvec4 raw_four(int x, int y) {
    int first = y * video.size.x + x;
    if (FORMAT == 2) {
        uvec3 w = texelFetch(words, first >> 2).xyz;
        return uvec4(w.x, (w.x >> 24) | (w.y << 8), (w.y >> 16) | (w.z << 16), w.z >> 8);
    } else if (FORMAT == 0) {
        uvec2 w = texelFetch(words, first >> 2).xy;
        uvec2 uv = ((w >> 8) & 0xffu) << 8 | (w >> 24) << 16;
        uvec2 even = (w & 0xffu) | uv, odd = ((w >> 16) & 0xffu) | uv;
        return uvec4(even.x, odd.x, even.y, odd.y);
    } else {
        uint luma = texelFetch(words, first >> 2).x;
        uint uvuv = texelFetch(chroma_words, ((y >> 1) * video.size.x + x) >> 2).x;
        uvec2 uv = uvec2(uvuv << 8, (uvuv >> 16) << 8) & 0xffff00u;
        return ((uvec4(luma) >> uvec4(0, 8, 16, 24)) & 0xffu) | uv.xxyy;
    }
}

// Four pixels from `x` on, at equal size.
uvec4 four(int x, int y) {
    if (FORMAT == 2) {
        return raw_four(x, y) | 0xff000000u;
    }
    int first = y * video.size.x + x;
    vec4 luma;
    vec4 uvuv;
    if (FORMAT == 0) {
        uvec2 pair = texelFetch(words, first >> 2).xy;
        vec4 a = bytes(pair.x), b = bytes(pair.y);
        luma = vec4(a.xz, b.xz);
        uvuv = vec4(a.yw, b.yw);
    } else {
        luma = bytes(texelFetch(words, first >> 2).x);
        uvuv = bytes(texelFetch(chroma_words, ((y >> 1) * video.size.x + x) >> 2).x);
    }
    luma = full_range(luma);
    vec3 left = tint(uvuv.xy), right = tint(uvuv.zw);
    return uvec4(pack(luma.x + left), pack(luma.y + left), pack(luma.z + right), pack(luma.w + right));
}

// Y, U, V or R, G, B of one picture pixel, 0 to 255.
vec3 raw(ivec2 at) {
    int first = at.y * video.size.x + at.x;
    if (FORMAT == 0) {
        vec4 pair = bytes(texelFetch(words, first >> 1).x);
        return vec3((at.x & 1) == 0 ? pair.x : pair.z, pair.yw);
    } else if (FORMAT == 1) {
        int uv = (at.y >> 1) * video.size.x + (at.x & ~1);
        uint chroma = texelFetch(chroma_words, uv >> 2).x;
        return vec3(byte(texelFetch(words, first >> 2).x, first), byte(chroma, uv), byte(chroma, uv + 1));
    } else {
        int i = first * 3;
        uint a = texelFetch(words, i >> 2).x, b = texelFetch(words, (i >> 2) + 1).x;
        int shift = (i & 3) * 8;
        uint rgb = (a >> shift) | (shift == 0 ? 0u : b << (32 - shift));
        return bytes(rgb).xyz;
    }
}

// Two neighbours in a row: RGB pixels that lie side by side share their words.
void raw_pair(ivec2 at, out vec3 left, out vec3 right) {
    int last = video.size.x - 1;
    if (FORMAT != 2) {
        left = raw(at);
        right = raw(ivec2(min(at.x + 1, last), at.y));
        return;
    }
    int i = (at.y * video.size.x + min(at.x, max(last - 1, 0))) * 3;
    uint a = texelFetch(words, i >> 2).x;
    uint b = texelFetch(words, (i >> 2) + 1).x;
    uint c = texelFetch(words, (i >> 2) + 2).x;
    int shift = (i & 3) * 8;
    uint first = (a >> shift) | (shift == 0 ? 0u : b << (32 - shift));
    uint second = (b >> shift) | (shift == 0 ? 0u : c << (32 - shift));
    vec3 one = bytes(first).xyz;
    vec3 two = vec3(first >> 24, second & 255u, (second >> 8) & 255u);
    left = at.x < last ? one : last == 0 ? one : two;
    right = last == 0 ? one : two;
}

uint to_code(vec3 c) {
    return pack(FORMAT == 2 ? c : full_range(c.xxxx).x + tint(c.yz));
}

// Where a point of the screen lies in the picture, counted in pixels from the first one's centre.
vec2 on_picture(vec2 screen) {
    return clamp(screen * video.scale + video.offset - 0.5, vec2(0.0), vec2(video.size - 1));
}

// Five neighbours of row `y` from column `x` on; what would lie beyond the row's end is any number.
void raw_five(int x, int y, out uvec4 four, out uint fifth) {
    int begin = x & ~3, shift = x & 3;
    uvec4 a = raw_four(begin, y), b = raw_four(min(begin + 4, video.size.x - 4), y);
    bool by_two = (shift & 2) != 0, by_one = (shift & 1) != 0;
    uvec4 low = by_two ? uvec4(a.zw, b.xy) : a;
    uvec2 high = by_two ? b.zw : b.xy;
    four = by_one ? uvec4(low.yzw, high.x) : low;
    fifth = by_one ? high.y : high.x;
}

// Four screen pixels from `x` on, bilinear, by what is between the rows at five columns: none of them is further right of the first
// one's columns than it is on the screen.
uvec4 blended_four(int x, int y) {
    vec2 at = on_picture(vec2(x, y) + 0.5);
    ivec2 low = ivec2(at);
    float part = at.y - float(low.y);
    uvec4 top, bottom;
    uint top_fifth, bottom_fifth;
    raw_five(low.x, low.y, top, top_fifth);
    raw_five(low.x, min(low.y + 1, video.size.y - 1), bottom, bottom_fifth);
    vec3 a = mix(bytes(top.x).xyz, bytes(bottom.x).xyz, part);
    vec3 b = mix(bytes(top.y).xyz, bytes(bottom.y).xyz, part);
    vec3 c = mix(bytes(top.z).xyz, bytes(bottom.z).xyz, part);
    vec3 d = mix(bytes(top.w).xyz, bytes(bottom.w).xyz, part);
    vec3 e = mix(bytes(top_fifth).xyz, bytes(bottom_fifth).xyz, part);
    float second = on_picture(vec2(x + 1, y) + 0.5).x, third = on_picture(vec2(x + 2, y) + 0.5).x;
    float fourth = on_picture(vec2(x + 3, y) + 0.5).x;
    int to_second = int(second) - low.x, to_third = int(third) - low.x, to_fourth = int(fourth) - low.x;
    return uvec4(
        to_code(mix(a, b, at.x - float(low.x))),
        to_code(mix(to_second > 0 ? b : a, to_second > 0 ? c : b, fract(second))),
        to_code(mix(to_third > 1 ? c : to_third > 0 ? b : a, to_third > 1 ? d : to_third > 0 ? c : b, fract(third))),
        to_code(mix(
            to_fourth > 2 ? d : to_fourth > 1 ? c : to_fourth > 0 ? b : a,
            to_fourth > 2 ? e : to_fourth > 1 ? d : to_fourth > 0 ? c : b,
            fract(fourth)
        ))
    );
}

// One screen pixel, bilinear.
uint blended(vec2 screen) {
    vec2 at = on_picture(screen);
    ivec2 low = ivec2(at);
    vec2 part = at - vec2(low);
    vec3 a, b, c, d;
    raw_pair(low, a, b);
    raw_pair(ivec2(low.x, min(low.y + 1, video.size.y - 1)), c, d);
    return to_code(mix(mix(a, b, part.x), mix(c, d, part.x), part.y));
}

#ifdef OVERLAID
// A pixel with what lies over it, in linear light; both ways between code and light within a code. Untouched where nothing does.
vec3 light_of(vec3 code) {
    return code * (0.0602271 + code * (0.3477055 + code * (0.9501875 - 0.3640412 * code)));
}

uint overlaid(uint code, uint over) {
    if (over == 0u) {
        return code;
    }
    vec4 o = bytes(over) * (1.0 / 255.0);
    vec3 light = light_of(bytes(code).xyz * (1.0 / 255.0)) * (1.0 - o.a) + light_of(o.rgb);
    vec3 s = sqrt(light), t = sqrt(s);
    return pack((0.662002687 * s + 0.684122060 * t - 0.323583601 * sqrt(t) - 0.0225411470 * light) * 255.0);
}
#endif

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) * ivec2(RUN, 1);
    if (FOURS) {
        pixels = SCALED ? blended_four(at.x, at.y) : four(at.x, at.y);
    } else {
        pixels = uvec4(0);
        for (int i = 0; i < RUN; ++i) {
            pixels[i] = SCALED ? blended(vec2(at.x + i, at.y) + 0.5) : to_code(raw(ivec2(at.x + i, at.y)));
        }
    }
#ifdef OVERLAID
    for (int i = 0; i < RUN; ++i) {
        pixels[i] = overlaid(pixels[i], texelFetch(overlay, ivec2(at.x + i, at.y), 0).r);
    }
#endif
}
