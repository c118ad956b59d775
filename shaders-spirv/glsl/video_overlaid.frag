#version 460
#extension GL_GOOGLE_include_directive : require
// The picture with the head-up display over it.
#define OVERLAID
#include "video_body.glsl"
