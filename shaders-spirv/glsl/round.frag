#version 460
#extension GL_GOOGLE_include_directive : require
// A round where no hull can stand before it.
#include "round_body.glsl"
