#version 460
#extension GL_GOOGLE_include_directive : require
// The picture alone.
#include "video_body.glsl"
