#version 460
#extension GL_GOOGLE_include_directive : require
// A point of light where a hull may stand before it.
#define HIDDEN
#include "light_body.glsl"
