#version 460
#extension GL_GOOGLE_include_directive : require
// A boat with a texture, mirrored in the sea.
#define MIRRORED
#include "boat_textured_body.glsl"
