#version 460
#extension GL_GOOGLE_include_directive : require
// A boat with a texture, its own shadows and those of others on it.
#include "boat_textured_body.glsl"
