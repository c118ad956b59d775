// How one boat is put onto the sea (set 0, binding 2). Pixels are the screen's.
const int HULL_LINE_COLUMNS = 32;

struct WaterBlock {
    vec2 anchor;         // where the hull-water line is measured from
    vec2 down;           // unit vector in which gravity pulls
    vec2 columns;        // across position of the table's first column; columns for each pixel
    vec2 mirror_scale;   // texture coordinates of the mirror layer for each pixel
    vec2 mirror_offset;  // texture coordinates of the mirror layer at pixel (0, 0)
    vec2 pad;
    vec4 mirror_bounds;  // smallest and largest texture coordinates that belong to this boat
    vec4 passes;         // wave pass-through: from none to all when dark (x, y), from all to none when bright (z, w)
    float shadow;        // i of eq. 7
    float shadow_fall;   // 1 / k of eq. 7
    float step;          // pixels between the nine gradients' places
    float flat_spread;   // spread of the gradients below which a patch counts as flat, codes 0 to 1
    vec4 hull_line[HULL_LINE_COLUMNS / 4];  // pixels below `anchor` of the hull-water line, column by column
};

const int WATERS_MAX = 64;

// A uniform block and no storage buffer: a driver that runs on the processor reads it once and not for every pixel.
layout(std140, set = 0, binding = 2) uniform Waters {
    WaterBlock waters[WATERS_MAX];
};
