// Camera space (x right, y down, z forward) to clip space through the distorting lens, reverse-Z with an infinite far plane.

// Brown-Conrady as in the host's Lens::distort. Beyond r2_max, and behind the camera, the radial factor stays at its last
// value, so that the mapping is a plain perspective there and clipping at the near plane holds.
vec4 clip_from_camera(vec3 p) {
    vec2 n = p.xy / max(p.z, 1e-3);
    float r2 = dot(n, n);
    float held = min(r2, frame.r2_max);
    n *= sqrt(held / max(r2, 1e-12));
    float radial = 1.0 + held * (frame.radial.x + held * frame.radial.y);
    vec2 tangential = vec2(
        2.0 * frame.tangential.x * n.x * n.y + frame.tangential.y * (held + 2.0 * n.x * n.x),
        frame.tangential.x * (held + 2.0 * n.y * n.y) + 2.0 * frame.tangential.y * n.x * n.y);
    vec2 bent = p.xy * radial + tangential * p.z;
    vec2 pixels_w = bent * frame.focal + frame.centre * p.z;
    return vec4(pixels_w / frame.size * 2.0 - p.z, frame.near, p.z);
}
