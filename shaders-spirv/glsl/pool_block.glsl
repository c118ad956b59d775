// A pool of light on the sea (push constants).
layout(push_constant) uniform PoolBlock {
    vec4 foot;   // xyz: its middle, camera's axes, metres; w: the lamp's height over it
    vec4 aside;  // xyz: a level unit vector, camera's axes; w: radius of the pool
    vec4 away;   // xyz: the other one; w is unused
    vec4 light;  // rgb: light of the sea for a unit of what falls flat on it; a is unused
} pool;

const int POOL_RINGS = 8;
const int POOL_SECTORS = 24;
