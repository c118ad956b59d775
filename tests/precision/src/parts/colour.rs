//! Codes to light and back, and the camera's YUV.

use anyhow::Result;
use bowwave_core::{
    colour::{linear_to_srgb, srgb_to_linear},
    event::bt601_to_srgb,
};
use palette::{IntoColor, Lab, LinSrgb, Srgb, color_difference::Ciede2000, white_point::D65};

use super::{About, even, worst};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "colour",
    what: "sRGB codes to linear light and back, and the camera's YUV to sRGB codes.",
    truth: "IEC 61966-2-1 in f64 with the power by logarithm, and BT.601 and BT.709 from their luma coefficients in f64; the error \
            is the largest CIEDE2000 colour difference over colours of the whole cube, by the crate palette, which reproduces \
            Sharma's 34 pairs (data/ciede2000_sharma.csv). A difference of 1 is just seen; two roundings of an f32 answer \
            count as equal",
    rivals: "a square, the cubic that is much used on GPUs, tables with and without interpolation, powers in f64; for YUV, \
             integers of 8 and 16 bits and f64",
    why: "the power in f32 is a million times below what is seen. A table would be faster, but the trainer's CPU converts \
          some hundred pixels a frame (the GPU does the rest in its samplers), so that nothing would be saved",
};

/// Coded to linear, exact to rounding.
fn to_linear(c: f64) -> f64 {
    if c <= 0.040_45 { c / 12.92 } else { (((c + 0.055) / 1.055).ln() * 2.4).exp() }
}

/// Linear to coded, exact to rounding.
fn to_code(c: f64) -> f64 {
    if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * (c.ln() / 2.4).exp() - 0.055 }
}

fn lab(linear: [f64; 3]) -> Lab<D65, f64> {
    LinSrgb::<f64>::from(linear).into_color()
}

/// CIEDE2000 between two colours in linear light.
fn apart(a: [f64; 3], b: [f64; 3]) -> f64 {
    lab(a).difference(lab(b))
}

/// Colours of the whole cube: a grid, greys, and dark ones where codes are steepest.
fn colours() -> Vec<[f64; 3]> {
    let grid = (0..9 * 9 * 9).map(|i| [i / 81, i / 9 % 9, i % 9].map(|v| f64::from(v) / 8.0));
    let greys = (0..=1000).map(|i| [f64::from(i) / 1000.0; 3]);
    let dark = (0..500).map(|i| [even(3 * i), even(3 * i + 1), even(3 * i + 2)].map(|v| v * v * 0.2));
    grid.chain(greys).chain(dark).collect()
}

/// Ways of one conversion of a channel, collected with their errors.
struct ColourWays<'a> {
    colours: &'a [[f64; 3]],
    used: &'a [f32],
    /// Into linear light of what this conversion answers, for the difference.
    answer_to_linear: fn(f64) -> f64,
    truth: fn(f64) -> f64,
    ways: Vec<Way<'a>>,
    dark: Vec<ExtremeResult>,
}

impl<'a> ColourWays<'a> {
    fn add(
        &mut self,
        default: bool,
        (method, setting, bytes): (&str, &str, usize),
        f: impl Fn(f32) -> f32 + 'a,
    ) {
        let error = |colour: &[f64; 3]| {
            let answered = colour.map(|c| (self.answer_to_linear)(f64::from(f(c as f32))));
            let exact = colour.map(|c| (self.answer_to_linear)((self.truth)(c)));
            apart(answered, exact)
        };
        let dark = (0..=400).map(|i| [f64::from(i) * 1e-4; 3]);
        self.dark.push(ExtremeResult {
            default,
            ..ExtremeResult::rival(method, setting, worst(dark.map(|c| error(&c))))
        });
        let worst = worst(self.colours.iter().map(error));
        let used = self.used;
        let work = move || used.iter().map(|c| f(*c)).sum::<f32>();
        self.ways.push(Way::new(method, setting, worst, used.len(), work).holds(bytes).default_if(default));
    }

    /// Difference of two roundings of an f32 answer: nothing finer can be asked for.
    fn floor(&self) -> f64 {
        let light = |c: f64| (self.answer_to_linear)(c);
        let rounded = |c: f64| f64::from((self.truth)(c) as f32);
        let off = |c: &[f64; 3]| apart(c.map(|c| light(rounded(c))), c.map(|c| light((self.truth)(c))));
        2.0 * worst(self.colours.iter().map(off))
    }
}

/// A table over 0 to 1, linear between its steps or at the nearest.
fn table(steps: usize, f: fn(f64) -> f64, between: bool) -> impl Fn(f32) -> f32 {
    let values: Vec<f32> = (0..=steps).map(|i| f(i as f64 / steps as f64) as f32).collect();
    move |c| {
        let x = c.clamp(0.0, 1.0) * (values.len() - 1) as f32;
        if between {
            let i = (x as usize).min(values.len() - 2);
            values[i] + (values[i + 1] - values[i]) * (x - i as f32)
        } else {
            values[(x + 0.5) as usize]
        }
    }
}

fn codes_to_light(bench: &mut PartBench, colours: &[[f64; 3]], used: &[f32]) {
    let (ways, dark) = (Vec::new(), Vec::new());
    let mut all = ColourWays { colours, used, answer_to_linear: |l| l, truth: to_linear, ways, dark };
    all.add(false, ("square", "", 0), |c| c * c);
    // Chilliant 2012.
    all.add(false, ("cubic", "0.3053, 0.6822, 0.0125", 0), |c| {
        c * (c * (c * 0.305_306_01 + 0.682_171_1) + 0.012_522_878)
    });
    all.add(false, ("table, nearest", "256", 257 * 4), table(255, to_linear, false));
    all.add(false, ("table, linear", "256", 257 * 4), table(255, to_linear, true));
    all.add(false, ("table, linear", "4096", 4097 * 4), table(4096, to_linear, true));
    all.add(true, ("power", "f32", 0), srgb_to_linear);
    all.add(false, ("power", "f64", 0), |c| to_linear(f64::from(c)) as f32);
    bench.scene("sRGB code to light", "CIEDE2000", all.floor(), all.ways);
    bench.extreme("sRGB code to light, greys below code 10 of 255", "CIEDE2000", all.dark);
}

fn light_to_codes(bench: &mut PartBench, colours: &[[f64; 3]], used: &[f32]) {
    let (ways, dark) = (Vec::new(), Vec::new());
    let mut all = ColourWays { colours, used, answer_to_linear: to_linear, truth: to_code, ways, dark };
    all.add(false, ("square root", "", 0), f32::sqrt);
    // Chilliant 2012.
    all.add(false, ("three square roots", "", 0), |c| {
        let (a, b) = (c.sqrt(), c.sqrt().sqrt());
        (0.662_002_7 * a + 0.684_122_1 * b - 0.323_583_6 * b.sqrt() - 0.022_541_15 * c).max(0.0)
    });
    all.add(false, ("table, linear", "256", 257 * 4), table(256, to_code, true));
    all.add(false, ("table, linear", "4096", 4097 * 4), table(4096, to_code, true));
    all.add(true, ("power", "f32", 0), linear_to_srgb);
    all.add(false, ("power", "f64", 0), |c| to_code(f64::from(c)) as f32);
    bench.scene("light to sRGB code", "CIEDE2000", all.floor(), all.ways);
    bench.extreme("light to sRGB code, greys below 0.04", "CIEDE2000", all.dark);
}

/// Red and blue luma coefficients (ITU-R BT.601-7, BT.709-6).
const BT601: (f64, f64) = (0.299, 0.114);
const BT709: (f64, f64) = (0.2126, 0.0722);

/// Limited-range YUV to R'G'B' by the definition.
fn yuv_exact((kr, kb): (f64, f64), [y, u, v]: [u8; 3]) -> [f64; 3] {
    let y = (f64::from(y) - 16.0) / 219.0;
    let (u, v) = ((f64::from(u) - 128.0) / 224.0, (f64::from(v) - 128.0) / 224.0);
    let (r, b) = (y + 2.0 * (1.0 - kr) * v, y + 2.0 * (1.0 - kb) * u);
    [r, (y - kr * r - kb * b) / (1.0 - kr - kb), b]
}

/// Integers with 8 bits behind the point, as many cameras' own tools.
fn yuv_8([y, u, v]: [u8; 3]) -> [f32; 3] {
    let (c, d, e) = (i32::from(y) - 16, i32::from(u) - 128, i32::from(v) - 128);
    [298 * c + 409 * e, 298 * c - 100 * d - 208 * e, 298 * c + 516 * d]
        .map(|x| ((x + 128) >> 8).clamp(0, 255) as f32 / 255.0)
}

/// A coefficient over `range` codes with 16 bits behind the point, for channels of 16 bits.
const fn scaled(coefficient: f64, range: f64) -> i64 {
    (coefficient / range * 65_535.0 * 65_536.0 + 0.5) as i64
}

/// Integers with 16 bits behind the point, kept at 16 bits a channel.
fn yuv_16([y, u, v]: [u8; 3]) -> [f32; 3] {
    const Y: i64 = scaled(1.0, 219.0);
    const RV: i64 = scaled(1.402, 224.0);
    const GU: i64 = scaled(0.114 * 1.772 / 0.587, 224.0);
    const GV: i64 = scaled(0.299 * 1.402 / 0.587, 224.0);
    const BU: i64 = scaled(1.772, 224.0);
    let (c, d, e) = (i64::from(y) - 16, i64::from(u) - 128, i64::from(v) - 128);
    [Y * c + RV * e, Y * c - GU * d - GV * e, Y * c + BU * d]
        .map(|x| ((x + 32_768) >> 16).clamp(0, 65_535) as f32 / 65_535.0)
}

type Yuv = fn([u8; 3]) -> [f32; 3];

const YUV: [(&str, &str, Yuv); 4] = [
    ("integers", "8 bits", yuv_8),
    ("integers", "16 bits", yuv_16),
    ("floating", "f32", |[y, u, v]| bt601_to_srgb(y, u, v)),
    ("floating", "f64", |yuv| yuv_exact(BT601, yuv).map(|c| c.clamp(0.0, 1.0) as f32)),
];

/// YUV codes on a grid, with where BT.601 sends them.
fn yuv_codes() -> Vec<([u8; 3], [f64; 3])> {
    let axis = |i: u32| (i * 5).min(255) as u8;
    let codes = (0..52 * 52 * 52).map(|i| [axis(i / 2704), axis(i / 52 % 52), axis(i % 52)]);
    codes.map(|c| (c, yuv_exact(BT601, c))).collect()
}

fn coded_apart(answered: [f32; 3], exact: [f64; 3]) -> f64 {
    let light = |c: [f64; 3]| {
        let linear: LinSrgb<f64> = Srgb::<f64>::from(c.map(|c| c.clamp(0.0, 1.0))).into_linear();
        [linear.red, linear.green, linear.blue]
    };
    apart(light(answered.map(f64::from)), light(exact))
}

fn camera_codes(bench: &mut PartBench) {
    let all = yuv_codes();
    let inside = |c: &[f64; 3]| c.iter().all(|v| (0.0..=1.0).contains(v));
    let (inner, outer): (Vec<_>, Vec<_>) = all.into_iter().partition(|(_, rgb)| inside(rgb));
    let used: Vec<[u8; 3]> = inner.iter().step_by(7).take(1024).map(|(c, _)| *c).collect();
    let used = &used;
    let of = |f: Yuv, codes: &[([u8; 3], [f64; 3])]| {
        worst(codes.iter().step_by(3).map(|(c, exact)| coded_apart(f(*c), *exact)))
    };
    let ways = YUV.map(|(method, setting, f)| {
        let work = move || used.iter().map(|c| f(*c).iter().sum::<f32>()).sum::<f32>();
        Way::new(method, setting, of(f, &inner), used.len(), work).default_if(setting == "f32")
    });
    // As above: the way in f64 is only rounded.
    let floor = 2.0 * of(YUV[3].2, &inner);
    bench.scene("BT.601 YUV to sRGB code", "CIEDE2000", floor, ways.into());
    let tried = YUV.map(|(method, setting, f)| ExtremeResult {
        default: setting == "f32",
        ..ExtremeResult::rival(method, setting, of(f, &outer))
    });
    bench.extreme("YUV codes outside the colour cube, clamped", "CIEDE2000", tried.into());
    let other = worst(
        inner.iter().step_by(3).map(|(c, exact)| coded_apart(yuv_exact(BT709, *c).map(|v| v as f32), *exact)),
    );
    let full = worst(inner.iter().step_by(3).map(|(c, exact)| {
        // JFIF's full range: 0 to 255 instead of 16 to 235 and 16 to 240.
        let [y, u, v] = c.map(f64::from);
        let (y, u, v) = (y / 255.0, (u - 128.0) / 255.0, (v - 128.0) / 255.0);
        let rgb = [y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u];
        coded_apart(rgb.map(|v| v as f32), *exact)
    }));
    let setting = "any arithmetic";
    bench.extreme(
        "BT.709 video read as BT.601",
        "CIEDE2000",
        vec![
            ExtremeResult::rival("wrong matrix", setting, other)
                .note("what a camera costs that does not say its matrix"),
        ],
    );
    bench.extreme(
        "limited range read as full",
        "CIEDE2000",
        vec![
            ExtremeResult::rival("wrong range", setting, full)
                .note("what a camera costs that does not say its range"),
        ],
    );
}

/// Measures the scenes and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    let colours = colours();
    let used: Vec<f32> = (0..1024).map(|i| even(i) as f32).collect();
    codes_to_light(bench, &colours, &used);
    light_to_codes(bench, &colours, &used);
    camera_codes(bench);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_colour_difference_is_that_of_sharma() {
        let rows = crate::parts::table(include_str!("../../data/ciede2000_sharma.csv"));
        assert_eq!(rows.len(), 34);
        for r in rows {
            let (a, b) = (Lab::<D65, f64>::new(r[0], r[1], r[2]), Lab::new(r[3], r[4], r[5]));
            assert!((a.difference(b) - r[6]).abs() < 1e-4, "{r:?}: {}", a.difference(b));
        }
    }

    #[test]
    fn white_black_and_the_primaries_are_where_they_should_be() {
        assert_eq!(yuv_exact(BT601, [16, 128, 128]), [0.0; 3]);
        assert!(yuv_exact(BT709, [235, 128, 128]).iter().all(|c| (c - 1.0).abs() < 1e-12));
        assert!((to_linear(to_code(0.2)) - 0.2).abs() < 1e-15 && to_linear(1.0) == 1.0);
    }
}
