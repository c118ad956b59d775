#version 460
#extension GL_GOOGLE_include_directive : require
// A corner of a boat without a texture, mirrored in the sea.
#define MIRRORED
#include "boat_body.glsl"
