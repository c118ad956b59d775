// A point of light as a lens shows it: a core as wide as the lens is sharp, and a glow (Moffat's profile with an exponent of 2) of what it
// scatters. Light is added; it hides nothing.
#include "light_block.glsl"
#include "dither.glsl"

#ifdef HIDDEN
// Boats may stand before it: the depth of their layer, valid here.
layout(set = 1, binding = 0) uniform sampler2DMS boats_depth;
#endif

layout(location = 0) out vec4 colour;

void main() {
#ifdef HIDDEN
    if (texelFetch(boats_depth, ivec2(gl_FragCoord.xy), 0).r > light.depth) {
        discard;
    }
#endif
    vec2 off = gl_FragCoord.xy - light.at;
    float squared = dot(off, off);
    float fall = 1.0 + squared * light.glow.a;
    vec3 sum = light.core.rgb * exp(-squared * light.sharp) + light.glow.rgb / (fall * fall);
    colour = vec4(dithered(sum), 0.0);
}
