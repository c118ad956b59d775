// Sizes of what is known of a floating boat's reflection; the host's are in interface.rs.
const int BANDS = 14;          // of height
const int STEPS = 32;          // away from the hull
const int COLUMNS = 64;        // of its collapsed picture
const int LAYER_COLUMNS = 96;  // places across
