// What puts the layers of one boat onto the sea.
layout(push_constant) uniform ReflectBlock {
    uint index;
    uint first;      // of the list's vectors
    float last_step;
    float first_row; // middle of the boat's first row of the layers, texels
    vec4 tangent;    // tangent below the horizontal: for each pixel right and down, and at pixel (0, 0); last column of the layers
    vec4 mean;       // sea's mean luma: coefficients of the tangent's root; smallest root
    vec4 spread;     // how much brighter than that a pixel is which has as much more as an outer brightness; largest root
    vec4 place;      // tangent below the horizontal at the anchor, its change by pixel, square of the step by pixel and over the tangent's square
    vec4 span;       // as in the boat's block of lobes
    vec4 sky_most;   // luminance above which light is the sun's: coefficients of the powers of the step
    vec2 texel;      // size of the layers' texels, texture coordinates
    vec2 pad;
} draw;
