// Largest sizes of what is known of a floating boat's reflection: its room in the images. The host's are in interface.rs.
const int BANDS = 10;  // of height
const int STEPS = 20;  // away from the hull
