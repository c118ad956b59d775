//! Parts of the depth of view, each with a map of its own: where they end, and which box of the sun's axes each needs.

use glam::Vec3;

use super::{
    ShadowEye, ShadowFrame,
    depth_map::{SunAxes, SunBox},
    mesh::CasterMesh,
};

/// Ends of `count` parts of the depth from `near` to `far`, metres: the mean of logarithmic and even ends, weighed by `share` (Kolivand and Sunar 2014,
/// equations 11 to 13; a share of a half is the practical split of equation 10).
pub fn split(near: f32, far: f32, count: usize, share: f32) -> Vec<f32> {
    let end = |i: usize| {
        let part = i as f32 / count as f32;
        share * near * (far / near).powf(part) + (1.0 - share) * (near + (far - near) * part)
    };
    (0..=count).map(end).collect()
}

/// Depths between which meshes lie, metres: the view is split from the first object on.
pub fn depths(frame: &ShadowFrame<'_>) -> [f32; 2] {
    let of_all = frame.meshes.iter().map(|mesh| depth_of(&frame.eye, mesh));
    let [near, far] =
        of_all.fold([f32::INFINITY, f32::NEG_INFINITY], |a, d| [a[0].min(d[0]), a[1].max(d[1])]);
    let near = if near.is_finite() { near.max(0.5) } else { 0.5 };
    [near, far.max(near * 1.01)]
}

/// Depths between which a mesh lies, metres.
fn depth_of(eye: &ShadowEye, mesh: &CasterMesh) -> [f32; 2] {
    let depths = mesh.corners.iter().map(|c| eye.depth(*c));
    depths.fold([f32::INFINITY, f32::NEG_INFINITY], |[near, far], d| [near.min(d), far.max(d)])
}

/// Corners of the view between two depths.
fn corners(eye: &ShadowEye, depths: [f32; 2]) -> impl Iterator<Item = Vec3> {
    let (eye, [right, down, ahead]) = (*eye, eye.axes);
    (0..8).map(move |i| {
        let sign = |bit: i32| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        let depth = depths[i as usize >> 2];
        let off = right * (sign(0) * eye.reach[0]) + down * (sign(1) * eye.reach[1]);
        eye.position + (ahead + off) * depth
    })
}

/// Axes of a frame's maps: along the view as the sun sees it.
pub fn axes(frame: &ShadowFrame<'_>) -> SunAxes {
    SunAxes::new(frame.sun, frame.eye.axes[2], frame.eye.axes[0])
}

/// Box of the sun's axes that a part of the depth needs: its part of the view, and no more of it than what the meshes in it need. Nothing where it
/// has none.
pub fn needed(frame: &ShadowFrame<'_>, axes: &SunAxes, depths: [f32; 2]) -> Option<SunBox> {
    let meshes = frame.meshes.iter().filter(|mesh| {
        let [near, far] = depth_of(&frame.eye, mesh);
        near <= depths[1] && far >= depths[0]
    });
    let held = meshes.map(|mesh| axes.around(mesh.corners)).reduce(|a, b| a.joined(&b))?;
    let view = axes.around(corners(&frame.eye, depths));
    // What stands nearer to the sun than the view shades it too: the height is that of the meshes.
    let view = SunBox { low: view.low.with_z(held.low.z), high: view.high.with_z(held.high.z) };
    view.common(&held)
}

/// Box of the sun's axes that holds all of a part of the view, whatever is in it, as high as all meshes.
pub fn whole(frame: &ShadowFrame<'_>, axes: &SunAxes, depths: [f32; 2]) -> SunBox {
    let held = axes.around(frame.meshes.iter().flat_map(|mesh| mesh.corners));
    let view = axes.around(corners(&frame.eye, depths));
    SunBox { low: view.low.with_z(held.low.z), high: view.high.with_z(held.high.z) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_practical_split_is_the_mean_of_both() {
        let [even, log, both] = [0.0, 1.0, 0.5].map(|share| split(1.0, 16.0, 4, share));
        assert_eq!(even, [1.0, 4.75, 8.5, 12.25, 16.0]);
        assert!(log.iter().zip([1.0, 2.0, 4.0, 8.0, 16.0]).all(|(a, b)| (a - b).abs() < 1e-4));
        assert!((0..5).all(|i| (both[i] - 0.5 * (even[i] + log[i])).abs() < 1e-4));
    }
}
