//! The camera's noise by brightness, from small patches of the picture by an operator that answers to no slope: the second difference of the second
//! difference (Immerkaer 1996, "Fast noise variance estimation", CVIU 64, 300), between neighbours and between pixels three apart. What little is left in the
//! evenest patches is noise. Where coding has smoothed it, neighbours say too little, and those farther apart are asked. It grows with light as that of Foi, Trimeche,
//! Katkovnik & Egiazarian 2008 ("Practical Poissonian-Gaussian noise modeling and fitting for single-image raw-data", IEEE Trans. Image Process. 17,
//! 1737): variance = read + shot x light. Colours go together where the camera or its coding mixes them.

use glam::{DVec2, Vec3};

use crate::{
    colour::{LUMINANCE, linear_to_srgb, srgb_to_linear},
    event::Picture,
    time::Time,
};

/// Patches along the picture's width and height, and pixels along a side of each.
const PATCHES: (u32, u32) = (16, 11);
const SIDE: usize = 12;
const PIXELS: usize = SIDE * SIDE;

/// Groups of patches that are about as bright, and the share of each that is taken for even.
const GROUPS: usize = 8;
const EVEN: f32 = 0.3;
/// Steps from pixel to pixel of the operator.
const STEPS: [usize; 2] = [1, 3];
/// Mean of what the operator with these steps finds in the evenest patches of white noise, over its variance. They were chosen for showing little, and
/// show less noise than they have. From 4000 patches of random numbers.
const EVEN_MEAN: [f32; 2] = [0.737, 0.656];
/// Ratios of the variance that neighbours find to that of pixels farther apart: noise is smoothed below the first, and is not above the second.
const SMOOTHED: [f32; 2] = [0.35, 0.7];
/// Two pixels share their colour from this on.
const PAIRED: f32 = 0.5;
/// Variance of a code by its being a whole number, of 255: what is drawn gets that anyway.
const ROUNDED: f32 = 1.0 / (12.0 * 255.0 * 255.0);

/// Fewest patches that say something.
const PATCHES_MIN: usize = 4 * GROUPS;
/// Share of a patch's pixels that may be black or white: beyond these noise is cut off.
const CUT_OFF: f32 = 0.2;
/// A patch of whose pixels this share is the same as the next was not seen by a camera, or its noise was coded away.
const FLAT: f32 = 0.25;
/// No group's variance counts as less than this part of the middle one's: a few flat patches would outweigh all others.
const LEAST: f32 = 0.05;
/// Least time between two looks at the noise, seconds; and the time constant with which they are followed.
const LOOK_EVERY_S: f64 = 0.5;
const FOLLOW_S: f64 = 4.0;

/// Noise of so many codes, 0 to 255, is seen on a boat, and of so many no more.
const SEEN: [f32; 2] = [2.2, 1.8];
/// A boat's albedo, at which that is asked; and a light at which it is asked whatever sky and sun give: lamps may shine.
const ALBEDO: f32 = 0.2;
const LAMPLIT: f32 = 0.05;

/// The noise of one picture by brightness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraNoise {
    /// Variance of dark red, green and blue; squares of light, linear, in units of the video's white.
    pub read: Vec3,
    /// Its growth with light.
    pub shot: Vec3,
    /// Correlation of green with red, of green with blue, and of red with blue.
    pub together: Vec3,
    /// By how much the colour differs less within pairs of pixels than from pair to pair: 1 where two pixels share it.
    pub paired: f32,
}

impl CameraNoise {
    /// A picture without noise.
    const NONE: Self = Self { read: Vec3::ZERO, shot: Vec3::ZERO, together: Vec3::ZERO, paired: 0.0 };

    /// Standard deviation at a light, linear.
    pub fn deviation(&self, light: Vec3) -> Vec3 {
        let variance = self.read + self.shot * light.max(Vec3::ZERO);
        variance.map(|variance| variance.max(0.0).sqrt())
    }

    /// True where two pixels share the noise of their colour.
    pub fn is_paired(&self) -> bool {
        self.paired > PAIRED
    }

    /// Looks at the patches of a picture. No noise where nearly all of them are flat; `None` where too few are neither black nor white.
    pub fn of(picture: &Picture) -> Option<Self> {
        let mut patches = Vec::with_capacity((PATCHES.0 * PATCHES.1) as usize);
        let mut flat = 0;
        let side = SIDE as u32;
        if picture.width().min(picture.height()) < 4 * side {
            return None;
        }
        let (width, height) = (picture.width() - side, picture.height() - side);
        for row in 0..PATCHES.1 {
            for column in 0..PATCHES.0 {
                // Whole pairs of pixels: two may share their colour.
                let x = (width * (2 * column + 1) / (2 * PATCHES.0)) & !1;
                let y = (height * (2 * row + 1) / (2 * PATCHES.1)) & !1;
                match Patch::of(picture, x, y) {
                    Look::Seen(patch) => patches.push(patch),
                    Look::Flat => flat += 1,
                    Look::CutOff => {}
                }
            }
        }
        if patches.len() < PATCHES_MIN {
            return (patches.len() + flat >= PATCHES_MIN).then_some(Self::NONE);
        }
        Some(Self::of_patches(patches))
    }

    fn of_patches(mut patches: Vec<Patch>) -> Self {
        patches.sort_by(|a, b| a.mean.y.total_cmp(&b.mean.y));
        let each = patches.len().div_ceil(GROUPS);
        let [near, wide] = [0, 1].map(|step| {
            let even = |group: &mut [Patch]| {
                group.sort_by(|a, b| a.found[step].luma.total_cmp(&b.found[step].luma));
                let count = ((EVEN * group.len() as f32).round() as usize).max(1);
                Even::of(group.get(..count).unwrap_or(group), step)
            };
            patches.chunks_mut(each).map(even).collect::<Vec<_>>()
        });
        let [within, between] =
            near.iter().fold([0.0; 2], |sum, e| [sum[0] + e.colour[0], sum[1] + e.colour[1]]);
        let paired = (1.0 - within / between.max(1e-12)).clamp(0.0, 1.0);
        let near_share = near_share(&near, &wide) * if paired > PAIRED { Vec3::Y } else { Vec3::ONE };
        let even: Vec<Even> = near.iter().zip(&wide).map(|(n, w)| w.towards(n, near_share)).collect();
        let mut made = Self { paired, ..Self::NONE };
        for channel in 0..3 {
            let points = even.iter().map(|e| (e.mean[channel], e.noise[channel]));
            (made.read[channel], made.shot[channel]) = fit(points);
        }
        // Each group that shows noise counts alike, whatever its brightness: parts of its own variance.
        let shown = even.iter().filter(|e| e.found.variance.min_element() > 2.0 * ROUNDED);
        let parts = |e: &Even| {
            let [r, g, b] = (e.found.variance - ROUNDED).map(f32::sqrt).to_array();
            e.found.product / Vec3::new(g * r, g * b, r * b)
        };
        let (sum, count) = shown.fold((Vec3::ZERO, 0.0), |(sum, count), e| (sum + parts(e), count + 1.0));
        made.together = (sum / f32::max(count, 1.0)).clamp(-Vec3::ONE, Vec3::ONE);
        made
    }

    fn towards(&self, other: &Self, share: f32) -> Self {
        Self {
            read: self.read.lerp(other.read, share),
            shot: self.shot.lerp(other.shot, share),
            together: self.together.lerp(other.together, share),
            paired: self.paired + (other.paired - self.paired) * share,
        }
    }

    /// Deviation of the green code, 0 to 255, of a matt grey boat under sky and sun or a lamp, whichever shows more.
    fn codes_on_boat(&self, on_level: Vec3) -> f32 {
        let codes = |light: f32| {
            let light = light.clamp(0.0, 1.0);
            255.0 * self.deviation(Vec3::splat(light)).y / light_a_code(linear_to_srgb(light))
        };
        codes(ALBEDO * on_level.dot(LUMINANCE)).max(codes(LAMPLIT))
    }
}

/// The noise of the newest picture, where it is seen on boats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeenNoise {
    /// The noise.
    pub noise: CameraNoise,
    /// The picture's number: each has other noise.
    pub picture: u32,
    /// The picture's width, pixels.
    pub width: u32,
}

/// Follows the noise of the pictures.
#[derive(Clone, Debug, Default)]
pub struct NoiseMeter {
    found: Option<(Time, CameraNoise)>,
    looked: Option<Time>,
    is_seen: bool,
    pictures: u32,
    width: u32,
}

impl NoiseMeter {
    /// Takes in a picture in which `on_level` is the radiance of a white matt surface that lies level.
    pub fn observe(&mut self, time: Time, picture: &Picture, on_level: Vec3) {
        (self.pictures, self.width) = (self.pictures.wrapping_add(1), picture.width());
        if self.looked.is_some_and(|looked| (0.0..LOOK_EVERY_S).contains(&time.secs_since(looked))) {
            return;
        }
        self.looked = Some(time);
        let Some(seen) = CameraNoise::of(picture) else { return };
        let noise = match self.found {
            None => seen,
            Some((since, old)) => old.towards(&seen, time.smoothing_since(since, FOLLOW_S)),
        };
        self.found = Some((time, noise));
        self.is_seen = noise.codes_on_boat(on_level) > SEEN[usize::from(self.is_seen)];
    }

    /// The noise, where it is seen on boats.
    pub fn seen(&self) -> Option<SeenNoise> {
        let (_, noise) = self.found.filter(|_| self.is_seen)?;
        Some(SeenNoise { noise, picture: self.pictures, width: self.width })
    }
}

/// Variances of codes that the operator finds in a patch.
#[derive(Clone, Copy, Debug, Default)]
struct Found {
    /// Of luma, by which patches are taken for even or not.
    luma: f32,
    variance: Vec3,
    /// Mean products of green and red, green and blue, red and blue.
    product: Vec3,
}

impl Found {
    fn plus(&self, other: &Self, share: f32) -> Self {
        Self {
            luma: self.luma + other.luma * share,
            variance: self.variance + other.variance * share,
            product: self.product + other.product * share,
        }
    }

    /// Applies the operator with pixels `step` apart to a patch.
    fn of(codes: &[Vec3; PIXELS], step: usize) -> Self {
        let wide = SIDE - 2 * step;
        let mut across = [Vec3::ZERO; PIXELS];
        for y in 0..SIDE {
            for x in 0..wide {
                let at = y * SIDE + x;
                across[at] = codes[at] - 2.0 * codes[at + step] + codes[at + 2 * step];
            }
        }
        let mut found = Self::default();
        for y in 0..wide {
            for x in 0..wide {
                let at = y * SIDE + x;
                let whole = across[at] - 2.0 * across[at + step * SIDE] + across[at + 2 * step * SIDE];
                let Vec3 { x: r, y: g, z: b } = whole;
                let luma = whole.dot(LUMINANCE);
                found.luma += luma * luma;
                found.variance += Vec3::new(r * r, g * g, b * b);
                found.product += Vec3::new(g * r, g * b, r * b);
            }
        }
        // The squares of the operator's numbers have the sum 36.
        Self::default().plus(&found, 1.0 / (36 * wide * wide) as f32)
    }
}

/// A look at a patch.
enum Look {
    Seen(Patch),
    /// Machines have made it so.
    Flat,
    /// Much of it is black or white.
    CutOff,
}

/// One patch of a picture.
#[derive(Clone, Copy, Debug)]
struct Patch {
    /// Its mean code.
    mean: Vec3,
    /// Findings of the operator, by its steps.
    found: [Found; 2],
    /// Squares of the step of blue less green from a pixel to the next: within a pair of pixels that may share it, and from pair to pair.
    colour: [f32; 2],
}

impl Patch {
    /// The patch whose upper left pixel is at `x` and `y`.
    fn of(picture: &Picture, x: u32, y: u32) -> Look {
        let mut codes = [Vec3::ZERO; PIXELS];
        for (i, code) in codes.iter_mut().enumerate() {
            *code = Vec3::from(picture.srgb_at(x + (i % SIDE) as u32, y + (i / SIDE) as u32));
        }
        let is_cut = |code: &&Vec3| code.min_element() <= 0.0 || code.max_element() >= 1.0;
        if codes.iter().filter(is_cut).count() as f32 > CUT_OFF * PIXELS as f32 {
            return Look::CutOff;
        }
        let same = codes.windows(2).filter(|pair| pair[0] == pair[1]).count();
        if same as f32 > FLAT * PIXELS as f32 {
            return Look::Flat;
        }
        let mean = codes.iter().sum::<Vec3>() / PIXELS as f32;
        let mut colour = [0.0; 2];
        for (i, pair) in codes.windows(2).enumerate().filter(|(i, _)| i % SIDE != SIDE - 1) {
            let [one, next] = [pair[0], pair[1]].map(|code| code.z - code.y);
            colour[i % 2] += (next - one) * (next - one);
        }
        // There is a pair more than steps between pairs in each row.
        colour[0] *= (SIDE / 2 - 1) as f32 / (SIDE / 2) as f32;
        Look::Seen(Self { mean, found: STEPS.map(|step| Found::of(&codes, step)), colour })
    }
}

/// The evenest patches of a brightness.
#[derive(Clone, Copy, Debug)]
struct Even {
    /// Their light, linear.
    mean: Vec3,
    /// The variance of their noise: light, linear.
    noise: Vec3,
    found: Found,
    /// As that of patches.
    colour: [f32; 2],
}

impl Even {
    fn of(some: &[Patch], step: usize) -> Self {
        let share = 1.0 / some.len().max(1) as f32;
        let mean = some.iter().map(|patch| patch.mean).sum::<Vec3>() * share;
        let sum = |all: Found, patch: &Patch| all.plus(&patch.found[step], share);
        let mut found = some.iter().fold(Found::default(), sum);
        // Chosen for little luma, they lack what goes with luma, of variances and of products alike.
        let Vec3 { x: gr, y: gb, z: rb } = found.product;
        let Vec3 { x: r, y: g, z: b } = found.variance;
        let with_luma = [Vec3::new(r, gr, rb), Vec3::new(gr, g, gb), Vec3::new(rb, gb, b)];
        let with_luma = Vec3::from(with_luma.map(|row| row.dot(LUMINANCE)));
        let lacking = (1.0 / EVEN_MEAN[step] - 1.0) * with_luma / found.luma.max(1e-12);
        found.variance += lacking * with_luma;
        found.product += Vec3::new(lacking.y * with_luma.x, lacking.y * with_luma.z, lacking.x * with_luma.z);
        // To first order a code's noise is the light's, by the slope of the curve that codes light.
        let slope = mean.map(light_a_code);
        let noise = slope * slope * (found.variance - ROUNDED).max(Vec3::ZERO);
        let colour = [0, 1].map(|i| some.iter().map(|patch| patch.colour[i]).sum::<f32>() * share);
        Self { mean: mean.map(srgb_to_linear), noise, found, colour }
    }

    /// Goes a share of the way to `other` in each channel; what channels have to do with each other as far as all go.
    fn towards(&self, other: &Self, share: Vec3) -> Self {
        let together = share.min_element();
        Self {
            mean: self.mean + (other.mean - self.mean) * share,
            noise: self.noise + (other.noise - self.noise) * share,
            found: Found::default().plus(&self.found, 1.0 - together).plus(&other.found, together),
            colour: self.colour,
        }
    }
}

/// As how far neighbours are to be believed, by channel: codings smooth colours more than luma. Waves too are smooth, but not in all groups.
fn near_share(near: &[Even], wide: &[Even]) -> Vec3 {
    let [low, high] = SMOOTHED;
    let mut share = Vec3::ZERO;
    for channel in 0..3 {
        let ratio = |(n, w): (&Even, &Even)| n.noise[channel] / w.noise[channel].max(1e-12);
        let mut ratios: Vec<f32> = near.iter().zip(wide).map(ratio).collect();
        ratios.sort_by(f32::total_cmp);
        let upper = ratios.get(ratios.len() * 3 / 4).copied().unwrap_or_default();
        share[channel] = ((upper - low) / (high - low)).clamp(0.0, 1.0);
    }
    share
}

/// Light, linear, that one sRGB code more stands for, both from 0 to 1: slope of the curve.
fn light_a_code(code: f32) -> f32 {
    const STEP: f32 = 1.0 / 512.0;
    (srgb_to_linear(code + STEP) - srgb_to_linear((code - STEP).max(0.0)))
        / (code + STEP - (code - STEP).max(0.0))
}

/// Read and shot noise, neither below nothing, that fit variances by light with least relative error.
fn fit(points: impl Iterator<Item = (f32, f32)> + Clone) -> (f32, f32) {
    let mut variances: Vec<f32> = points.clone().map(|(_, variance)| variance).collect();
    variances.sort_by(f32::total_cmp);
    let middle = variances.get(variances.len() / 2).copied().unwrap_or_default();
    let least = f64::from((LEAST * middle).max(1e-10));
    let weighed =
        || points.clone().map(|(light, variance)| (f64::from(light), f64::from(variance).max(least)));
    let (mut aa, mut ab, mut bb, mut a, mut b) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (light, variance) in weighed() {
        let row = DVec2::new(1.0, light) / variance;
        (aa, ab, bb) = (aa + row.x * row.x, ab + row.x * row.y, bb + row.y * row.y);
        (a, b) = (a + row.x, b + row.y);
    }
    let det = aa * bb - ab * ab;
    let (read, shot) =
        if det > 1e-9 * aa * bb { ((a * bb - b * ab) / det, (b * aa - a * ab) / det) } else { (a / aa, 0.0) };
    let (read, shot) = match (read < 0.0, shot < 0.0) {
        (false, false) => (read, shot),
        (true, _) => (0.0, b / bb.max(1e-30)),
        (_, true) => (a / aa, 0.0),
    };
    (read as f32, shot as f32)
}

#[cfg(test)]
mod tests {
    use rand_pcg::{
        Pcg32,
        rand_core::{Rng as _, SeedableRng as _},
    };

    use super::*;
    use crate::event::PixelFormat;

    /// Of variance 1 and mean 0, about normal.
    fn normal(random: &mut Pcg32) -> f32 {
        (0..12).map(|_| random.next_u32() as f32 / u32::MAX as f32).sum::<f32>() - 6.0
    }

    /// A picture that gets brighter from the left to the right and has waves of so many codes, with noise.
    fn picture(noise: &CameraNoise, waves: f32, mut one: impl FnMut(u32, u32) -> Vec3) -> Picture {
        let (width, height) = (320_u32, 240_u32);
        let mut bytes = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let wave = if y > height / 2 {
                    waves * (0.7 * x as f32).sin() * (0.4 * y as f32).sin()
                } else {
                    0.0
                };
                let code = 0.08 + 0.5 * x as f32 / width as f32 + wave / 255.0;
                let light = Vec3::new(0.7, 1.0, 1.2) * srgb_to_linear(code);
                let seen = light + noise.deviation(light) * one(x, y);
                bytes.extend(
                    seen.to_array().map(|v| (255.0 * linear_to_srgb(v.clamp(0.0, 1.0))).round() as u8),
                );
            }
        }
        Picture::new(PixelFormat::Rgb, width, height, bytes.into()).unwrap()
    }

    const NIGHT: CameraNoise = CameraNoise {
        read: Vec3::new(3e-5, 2e-5, 6e-5),
        shot: Vec3::new(4e-4, 3e-4, 5e-4),
        together: Vec3::ZERO,
        paired: 0.0,
    };

    /// Worst error of a deviation over lights that the picture has.
    fn worst(found: &CameraNoise, truth: &CameraNoise) -> f32 {
        let lights = [0.01, 0.03, 0.1, 0.2].map(Vec3::splat);
        let off = |light: Vec3| (found.deviation(light) / truth.deviation(light) - 1.0).abs().max_element();
        lights.into_iter().map(off).fold(0.0, f32::max)
    }

    #[test]
    fn noise_is_found_by_brightness_and_colour_though_half_the_picture_has_waves() {
        for (seed, waves) in [(1, 0.0), (2, 0.0), (3, 25.0)] {
            let mut random = Pcg32::seed_from_u64(seed);
            let seen = picture(&NIGHT, waves, |_, _| Vec3::from_array([(); 3].map(|()| normal(&mut random))));
            let found = CameraNoise::of(&seen).unwrap();
            let off = worst(&found, &NIGHT);
            assert!(
                off < if waves > 0.0 { 0.2 } else { 0.12 },
                "{waves} codes of waves: {off:.3} off, {found:?}"
            );
            assert!(found.together.abs().max_element() < 0.25 && found.paired < 0.3, "{found:?}");
        }
    }

    #[test]
    fn colours_that_go_together_and_in_pairs_are_told() {
        let mut random = Pcg32::seed_from_u64(4);
        let mut colour = Vec3::ZERO;
        let seen = picture(&NIGHT, 0.0, |x, _| {
            if x % 2 == 0 {
                colour = Vec3::new(normal(&mut random), 0.0, normal(&mut random));
            }
            // Green is luma's; red and blue go with it by 0.8.
            let green = normal(&mut random);
            Vec3::splat(green) * Vec3::new(0.8, 1.0, 0.8) + 0.6 * colour
        });
        let found = CameraNoise::of(&seen).unwrap();
        let expected = Vec3::new(0.8, 0.8, 0.64);
        assert!((found.together - expected).abs().max_element() < 0.1, "{found:?}");
        assert!(found.paired > 0.6, "{found:?}");
        assert!(worst(&found, &NIGHT) < 0.15, "{found:?}");
    }

    #[test]
    fn what_is_flat_or_cut_off_says_nothing() {
        let mut random = Pcg32::seed_from_u64(6);
        let seen = picture(&NIGHT, 0.0, |_, _| Vec3::from_array([(); 3].map(|()| normal(&mut random))));
        let row = 3 * seen.width() as usize;
        // Bars above and below, as of a film; white above, black below.
        for [above, below] in [[16, 16], [1, 90], [255, 0]] {
            let mut bytes = seen.bytes().to_vec();
            bytes[..40 * row].fill(above);
            bytes[200 * row..].fill(below);
            let barred = Picture::new(PixelFormat::Rgb, seen.width(), seen.height(), bytes.into()).unwrap();
            let off = worst(&CameraNoise::of(&barred).unwrap(), &NIGHT);
            // A third fewer patches, and some at the edge.
            assert!(off < 0.15, "{above}, {below}: {off}");
        }
    }

    #[test]
    fn noise_is_followed_and_shown_while_it_is_seen() {
        let mut random = Pcg32::seed_from_u64(5);
        let mut one = |_: u32, _: u32| Vec3::from_array([(); 3].map(|()| normal(&mut random)));
        let day = CameraNoise { read: Vec3::splat(2.5e-6), shot: Vec3::splat(3e-5), ..NIGHT };
        let (dark, bright) = (picture(&NIGHT, 0.0, &mut one), picture(&day, 0.0, &mut one));
        let mut meter = NoiseMeter::default();
        let on_level = Vec3::splat(0.4);
        let at = |s: f64| Time::from_ns(0).plus_secs(s);
        meter.observe(at(0.0), &bright, on_level);
        assert_eq!(meter.seen(), None);
        for i in 0..40 {
            meter.observe(at(1.0 + 0.5 * f64::from(i)), &dark, on_level);
        }
        let seen = meter.seen().unwrap();
        assert!(worst(&seen.noise, &NIGHT) < 0.15);
        // The next picture has other noise, whether it is looked at or not.
        meter.observe(at(20.6), &dark, on_level);
        assert_ne!(meter.seen().unwrap().picture, seen.picture);
        for i in 0..40 {
            meter.observe(at(30.0 + 0.5 * f64::from(i)), &bright, on_level);
        }
        assert_eq!(meter.seen(), None);
    }

    #[test]
    fn pictures_that_say_nothing_and_extreme_ones_stay_finite() {
        let small = Picture::new(PixelFormat::Rgb, 8, 8, vec![9; 192].into()).unwrap();
        assert_eq!(CameraNoise::of(&small), None);
        for (code, expected) in [(255, None), (0, None), (90, Some(CameraNoise::NONE))] {
            let even = Picture::new(PixelFormat::Rgb, 64, 64, vec![code; 64 * 64 * 3].into()).unwrap();
            assert_eq!(CameraNoise::of(&even), expected, "{code}");
        }
        for bytes in
            [vec![0; 64 * 64 * 3], (0..64 * 64 * 3).map(|i| if i % 2 == 0 { 0 } else { 255 }).collect()]
        {
            let found = CameraNoise::of(&Picture::new(PixelFormat::Rgb, 64, 64, bytes.into()).unwrap());
            let finite = |n: CameraNoise| {
                n.deviation(Vec3::ONE).is_finite()
                    && n.together.is_finite()
                    && n.paired.is_finite()
                    && n.read.min_element() >= 0.0
                    && n.shot.min_element() >= 0.0
            };
            assert!(found.is_none_or(finite), "{found:?}");
        }
    }
}
