#version 460
#extension GL_GOOGLE_include_directive : require
// Foam that stands on the water beside a hull, torn at its top; hulls before it hide it.
#include "frame.glsl"
#include "wake_block.glsl"
#include "wake_foam.glsl"
#define SHADOW_SET 2
#include "foam_sunlit.glsl"

// Boats may stand before it: the depth of their layer, valid here.
layout(set = 1, binding = 0) uniform sampler2DMS boats_depth;

layout(location = 0) in vec4 spray;
layout(location = 1) in vec3 shade;
layout(location = 2) flat in WakeHead head;

layout(location = 0) out vec4 colour;

void main() {
    vec2 moved = fwidth(spray.xy);
    if (spray.w < 0.01 || texelFetch(boats_depth, ivec2(gl_FragCoord.xy), 0).r > gl_FragCoord.z) {
        discard;
    }
    float unused;
    // Higher up is thrown farther: other foam.
    float lace = foam_lace(spray.xy + 0.6 * spray.z, max(moved.x, moved.y), unused);
    float torn = smoothstep(1.0, 0.25, spray.z + 1.3 * (0.62 - lace)) * spray.w;
    vec3 foamed = foam_light(head.foam.rgb, head.shade_foam.rgb, head.shade_box, shade);
    vec3 light = mix(foamed * (0.5 + lace), frame.horizon.rgb, head.hull.z);
    colour = vec4(light * torn, torn);
}
