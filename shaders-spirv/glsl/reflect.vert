#version 460
#extension GL_GOOGLE_include_directive : require
// A piece of the sheet of water that throws a boat's light back: a strip below a straight piece of the hull-water line. What goes
// straight across it is worked out at its corners and not for every pixel.
#include "frame.glsl"
#include "water_block.glsl"
#include "reflect_block.glsl"

// Two vectors for each strip (set 0, binding 5): across positions of its left and right side and pixels below the anchor of the line
// there; pixels below the line of its upper edge, and of its lower one left and right.
layout(std430, set = 0, binding = 5) readonly buffer Rects {
    vec4 rects[];
};

// Pixels right of the anchor, and below it of the hull-water line there; pixels below that line; tangent below the horizontal.
layout(location = 0) noperspective out vec4 place_out;

void main() {
    uint strip = draw.first + 2u * uint(gl_InstanceIndex);
    vec4 sides = rects[strip], ends = rects[strip + 1u];
    bool right = (gl_VertexIndex & 1) != 0, lower = (gl_VertexIndex & 2) != 0;
    float across = right ? sides.y : sides.x, line = right ? sides.w : sides.z;
    float below = !lower ? ends.x : right ? ends.z : ends.y;
    vec2 down = waters[draw.index].down;
    vec2 at = waters[draw.index].anchor + vec2(down.y, -down.x) * across + down * (line + below);
    place_out = vec4(across, line, below, dot(draw.tangent.xy, at) + draw.tangent.z);
    gl_Position = clip_from_pixels(at);
}
