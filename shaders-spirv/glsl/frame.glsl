// Blocks that every drawing pass shares. The host's side is src/interface.rs; a test holds the two together.

// Light and lens of one frame (set 0, binding 0).
layout(std140, set = 0, binding = 0) uniform FrameBlock {
    vec2 focal;       // pixels
    vec2 centre;      // pixels
    vec4 bend;        // k1, k2, p1, p2, or a fisheye's k1 to k4
    vec2 size;        // pixels
    float near;       // metres: depth is near / distance, 1 at the near plane, 0 at infinity
    float r2_max;     // beyond this squared angle tangent the distortion stays as it is there
    vec4 sun;         // linear radiance of white matt, facing the sun
    vec4 sky;         // the same, seeing only the upper sky
    vec4 sea;         // the same, seeing only the sea
    vec4 horizon;     // radiance of the horizon
    vec4 lamp;        // xyz: the searchlight, camera's axes, metres; w: its light falls with exp(-w sin^2 of the angle off its axis)
    vec4 beam;        // xyz: its axis, camera's axes; w: linear radiance of white matt that faces it a metre off
    vec4 row_turn;    // the camera's turn from row to row while a rolling shutter reads, radians about its axes
    // The camera's noise: rgb, variance in the dark, squared light; rgb, its growth with light; red's share of green's noise and its own,
    // blue's share of green's and of red's own; the picture's number, its pixels for one of the screen, 1 where pairs share their colour.
    vec4 noise[4];
} frame;

// Pixels to clip space.
vec4 clip_from_pixels(vec2 pixels) {
    return vec4(pixels / frame.size * 2.0 - 1.0, 0.0, 1.0);
}

// A corner of a rectangle (x0, y0, x1, y1), for a strip of four vertices.
vec2 corner(vec4 rect, int vertex) {
    return vec2((vertex & 1) == 0 ? rect.x : rect.z, (vertex & 2) == 0 ? rect.y : rect.w);
}
