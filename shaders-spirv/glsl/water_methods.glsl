// The ways in which the sea mirrors a boat, by the number that water.frag is specialised with. The host reads the numbers from here.
// Each has a block of its own beside the WaterBlock of the same index (set 0, binding 8): only that of the method that is drawn is there.
const uint METHOD_OFF = 0u;
const uint METHOD_MIRROR = 1u;
const uint METHOD_FULL_AS_PUBLISHED = 2u;
const uint METHOD_FULL = 3u;
const uint METHOD_PHYSICS_AS_PUBLISHED = 4u;
const uint METHOD_PHYSICS = 5u;
// Of this method water.frag draws the shadow alone.
const uint METHOD_BAKED = 6u;

// Shadow levels, likewise.
const uint SHADOW_NONE = 0u;
const uint SHADOW_GRADUAL = 1u;
const uint SHADOW_STRONG = 2u;
