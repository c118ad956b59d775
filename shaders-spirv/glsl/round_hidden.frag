#version 460
#extension GL_GOOGLE_include_directive : require
// A round where a hull may stand before it.
#define HIDDEN
#include "round_body.glsl"
