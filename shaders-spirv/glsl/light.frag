#version 460
#extension GL_GOOGLE_include_directive : require
// A point of light where no hull can stand before it.
#include "light_body.glsl"
