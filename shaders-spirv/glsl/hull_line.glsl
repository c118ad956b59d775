// Where a boat's hull meets the water, from its table in water_block.glsl.

// Column of the table at a position across: outside it beyond the hull's ends.
float hull_column(uint boat, float across) {
    return (across - waters[boat].columns.x) * waters[boat].columns.y;
}

// Pixels below the anchor, at a column held to the table's.
float hull_line(uint boat, float column) {
    int first = min(int(column), HULL_LINE_COLUMNS - 2);
    float left = waters[boat].hull_line[first >> 2][first & 3];
    float right = waters[boat].hull_line[(first + 1) >> 2][(first + 1) & 3];
    return mix(left, right, column - float(first));
}

// The same at a position across: the ends' beyond the ends.
float hull_line_at(uint boat, float across) {
    return hull_line(boat, clamp(hull_column(boat, across), 0.0, float(HULL_LINE_COLUMNS - 1)));
}
