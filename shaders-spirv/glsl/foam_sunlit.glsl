// Foam in the shadow of the boat that makes it. The boat's own shadow map serves any place behind it: what it shows of the boat hides the
// sun there as well.
#include "sunlit.glsl"

// Light of whole foam there, between that of foam in the sun and in the shadow.
vec3 foam_light(vec3 lit, vec3 shaded, vec4 box, vec3 place) {
    bool inside = all(greaterThan(place.xy, box.xy)) && all(lessThan(place.xy, box.zw));
    return inside ? mix(shaded, lit, sun_share(place, box)) : lit;
}
