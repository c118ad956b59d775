#version 460
#extension GL_GOOGLE_include_directive : require
// A searchlight's light where no hull can stand.
#include "beam_body.glsl"
