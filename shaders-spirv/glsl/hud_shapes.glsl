// What can fill a rectangle of the head-up display.
const uint SHAPE_GLYPH = 0;
const uint SHAPE_PLATE = 1;
const uint SHAPE_DISC = 2;
const uint SHAPE_RING = 3;
const uint SHAPE_CROSS = 4;
const uint SHAPE_TRIANGLE = 5;
const uint SHAPE_SQUARE = 6;
const uint SHAPE_DIAMOND = 7;
const uint SHAPE_BARRED = 8;
