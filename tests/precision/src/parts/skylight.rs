//! Light of the whole sky on a boat's faces, from the part of it that a picture shows.

use anyhow::Result;
use bowwave_core::{
    estimate::light::{FittedSky, SkyFamily, SkyPixel},
    sky::SkyModel,
};
use glam::{DVec2, DVec3, Vec3};

use super::About;
use crate::{
    bench::{ExtremeResult, PartBench, Way},
    front::quantile,
    sky::{
        TrueSky, Window, faces, irradiance,
        models::{Hosek, Preetham},
    },
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "skylight",
    what: "Guesses the light of the whole sky on a boat's faces from the part of the sky that the picture shows.",
    truth: "fifty skies, suns from -6 to 80 degrees, clear to overcast: Hosek and Wilkie's, the same under patches of clouds, the CIE's standard \
            skies, and twilights integrated outright in other air; a camera of unknown exposure and white balance, eight bits. Faces: one level, \
            eight that stand, eight that lean back",
    rivals: "the mean of what is seen, as from everywhere; two bands of it, as before; the same fit with Preetham's and with Hosek and Wilkie's \
             skies, of which the latter also made two fifths of the skies to be guessed",
    why: "the atmosphere holds from day through twilight to night, and its errors by day are those of the rival that made the truth",
};

/// The set of skies that judges. Set 0 chose what the fit takes a model to be wrong by.
const JUDGES: u64 = 1;

/// What a way makes of pixels: irradiance on a face.
type Guess = Box<dyn Fn(DVec3) -> Vec3>;

/// A way that knows the sun and is given pixels.
type Guesser = Box<dyn Fn(&[SkyPixel]) -> Option<Guess>>;

fn of_fitted(sky: FittedSky, sun: DVec3) -> Guess {
    Box::new(move |normal| {
        irradiance(normal, |d| sky.lobes.at(d)) + sky.aureole * normal.dot(sun).max(0.0) as f32
    })
}

fn fitted<S: SkyModel + 'static>(family: SkyFamily<S>, sun: DVec3) -> Guesser {
    Box::new(move |pixels| family.fit(pixels).map(|sky| of_fitted(sky, sun)))
}

fn product(sun: DVec3) -> Guesser {
    fitted(SkyFamily::new(sun), sun)
}

fn preetham(sun: DVec3) -> Guesser {
    fitted(SkyFamily::of([2.0, 2.5, 3.2, 4.2, 5.5, 7.5].map(|t| Preetham::new(sun, t)), sun), sun)
}

fn hosek(sun: DVec3) -> Guesser {
    fitted(SkyFamily::of([2.0, 2.5, 3.2, 4.2, 5.5, 7.5].map(|t| Hosek::new(sun, t)), sun), sun)
}

fn mean(pixels: &[SkyPixel]) -> Vec3 {
    pixels.iter().map(|p| p.radiance).sum::<Vec3>() / pixels.len().max(1) as f32
}

fn even(_: DVec3) -> Guesser {
    Box::new(|pixels| {
        let light = mean(pixels);
        Some(Box::new(move |normal| irradiance(normal, |_| light)))
    })
}

/// As boats were lit before: the mean above six degrees, as from everywhere, by how far a face looks up.
fn bands(_: DVec3) -> Guesser {
    Box::new(|pixels| {
        let high: Vec<SkyPixel> = pixels.iter().filter(|p| p.direction.z > 0.105).copied().collect();
        let light = mean(&high);
        Some(Box::new(move |normal| light * (std::f64::consts::PI * (0.5 + 0.5 * normal.z)) as f32))
    })
}

/// Errors of a way over all faces and windows: distance of the two colours over the true one. No light, or one that is no number, errs by 1.
fn errors(way: &Guesser, truth: &[(DVec3, Vec3)], windows: &[Window]) -> Vec<f64> {
    let of_window = |window: &Window| {
        let guess = way(&window.pixels);
        let error = |(normal, light): &(DVec3, Vec3)| {
            let (expected, found) =
                (*light * window.gain, guess.as_ref().map_or(Vec3::ZERO, |guess| guess(*normal)));
            let error = f64::from((found - expected).length() / expected.length().max(1e-12));
            if error.is_finite() { error } else { 1.0 }
        };
        truth.iter().map(error).collect::<Vec<f64>>()
    };
    windows.iter().flat_map(of_window).collect()
}

/// A way by its name, and whether the product uses it.
type NamedWay = (&'static str, bool, fn(DVec3) -> Guesser);

const WAYS: [NamedWay; 5] = [
    ("atmosphere, fitted", true, product),
    ("Hosek and Wilkie, fitted", false, hosek),
    ("Preetham, fitted", false, preetham),
    ("two bands", false, bands),
    ("mean, from everywhere", false, even),
];

/// Errors of all ways over the skies that judge.
#[derive(Default)]
struct Judged {
    all: [Vec<f64>; WAYS.len()],
    /// The product's by the kind of sky.
    kinds: Vec<(&'static str, Vec<f64>)>,
}

impl Judged {
    fn of(skies: &[&TrueSky], size_deg: DVec2) -> Self {
        let mut judged = Self::default();
        for (number, sky) in (0..).zip(skies) {
            let windows = [0.6, 1.7, 2.9].map(|azimuth| sky.window(azimuth, size_deg, number));
            let truth: Vec<(DVec3, Vec3)> = faces().into_iter().map(|n| (n, sky.on_face(n))).collect();
            for ((_, is_product, way), all) in WAYS.iter().zip(&mut judged.all) {
                let found = errors(&way(sky.sun), &truth, &windows);
                if *is_product {
                    match judged.kinds.iter_mut().find(|(kind, _)| *kind == sky.kind) {
                        Some((_, of_kind)) => of_kind.extend(&found),
                        None => judged.kinds.push((sky.kind, found.clone())),
                    }
                }
                all.extend(found);
            }
        }
        judged
    }
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let skies = TrueSky::fifty(JUDGES);
    let step = if bench.is_quick() { 5 } else { 1 };
    // Every fifth is of another kind in each five.
    let skies: Vec<&TrueSky> =
        skies.iter().enumerate().filter(|(i, _)| i % step == (i / step) % step).map(|(_, sky)| sky).collect();
    let Some(first) = skies.first() else { return Ok(()) };
    for (size_deg, name) in
        [(DVec2::new(40.0, 25.0), "40 x 25 deg of sky"), (DVec2::new(40.0, 10.0), "40 x 10 deg of sky")]
    {
        let judged = Judged::of(&skies, size_deg);
        let window = first.window(0.6, size_deg, 0);
        let ways = WAYS.iter().zip(&judged.all).map(|((method, is_product, way), errors)| {
            let (run, pixels) = (way(first.sun), &window.pixels);
            let timed = Way::new(method, "", quantile(errors, 0.5), 1, move || run(pixels).is_some());
            if *is_product {
                timed.default_although(
                    "the rival made most of the skies by day that judge, and has no twilight",
                )
            } else {
                timed
            }
        });
        bench.scene(&format!("{name}, median"), "of the light", 0.01, ways.collect());
        let tried = WAYS.iter().zip(&judged.all).map(|((method, default, _), errors)| ExtremeResult {
            default: *default,
            ..ExtremeResult::rival(method, "95th percentile", quantile(errors, 0.95))
        });
        bench.extreme(&format!("{name}, worst twentieth"), "of the light", tried.collect());
        for (kind, errors) in &judged.kinds {
            let median = ExtremeResult::product(WAYS[0].0, "median", quantile(errors, 0.5));
            let worst = ExtremeResult::product(WAYS[0].0, "95th percentile", quantile(errors, 0.95));
            bench.extreme(&format!("{name}, {kind}"), "of the light", vec![median, worst]);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clear_skys_light_is_guessed_better_than_by_its_bands() {
        let skies = TrueSky::fifty(JUDGES);
        let clear: Vec<&TrueSky> = skies.iter().filter(|sky| sky.kind == "clear").take(4).collect();
        let judged = Judged::of(&clear, DVec2::new(40.0, 25.0));
        let [own, _, _, bands, _] = judged.all.map(|errors| quantile(&errors, 0.5));
        assert!(own < 0.2 && own < 0.6 * bands, "{own}, by bands {bands}");
    }
}
