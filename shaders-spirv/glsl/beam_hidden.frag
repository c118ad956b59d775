#version 460
#extension GL_GOOGLE_include_directive : require
// A searchlight's light where a hull may stand before the sea.
#define HIDDEN
#include "beam_body.glsl"
