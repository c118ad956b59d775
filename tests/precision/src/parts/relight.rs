//! A virtual light added to a real pixel: equation 1 of Hughes, Konttinen and Pattanaik 2004.

use anyhow::Result;

use super::{About, even};
use crate::{
    bench::{PartBench, Way},
    truth::files::{code, linear},
};

/// Description of this part.
pub const ABOUT: About = About {
    part: "relight",
    what: "Adds a virtual light to a pixel of the camera's picture, whose surface is known by its colour alone.",
    truth: "surfaces of known reflectance in a known light and a second one, whose sum is coded once; the picture is the first light alone in eight bits, with noise by night",
    rivals: "equation 1 of Hughes, Konttinen and Pattanaik 2004, C = D + D S: in codes, with the camera's gamma undone, S limited to 1 as blending does or not at all, \
             and not limited in a sum of eight bits, which wraps",
    why: "the equation in linear light without a limit is right by day, and by night makes noise bright: its worst pixel. A reflectance between limits, and grey paint in the dark, \
          give up some of the mean for that. What is whiter than the upper limit comes out too dark",
};

/// A pixel that gets a second light.
#[derive(Clone, Copy, Debug)]
pub struct LitPixel {
    /// Its code in the picture.
    pub seen: u8,
    /// Radiance of white in the picture's own light, the picture's white being 1.
    pub white: f32,
    /// Radiance that the virtual light gives white.
    pub lit: f32,
}

/// A way of adding the light: the code that comes out.
pub type Relight = fn(LitPixel) -> u8;

/// A way by its name and setting.
pub const WAYS: [(&str, &str, Relight); 6] = [
    ("reflectance from the picture", ".02 to .6; grey in the dark", product),
    ("eq. 1", "gamma undone, S up to 1, as printed", as_printed),
    ("eq. 1", "in codes, S up to 1", in_codes),
    ("eq. 1", "gamma undone, S as it is", unlimited),
    ("eq. 1", "gamma 2.2, S as it is", power),
    ("eq. 1", "gamma undone, a sum of eight bits", wrapped),
];

/// S of the equation.
fn ratio(pixel: LitPixel) -> f32 {
    pixel.lit / pixel.white.max(1e-6)
}

fn as_printed(pixel: LitPixel) -> u8 {
    code((linear(pixel.seen) * (1.0 + ratio(pixel).min(1.0))).min(1.0))
}

fn in_codes(pixel: LitPixel) -> u8 {
    (f32::from(pixel.seen) * (1.0 + ratio(pixel).min(1.0))).round().min(255.0) as u8
}

fn unlimited(pixel: LitPixel) -> u8 {
    code((linear(pixel.seen) * (1.0 + ratio(pixel))).min(1.0))
}

fn power(pixel: LitPixel) -> u8 {
    let seen = (f32::from(pixel.seen) / 255.0).powf(2.2);
    ((seen * (1.0 + ratio(pixel))).min(1.0).powf(1.0 / 2.2) * 255.0).round() as u8
}

fn wrapped(pixel: LitPixel) -> u8 {
    let sum = linear(pixel.seen) * (1.0 + ratio(pixel));
    let coded = if sum <= 1.0 { f32::from(code(sum)) } else { (1.055 * sum.powf(1.0 / 2.4) - 0.055) * 255.0 };
    (coded.round() as u32 & 0xff) as u8
}

/// What `phantom.frag` does to a pixel of the gun.
fn product(pixel: LitPixel) -> u8 {
    const GREY: f32 = 0.18;
    let seen = linear(pixel.seen);
    let known = (seen / pixel.white.max(1e-6)).clamp(0.02, 0.6);
    let share = ((seen - 0.004) / (0.02 - 0.004)).clamp(0.0, 1.0);
    let albedo = GREY + (known - GREY) * (share * share * (3.0 - 2.0 * share));
    code((seen + pixel.lit * albedo).min(1.0))
}

/// A scene: the picture's light, how many times as strong the second one is at most, reflectances, and noise in codes.
struct Case {
    name: &'static str,
    white: f32,
    times: f32,
    reflectance: [f32; 2],
    noise: f32,
}

const CASES: [Case; 3] = [
    Case {
        name: "by day, a light as strong as the picture's",
        white: 0.9,
        times: 1.0,
        reflectance: [0.02, 0.9],
        noise: 0.0,
    },
    Case {
        name: "at dusk, a light eight times as strong",
        white: 0.12,
        times: 8.0,
        reflectance: [0.02, 0.9],
        noise: 0.5,
    },
    Case {
        name: "by night, a light a hundred times as strong",
        white: 0.008,
        times: 100.0,
        reflectance: [0.04, 0.4],
        noise: 2.0,
    },
];

/// A number about 0 of deviation 1, from twelve even ones.
pub fn bell(i: u64) -> f64 {
    (0..12).map(|k| even(i * 12 + k)).sum::<f64>() - 6.0
}

impl Case {
    /// Pixels and what they should become.
    fn pixels(&self) -> Vec<(LitPixel, u8)> {
        let make = |i: u64| {
            let [low, high] = self.reflectance;
            let reflectance = low + (high - low) * even(3 * i) as f32;
            let lit = self.white * self.times * even(3 * i + 1) as f32;
            let noise = self.noise * bell(i) as f32;
            let seen = (f32::from(code(reflectance * self.white)) + noise).round().clamp(0.0, 255.0) as u8;
            let truth = code((reflectance * (self.white + lit)).min(1.0));
            (LitPixel { seen, white: self.white, lit }, truth)
        };
        (0..4096).map(make).collect()
    }
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for case in &CASES {
        let pixels = case.pixels();
        let ways = WAYS.iter().enumerate().map(|(i, (method, setting, relight))| {
            let off = |(pixel, truth): &(LitPixel, u8)| f64::from(relight(*pixel).abs_diff(*truth));
            let mean = pixels.iter().map(off).sum::<f64>() / pixels.len() as f64;
            let worst = pixels.iter().map(off).fold(0.0, f64::max);
            let work = || pixels.iter().map(|(pixel, _)| u32::from(relight(*pixel))).sum::<u32>();
            let way =
                Way::new(method, setting, mean, pixels.len(), work).note(format!("worst {worst:.0} codes"));
            if i == 0 {
                way.default_although("chosen by its worst pixel at night; guns are darker than its limit")
            } else {
                way
            }
        });
        bench.scene(case.name, "codes, mean", 0.25, ways.collect());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equation_1_is_exact_by_day_and_as_printed_too_dark_by_night() {
        let mean = |case: &Case, relight: Relight| {
            let pixels = case.pixels();
            pixels.iter().map(|(p, t)| f64::from(relight(*p).abs_diff(*t))).sum::<f64>() / pixels.len() as f64
        };
        assert!(mean(&CASES[0], unlimited) < 1.0, "{}", mean(&CASES[0], unlimited));
        assert!(mean(&CASES[0], in_codes) > 10.0);
        assert!(mean(&CASES[2], product) < 0.5 * mean(&CASES[2], as_printed));
        let worst =
            |relight: Relight| CASES[2].pixels().iter().map(|(p, t)| relight(*p).abs_diff(*t)).max().unwrap();
        assert!(2 * worst(product) < worst(unlimited), "{} {}", worst(product), worst(unlimited));
        // A sum that wraps is wrong by the whole range somewhere.
        assert!(CASES[0].pixels().iter().any(|(p, t)| wrapped(*p).abs_diff(*t) > 100));
    }
}
