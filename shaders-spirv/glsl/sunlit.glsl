// How much of the sun reaches a place, by the shadow map: where anything in the map is nearer to the sun, none. The four texels about
// the place, weighed bilinearly (Reeves, Salesin & Cook 1987, "Rendering antialiased shadows with depth maps", with a filter of two texels).

#ifndef SHADOW_SET
#define SHADOW_SET 1
#endif
layout(set = SHADOW_SET, binding = 0) uniform sampler2D shadow_map;

// Nearer to the sun than all that is ever drawn into the map: nothing shades it.
const float UNSHADED = 1.5;

// Share of the sun's light that arrives at `place`: texels, not beyond those of `box`, and nearness to the sun, 0 to 1.
float sun_share(vec3 place, vec4 box) {
    vec2 texel = clamp(place.xy, box.xy, box.zw) - 0.5;
    vec4 nearest = textureGather(shadow_map, (floor(texel) + 1.0) / vec2(textureSize(shadow_map, 0)));
    vec4 lit = vec4(lessThanEqual(nearest, vec4(place.z)));
    vec2 share = fract(texel);
    return mix(mix(lit.w, lit.z, share.x), mix(lit.x, lit.y, share.x), share.y);
}

// Of the light that the sun sends without shadow, what arrives at `place`. It is below nothing on what faces away: corners on either side of
// where the sun grazes a triangle then say where that is.
vec3 sunlit(vec3 sun, vec3 place, vec4 box) {
    sun = max(sun, 0.0);
    return place.z > UNSHADED || sun.g == 0.0 ? sun : sun * sun_share(place, box);
}
