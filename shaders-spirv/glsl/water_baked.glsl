// The shadow of a hull by the scene's own light: what goes with reflection by the baked table, which is drawn by reflect.frag.
struct ContactBlock {
    vec4 sight;    // tangent below the horizontal at the hull-water line's anchor, its change by pixel; height of the eye and of the hull, m
    float sky;     // share of the sea's light that the sky made within the water
    float sun;     // the same of the sun, where the hull's shadow lies on this side of it
    float sun_m;   // how far towards the eye that shadow reaches, metres
    float pad;
};

layout(std140, set = 0, binding = 8) uniform Contacts {
    ContactBlock contact_blocks[WATERS_MAX];
};

// Share of the sea's light that the hull keeps from a pixel: of the light that comes out of the water, what the part of the sky gave
// that the hull hides (a wall seen under the angle a hides (1 - cos a) / 2), and the sun where its shadow lies. `below` and `line` are
// pixels.
float kept_off(float below, float line) {
    ContactBlock b = contact_blocks[draw.index];
    float near = b.sight.x + line * b.sight.y, eye = b.sight.z, high = b.sight.w;
    float from_hull = eye / near - eye / (near + below * b.sight.y);
    float hidden = 0.5 - 0.5 * from_hull * inversesqrt(from_hull * from_hull + high * high);
    float in_shadow = 1.0 - smoothstep(0.75, 1.05, from_hull / max(b.sun_m, 1e-3));
    return b.sky * hidden + b.sun * in_shadow;
}
