// What is the same at every pixel of a wake, from its block and the frame's light.
struct WakeLight {
    vec4 hull;     // length and beam, metres; share of light that haze replaces; mean square slope of the sea
    vec4 foam;     // rgb: light of whole foam
    // The sea's light is body + fresnel * (mirrored + skyward * higher), each fitted to the picture; w: its luminance.
    vec4 body;
    vec4 mirrored;
    vec4 higher;
    vec4 shade_box;   // texels of the shadow map that are the boat's
    vec4 shade_foam;  // rgb: light of whole foam in its shadow
};

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

WakeLight wake_light(WakeHead head) {
    // What comes out of clear to greenish water, as a share of a white matt surface (Mobley 1994, fig. 3.27).
    vec3 body = head.sea.rgb * vec3(0.008, 0.016, 0.018) * (frame.sun.rgb + frame.sky.rgb);
    vec3 mirrored = head.sea.rgb * frame.horizon.rgb - body;
    vec3 higher = head.sea.rgb * (frame.sky.rgb - frame.horizon.rgb);
    return WakeLight(
        vec4(head.hull.xyz, head.up.w * head.up.w), vec4(head.foam.rgb, 0.0), vec4(body, dot(body, LUMINANCE)),
        vec4(mirrored, dot(mirrored, LUMINANCE)), vec4(higher, dot(higher, LUMINANCE)),
        head.shade_box, head.shade_foam);
}
