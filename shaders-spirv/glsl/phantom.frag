#version 460
// The own gun and ship in the camera's picture, laid over what was drawn. Where their edge is blurred, the picture mixes them with the
// sea behind; their own light is then taken from a little further inside, so that no rim of that sea shines before a virtual boat.

layout(push_constant) uniform PhantomBlock {
    vec2 origin;  // screen position of the upper left corner of both textures
    vec2 size;    // theirs, pixels
    vec2 bore;    // screen position at which the bore vanishes
    float recoil; // what recoils is seen so many times as far from there as it rests
    float soft;   // width of an edge, pixels
    vec4 lit;     // rgb: light of lamps on a white matt thing; a: luminance that the picture shows of one, lit as it is
} phantom;

// Distance to the nearest edge of what stays, and of what recoils as it rests, in widths of an edge: 0 stands for -2, inside, and 1 for +2.
layout(set = 0, binding = 0) uniform sampler2D distances;
// The camera's picture before anything was drawn, linear light.
layout(set = 0, binding = 1) uniform sampler2D picture;

layout(location = 0) out vec4 light;

// Inside by so many widths nothing of the sea is mixed in.
const float PURE = 1.0;

float distance_at(vec2 at) {
    vec2 both = textureLod(distances, (at - phantom.origin) / phantom.size, 0.0).rg;
    if (phantom.recoil != 1.0) {
        vec2 rest = phantom.bore + (at - phantom.bore) / phantom.recoil;
        both.g = textureLod(distances, (rest - phantom.origin) / phantom.size, 0.0).g;
    }
    return min(both.r, both.g) * 4.0 - 2.0;
}

// What a real thing throws back (Hughes, Konttinen and Pattanaik 2004, eq. 1: its picture over the light that it was taken in). In the dark the
// picture shows noise: then it is that of grey paint.
vec3 albedo(vec3 seen) {
    const float GREY = 0.18, LEAST = 0.02, MOST = 0.6;
    const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);
    vec3 known = clamp(seen / max(phantom.lit.a, 1e-6), LEAST, MOST);
    return mix(vec3(GREY), known, smoothstep(0.004, 0.02, dot(seen, LUMINANCE)));
}

void main() {
    vec2 at = gl_FragCoord.xy;
    float outside = distance_at(at);
    float cover = clamp(0.5 - outside, 0.0, 1.0);
    if (cover <= 0.0) {
        discard;
    }
    float short_of = outside + PURE;
    if (short_of > 0.0) {
        vec2 slope = vec2(
            distance_at(at + vec2(1.0, 0.0)) - distance_at(at - vec2(1.0, 0.0)),
            distance_at(at + vec2(0.0, 1.0)) - distance_at(at - vec2(0.0, 1.0))
        );
        float steep = length(slope);
        if (steep > 1e-3) {
            at -= slope * (short_of * phantom.soft / steep);
        }
    }
    vec3 seen = textureLod(picture, (at - phantom.origin) / phantom.size, 0.0).rgb;
    light = vec4(seen + phantom.lit.rgb * albedo(seen), 1.0) * cover;
}
