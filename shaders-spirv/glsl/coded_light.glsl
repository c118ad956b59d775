// Light as it goes into a layer of eight bits a channel: its root, which spreads the steps as the eye does, and is cheap to take
// back. A layer that is filtered holds linear light.

// Whether the layer holds roots.
layout(constant_id = 0) const bool ROOTS = true;

vec3 coded(vec3 light) {
    return ROOTS ? sqrt(light) : light;
}
