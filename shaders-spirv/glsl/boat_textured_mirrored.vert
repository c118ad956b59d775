#version 460
#extension GL_GOOGLE_include_directive : require
// A corner of a boat with a texture, mirrored in the sea.
#define MIRRORED
#define TEXTURED
#include "boat_body.glsl"
