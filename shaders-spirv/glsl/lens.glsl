// Camera space (x right, y down, z forward) to clip space through the distorting lens, reverse-Z with an infinite far plane.

// 0 a pinhole, 1 radial and tangential, 2 a fisheye.
layout(constant_id = 0) const uint BEND = 1;
layout(constant_id = 1) const bool ROLLING = false;

// Angle of a tangent up to tan(85 deg): halved twice, then its series. Drivers may err by 4096 units in the last place in their own.
float angle_of(float tangent) {
    float half_tangent = tangent / (1.0 + sqrt(1.0 + tangent * tangent));
    float t = half_tangent / (1.0 + sqrt(1.0 + half_tangent * half_tangent));
    float t2 = t * t;
    return 4.0 * t * (1.0 - t2 * (1.0 / 3.0 - t2 * (1.0 / 5.0 - t2 * (1.0 / 7.0 - t2 * (1.0 / 9.0 - t2 / 11.0)))));
}

// Pixels times distance, as the host's Distortion has it. Beyond r2_max, and behind the camera, the radial factor stays at its last
// value, so that the mapping is a plain perspective there and clipping at the near plane holds.
vec2 pixels_from_camera(vec3 p) {
    vec2 bent = p.xy;
    if (BEND != 0) {
        vec2 n = p.xy / max(p.z, 1e-3);
        float r2 = dot(n, n);
        float held = min(r2, frame.r2_max);
        n *= sqrt(held / max(r2, 1e-12));
        vec4 k = frame.bend;
        if (BEND == 2) {
            float r = sqrt(held);
            float a = angle_of(r);
            float a2 = a * a;
            bent *= (1.0 + a2 * (k.x + a2 * (k.y + a2 * (k.z + a2 * k.w)))) * (r > 1e-4 ? a / r : 1.0);
        } else {
            vec2 tangential = vec2(
                2.0 * k.z * n.x * n.y + k.w * (held + 2.0 * n.x * n.x),
                k.z * (held + 2.0 * n.y * n.y) + 2.0 * k.w * n.x * n.y);
            bent = bent * (1.0 + held * (k.x + held * k.y)) + tangential * p.z;
        }
    }
    return bent * frame.focal + frame.centre * p.z;
}

// The point as the camera has it that is turned as when a row so many below the middle is read. Turns within a picture are a degree or
// two: what the third power of that would add is less than a hundredth of a pixel.
vec3 from_row(vec3 p, float rows) {
    vec3 turn = -rows * frame.row_turn.xyz;
    vec3 across = cross(turn, p);
    return p + across + 0.5 * cross(turn, across);
}

// The point as the camera has it that reads the row on which it is seen: a Newton step from the row on which the middle row's camera
// would see it, and one more round for what the lens adds.
vec3 from_its_row(vec3 p) {
    float middle = 0.5 * frame.size.y;
    float z = max(p.z, 1e-3);
    vec3 drift = -cross(frame.row_turn.xyz, p);
    float slope = clamp(frame.focal.y * (drift.y * z - p.y * drift.z) / (z * z), -0.9, 0.9);
    float rows = (pixels_from_camera(p).y / z - middle) / (1.0 - slope);
    vec3 seen = from_row(p, clamp(rows, -frame.size.y, frame.size.y));
    rows = pixels_from_camera(seen).y / max(seen.z, 1e-3) - middle;
    return from_row(p, clamp(rows, -frame.size.y, frame.size.y));
}

vec4 clip_from_camera(vec3 p) {
    vec3 seen = ROLLING ? from_its_row(p) : p;
    return vec4(pixels_from_camera(seen) / frame.size * 2.0 - seen.z, frame.near, seen.z);
}
