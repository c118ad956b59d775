//! Light of the whole surroundings on a boat's corners, and its soft shadow on a plane below: by harmonics, by patches, and as the product has it.

pub mod harmonics;
mod receiver;

use std::f64::consts::{PI, TAU};

use anyhow::Result;
use bowwave_core::{colour::LUMINANCE, geometry::RigidPose, sky::SkyLobes};
use glam::{DQuat, DVec2, DVec3, Vec3};
use hw_sim::ocean::mesh::BoatMesh;

use super::{About, rms, worst};
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    sky::TrueSky,
    truth::boat::{box_boat, mesh},
};
pub use receiver::{Receiver, Surroundings};

/// Description of this part.
pub const ABOUT: About = About {
    part: "ambient",
    what: "Lights a boat's corners by the whole sky and the sea; says what a boat would shade of a plane it stands on.",
    truth: "4096 directions over the sphere, each asked by a ray whether the boat is in its way, times the sky's own radiance there; skies of part skylight, suns aside. Error over a level \
            white face",
    rivals: "spherical harmonics of 2 to 5 bands stored at each corner (Hughes, Konttinen and Pattanaik 2004, 4.5), windowed or not; patches of the sky asked by rays as light is gathered, \
             or found once (Kolivand and Sunar 2014); no shadow. Of the plane's ratio: that of each coefficient as printed, and that of both sums",
    why: "nine polynomials of the upper half of the sky and one number for the sea err as harmonics of three bands over the whole sphere do, and turn with a boat at no cost",
};

/// Directions by which transfers of harmonics are found, and those of the truth.
const STORED: u32 = 1024;
const TRUE: u32 = 4096;
/// Directions of the product's own transfers, above and below.
const ABOVE: u32 = 120;
const BELOW: u32 = 40;
/// Corners of the boat that are asked.
const CORNERS: usize = 96;

/// Directions all over the sphere, each for the same solid angle, on a spiral.
pub fn spiral(count: u32) -> impl Iterator<Item = DVec3> + Clone {
    (0..count).map(move |i| {
        let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / f64::from(count);
        let level = (1.0 - z * z).sqrt();
        (DVec2::from_angle(f64::from(i) * 2.399_963_229_728_653 % TAU) * level).extend(z)
    })
}

/// The boat that shades itself and the plane.
pub fn shading_boat() -> BoatMesh {
    mesh(&box_boat(), RigidPose { world_from_body: DQuat::from_rotation_z(0.4), position: DVec3::Z * 0.6 })
}

/// Corners of the boat a little off its surface, above the plane on which its keel stands.
fn corners() -> Vec<(DVec3, DVec3)> {
    let pose = RigidPose { world_from_body: DQuat::from_rotation_z(0.4), position: DVec3::Z * 0.6 };
    let model = box_boat();
    let step = (model.vertices.len() / CORNERS).max(1);
    let off = |v: &bowwave_core::model::Vertex| {
        let (at, normal) = (pose.to_world(v.position.as_dvec3()), pose.world_from_body * v.normal.as_dvec3());
        // Into the face by a hair, so that a neighbour's edge is not in its way.
        let inward = (pose.to_world(DVec3::Z) - at).normalize_or_zero();
        (at + inward * 0.03 + normal * (0.01 - inward.dot(normal) * 0.03), normal)
    };
    model.vertices.iter().step_by(step).map(off).filter(|(at, _)| at.z > 0.05).collect()
}

/// Places of the plane around the boat.
pub fn plane(across: usize, along: usize) -> Vec<(DVec3, DVec3)> {
    let at = |i: usize, count: usize, reach: f64| ((i as f64 + 0.5) / count as f64 - 0.5) * 2.0 * reach;
    (0..across * along)
        .map(|i| (DVec3::new(at(i % across, across, 7.0), at(i / across, along, 4.0), 1e-3), DVec3::Z))
        .collect()
}

/// Surroundings of some skies, with a dark sea below.
pub fn surroundings(skies: &[TrueSky]) -> Vec<Surroundings<'_>> {
    skies.iter().step_by(7).map(|sky| Surroundings::new(|d| sky_and_sea(sky, d))).collect()
}

fn sky_and_sea(sky: &TrueSky, d: DVec3) -> Vec3 {
    if d.z > 0.0 { sky.radiance(d) } else { 0.1 * sky.radiance(DVec3::new(d.x, d.y, 0.05).normalize()) }
}

/// How a corner's light is found from what is stored there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stored {
    /// Harmonics of so many bands, windowed or not.
    Harmonics(usize, bool),
    /// So many patches of the sky with their visibility.
    Patches(u32),
    /// The product's nine polynomials, and the sea.
    Lobes,
    /// Nothing: all of the light of a face in the open, by three bands.
    Open,
}

impl Stored {
    fn words(self) -> (&'static str, String) {
        match self {
            Self::Harmonics(order, is_windowed) => {
                ("harmonics", format!("{order} bands{}", if is_windowed { ", windowed" } else { "" }))
            }
            Self::Patches(count) => ("patches found once", count.to_string()),
            Self::Lobes => ("nine polynomials and the sea", "120 and 40 directions".into()),
            Self::Open => ("no shadow", "three bands".into()),
        }
    }
}

const WAYS: [Stored; 12] = [
    Stored::Lobes,
    Stored::Harmonics(2, false),
    Stored::Harmonics(2, true),
    Stored::Harmonics(3, false),
    Stored::Harmonics(3, true),
    Stored::Harmonics(4, false),
    Stored::Harmonics(4, true),
    Stored::Harmonics(5, false),
    Stored::Patches(32),
    Stored::Patches(128),
    Stored::Patches(512),
    Stored::Open,
];

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let boat = shading_boat();
    let skies = TrueSky::fifty(2);
    let all = surroundings(&skies);
    measure_corners(bench, &boat, &all);
    measure_plane(bench, &boat, &all);
    measure_ringing(bench, &all);
    Ok(())
}

fn measure_corners(bench: &mut PartBench, boat: &BoatMesh, all: &[Surroundings<'_>]) {
    let corners: Vec<Receiver<'_>> =
        corners().into_iter().map(|at| Receiver { boat: Some(boat), at }).collect();
    let truths: Vec<Vec<f64>> = corners.iter().map(|c| c.truth(all)).collect();
    let mut ways = Vec::new();
    for stored in WAYS {
        let kept: Vec<Vec<f64>> = corners.iter().map(|c| c.stored(stored)).collect();
        let lights: Vec<Vec<f64>> = all.iter().map(|s| s.coefficients(stored)).collect();
        let off = kept.iter().zip(&truths).flat_map(|(kept, truth)| {
            lights.iter().zip(all).zip(truth).map(|((light, s), truth)| (dot(kept, light) - truth) / s.level)
        });
        let (method, setting) = stored.words();
        let (error, bytes) = (rms(off), kept.iter().map(|k| 4 * k.len()).sum());
        let work = move || kept.iter().map(|kept| dot(kept, &lights[0])).sum::<f64>();
        let way = Way::new(method, &setting, error, corners.len(), work).holds(bytes);
        ways.push(if stored == Stored::Lobes {
            way.default_although(
                "a sky's polynomials are fitted to what is seen of it, and its light turns with the boat",
            )
        } else {
            way
        });
    }
    // As printed: which patches are seen is found while light is gathered.
    let gathered = |count: u32| {
        let light = all[0].coefficients(Stored::Patches(count));
        let corners = &corners;
        move || corners.iter().map(|c| dot(&c.stored(Stored::Patches(count)), &light)).sum::<f64>()
    };
    for count in [32, 128] {
        let same = ways_error(&corners, &truths, all, Stored::Patches(count));
        let setting = format!("{count}, rays in each frame, as printed");
        ways.push(Way::new("patches gathered", &setting, same, corners.len(), gathered(count)));
    }
    bench.scene("corners of a boat", "of a level face", 0.002, ways);
}

fn ways_error(
    corners: &[Receiver<'_>],
    truths: &[Vec<f64>],
    all: &[Surroundings<'_>],
    stored: Stored,
) -> f64 {
    let lights: Vec<Vec<f64>> = all.iter().map(|s| s.coefficients(stored)).collect();
    rms(corners.iter().zip(truths).flat_map(|(corner, truth)| {
        let kept = corner.stored(stored);
        let off = |((light, s), truth): ((&Vec<f64>, &Surroundings<'_>), &f64)| {
            (dot(&kept, light) - truth) / s.level
        };
        lights.iter().zip(all).zip(truth).map(off).collect::<Vec<f64>>()
    }))
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// How the plane's darkening is found from both sets of coefficients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ContactRatio {
    /// Of each coefficient, weighted by its light, as printed: those that are nothing without the object have no ratio.
    Each,
    /// Of both sums.
    Sums,
}

/// Share of its light that a place of the plane keeps with the boat on it.
pub fn kept_share(with: &[f64], without: &[f64], light: &[f64], ratio: ContactRatio) -> f64 {
    /// A coefficient so small against the first is nothing.
    const NOTHING: f64 = 1e-3;
    let whole = dot(without, light);
    let sum = match ratio {
        ContactRatio::Sums => dot(with, light),
        ContactRatio::Each => {
            let first = without.first().copied().unwrap_or(0.0).abs();
            let terms = with.iter().zip(without).zip(light);
            terms
                .map(
                    |((with, without), light)| {
                        if without.abs() > NOTHING * first { with * light } else { 0.0 }
                    },
                )
                .sum()
        }
    };
    sum / whole
}

fn measure_plane(bench: &mut PartBench, boat: &BoatMesh, all: &[Surroundings<'_>]) {
    let places = plane(20, 12);
    let receiver = |boat, at| Receiver { boat, at };
    let with: Vec<Receiver<'_>> = places.iter().map(|at| receiver(Some(boat), *at)).collect();
    let without = receiver(None, (DVec3::Z * 1e-3, DVec3::Z));
    let open = without.truth(all);
    let truths: Vec<Vec<f64>> = with
        .iter()
        .map(|r| r.truth(all).iter().zip(&open).map(|(with, without)| with / without).collect())
        .collect();
    let mut ways = vec![Way::new(
        "no contact shadow",
        "",
        rms(truths.iter().flatten().map(|t| 1.0 - t)),
        places.len(),
        || 1.0,
    )];
    for (order, is_windowed) in [(2, false), (2, true), (4, false), (4, true), (5, false)] {
        for (ratio, words) in
            [(ContactRatio::Each, "ratio of coefficients, as printed"), (ContactRatio::Sums, "ratio of sums")]
        {
            let stored = Stored::Harmonics(order, is_windowed);
            let kept: Vec<Vec<f64>> = with.iter().map(|r| r.stored(stored)).collect();
            let (bare, lights): (Vec<f64>, Vec<Vec<f64>>) =
                (without.stored(stored), all.iter().map(|s| s.coefficients(stored)).collect());
            let off = kept.iter().zip(&truths).flat_map(|(kept, truth)| {
                let off = |(light, truth): (&Vec<f64>, &f64)| kept_share(kept, &bare, light, ratio) - truth;
                lights.iter().zip(truth).map(off).collect::<Vec<f64>>()
            });
            let (method, bands) = (words, stored.words().1);
            let error = rms(off);
            let work =
                move || kept.iter().map(|kept| kept_share(kept, &bare, &lights[0], ratio)).sum::<f64>();
            ways.push(Way::new(method, &bands, error, places.len(), work));
        }
    }
    bench.scene("contact shadow on a plane", "of the plane's light", 0.002, ways);
}

/// How negative the sky becomes that is made of harmonics: the worst of these skies, and about a narrow bright haze.
fn measure_ringing(bench: &mut PartBench, all: &[Surroundings<'_>]) {
    let sun = DVec3::new(0.6, 0.0, 0.8);
    let glare = Surroundings::new(|d| {
        let near = (-0.5 * (d.angle_between(sun) / 0.15).powi(2)).exp() as f32;
        Vec3::splat(if d.z > 0.0 { 1.0 } else { 0.1 } + 60.0 * near)
    });
    let below = |s: &Surroundings<'_>, least: f64| (-least).max(0.0) / (s.level / PI);
    for (case, skies) in
        [("the skies of the corners", all), ("a bright haze about the sun", std::slice::from_ref(&glare))]
    {
        let mut tried = Vec::new();
        let of_lobes = |s: &Surroundings<'_>| {
            let lobes = SkyLobes::of(|d| s.radiance(d));
            let up = spiral(2000).filter(|d| d.z > 0.0);
            below(s, up.map(|d| f64::from(lobes.at(d).dot(LUMINANCE))).fold(f64::INFINITY, f64::min))
        };
        tried.push(ExtremeResult::product(
            "nine polynomials",
            "upper half, damped",
            worst(skies.iter().map(of_lobes)),
        ));
        for stored in WAYS {
            let Stored::Harmonics(order, _) = stored else { continue };
            let of = |s: &Surroundings<'_>| {
                let light = s.coefficients(stored);
                let values = spiral(2000).map(|d| dot(&light, &harmonics::values(order, d)));
                below(s, values.fold(f64::INFINITY, f64::min))
            };
            let (method, setting) = stored.words();
            tried.push(ExtremeResult::rival(method, &setting, worst(skies.iter().map(of))));
        }
        bench.extreme(&format!("{case}: most negative radiance"), "of the mean sky", tried);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_open_level_face_gets_what_falls_on_it() {
        let all = [Surroundings::new(|d| Vec3::splat(if d.z > 0.0 { 1.0 } else { 0.0 }))];
        assert!((all[0].level - PI).abs() < 0.01, "{}", all[0].level);
        let open = Receiver { boat: None, at: (DVec3::Z, DVec3::Z) };
        for stored in [Stored::Harmonics(3, false), Stored::Patches(512), Stored::Lobes] {
            let light = dot(&open.stored(stored), &all[0].coefficients(stored));
            assert!((light / PI - 1.0).abs() < 0.05, "{stored:?}: {light}");
        }
    }

    #[test]
    fn a_ratio_of_coefficients_forgets_on_which_side_the_boat_stands() {
        let boat = shading_boat();
        let bright_right =
            Surroundings::new(|d| Vec3::splat(if d.z > 0.0 { 1.0 + 0.9 * d.x as f32 } else { 0.0 }));
        let stored = Stored::Harmonics(4, false);
        let all = [bright_right];
        let light = all[0].coefficients(stored);
        let off = |ratio| {
            rms(plane(8, 5).into_iter().map(|at| {
                let (with, bare) = (Receiver { boat: Some(&boat), at }, Receiver { boat: None, at });
                let truth = with.truth(&all)[0] / bare.truth(&all)[0];
                kept_share(&with.stored(stored), &bare.stored(stored), &light, ratio) - truth
            }))
        };
        let (sums, each) = (off(ContactRatio::Sums), off(ContactRatio::Each));
        assert!(sums < 0.05 && each > 2.0 * sums, "{sums} {each}");
    }
}
