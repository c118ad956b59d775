// What a searchlight adds to the picture's light: that of the air before everything, and that of the sea where no hull stands before it.
#include "beam_block.glsl"

#ifdef HIDDEN
// Boats may stand before the sea: the depth of their layer, valid here.
layout(set = 1, binding = 0) uniform sampler2DMS boats_depth;
#endif

layout(location = 0) in vec2 light;

layout(location = 0) out vec4 colour;

void main() {
    vec3 sum = beam.haze.rgb * light.x;
#ifdef HIDDEN
    if (texelFetch(boats_depth, ivec2(gl_FragCoord.xy), 0).r == 0.0)
#endif
        sum += beam.sea.rgb * light.y;
    colour = vec4(sum, 0.0);
}
