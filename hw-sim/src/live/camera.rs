//! A camera's picture cut from a panorama: turned, row by row where the shutter rolls, bent by the lens, with the sensor's noise.

use glam::{DQuat, DVec2, DVec3, Vec2};
use rand_pcg::{Pcg32, rand_core::Rng};

use super::sight::Sight;
use crate::{
    make::{
        Recipe,
        camera::{LIGHT_MAX, fall_off, normal_table, transfer},
    },
    ocean::random::mix,
    panorama::PanoramaView,
};

/// Pixels from node to node of the mesh that directions are computed on; between, they are linear. At 8 the worst error of a lens of 60
/// degrees is .005 px. The lens's fall-off is one of [`SHADES`] within a cell.
const MESH: usize = 8;
/// Bits of the fraction in a place in the panorama, in fixed point; a panorama's 8192 columns leave two bits for the sign.
const FRACTION: u32 = 16;
/// Of them, the bits that weights have: two weights of 4 bits and a code of 8 fill 16 bits.
const WEIGHT: u32 = 4;
/// Codes of the panorama with their parts that are kept, as a table's index: a quarter is less than what noise spreads them by, and a table for
/// each step of the fall-off is then small enough to stay close to the processor.
const FINE: usize = 256 << FINE_BITS;
const FINE_BITS: u32 = 2;
/// Steps of the lens's fall-off, from none to all.
const SHADES: usize = 256;
/// Values of the noise: each row of a picture takes a stretch of them, from a place of its own.
const NORMALS: usize = 1 << 18;
/// Different values among them.
const NORMAL: usize = 1024;
/// Parts of a code in which pixels are developed, and of a standard deviation in which noise is kept: a deviation in 256ths of a code times
/// such a number is noise in 16ths of a code, 16 bits up, which processors multiply eight at a time.
const CODE_BITS: u32 = 4;
const CODE_PARTS: f32 = (1 << CODE_BITS) as f32;
const DEVIATION_PARTS: f32 = 256.0;
const NORMAL_PARTS: f32 = 4096.0;

/// A developed pixel's colour, in [`CODE_PARTS`], and the deviation of its noise, in [`DEVIATION_PARTS`]. Both together are read at once.
#[derive(Clone, Copy)]
struct Developed {
    code: i16,
    deviation: i16,
}

/// A place in the panorama in fixed point, pixels: column and row.
type Place = [i32; 2];

/// Cuts pictures.
pub struct CutCamera {
    width: usize,
    height: usize,
    /// Rays of the mesh's nodes in the camera's axes, row by row.
    rays: Vec<DVec3>,
    nodes: [usize; 2],
    /// Step of the fall-off of each cell.
    shades: Vec<u8>,
    /// Colours and noise by step of fall-off and, within it, by code of the panorama.
    developed: Vec<Developed>,
    /// Standard normal numbers in [`NORMAL_PARTS`].
    normals: Vec<i16>,
    row_s: f64,
    seed: u64,
    /// Places of the nodes in the panorama, pixels.
    places: Vec<Vec2>,
    sight: Option<Sight>,
}

impl CutCamera {
    /// The camera of a recipe.
    pub fn new(recipe: &Recipe) -> Self {
        let lens = recipe.lens();
        let (width, height) = (lens.width as usize, lens.height as usize);
        let cells = [width.div_ceil(MESH), height.div_ceil(MESH)];
        let nodes = cells.map(|n| n + 1);
        let node = |i: usize| DVec2::new((i % nodes[0] * MESH) as f64, (i / nodes[0] * MESH) as f64);
        let shade = |i: usize| {
            let middle = DVec2::new((i % cells[0]) as f64 + 0.5, (i / cells[0]) as f64 + 0.5) * MESH as f64;
            let fall_off = fall_off(recipe.camera.vignetting, lens.unproject(middle));
            (fall_off * (SHADES - 1) as f64).round() as u8
        };
        let light = inverse_transfer();
        let (read, shot) = (recipe.camera.read_noise as f32, recipe.camera.shot_noise as f32);
        let deviation: [i16; 256] = std::array::from_fn(|code| {
            let light = light[code * FINE / 256];
            let deviation = (read + shot * light).sqrt();
            // The curve's slope over that deviation, which is finite where it begins.
            let slope = (transfer(light + deviation) - transfer(light)) / deviation.max(1e-9);
            (255.0 * DEVIATION_PARTS * slope * deviation).round() as i16
        });
        let developed = |i: usize| {
            let dimmed = light[i % FINE] * (i / FINE) as f32 / (SHADES - 1) as f32;
            let code = (255.0 * CODE_PARTS * transfer(dimmed)).round() as i16;
            Developed { code, deviation: deviation[usize::from(code as u16 >> CODE_BITS).min(255)] }
        };
        Self {
            width,
            height,
            rays: (0..nodes[0] * nodes[1]).map(|i| lens.unproject(node(i))).collect(),
            nodes,
            shades: (0..cells[0] * cells[1]).map(shade).collect(),
            developed: (0..SHADES * FINE).map(developed).collect(),
            normals: normals(mix(recipe.seed)),
            row_s: recipe.camera.readout_ns as f64 * 1e-9 / f64::from(lens.height),
            seed: mix(recipe.seed),
            places: Vec::new(),
            sight: None,
        }
    }

    /// The same with barrel and front sight of its gun in the picture.
    pub fn with_sight(mut self, recipe: &Recipe) -> Self {
        self.sight = Some(Sight::new(&recipe.lens()));
        self
    }

    /// Width and height of the pictures.
    pub const fn size(&self) -> (u32, u32) {
        (self.width as u32, self.height as u32)
    }

    /// Bytes of a picture.
    pub const fn bytes(&self) -> usize {
        3 * self.width * self.height
    }

    /// Times at which the mesh's rows are exposed, seconds after the mid-exposure.
    pub fn rows_s(&self) -> impl Iterator<Item = f64> + use<> {
        let (middle, row_s) = (self.height as f64 / 2.0, self.row_s);
        (0..self.nodes[1]).map(move |row| ((row * MESH) as f64 - middle) * row_s)
    }

    /// Turns the mesh; `turned` is how the camera is turned as each of its rows is exposed. Gives the azimuths between which the panorama is
    /// needed, radians.
    pub fn aim(&mut self, view: &PanoramaView<'_>, turned: impl IntoIterator<Item = DQuat>) -> [f64; 2] {
        self.places.clear();
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for (rays, world_from_camera) in self.rays.chunks_exact(self.nodes[0]).zip(turned) {
            for ray in rays {
                let d = world_from_camera * *ray;
                let azimuth = d.x.atan2(d.y);
                (least, most) = (least.min(azimuth), most.max(azimuth));
                let tangent = d.z / d.x.hypot(d.y).max(1e-6);
                self.places.push(Vec2::new(
                    (azimuth * f64::from(view.focal)) as f32 + view.centre - 0.5,
                    view.level_row - (tangent * f64::from(view.focal)) as f32 - 0.5,
                ));
            }
        }
        [least, most]
    }

    /// Cuts what [`Self::aim`] aimed at out of `view` into `rgb`, three bytes a pixel. `frame` chooses the noise.
    pub fn cut(&self, view: &PanoramaView<'_>, frame: u32, rgb: &mut [u8]) {
        let mut random = Pcg32::new(mix(self.seed ^ u64::from(frame)), 0);
        let mut edge = vec![[0; 2]; self.nodes[0]];
        let mut developed = vec![Developed { code: 0, deviation: 0 }; 3 * self.width];
        for (y, row) in rgb.chunks_exact_mut(3 * self.width).enumerate() {
            self.edge(view, y, &mut edge);
            let shades = &self.shades[y / MESH * (self.nodes[0] - 1)..];
            for ((pixels, ends), shade) in developed.chunks_mut(3 * MESH).zip(edge.windows(2)).zip(shades) {
                develop(view, ends[0], ends[1], &self.developed[usize::from(*shade) * FINE..], pixels);
            }
            let from = random.next_u32() as usize % (NORMALS - 3 * self.width);
            for ((value, pixel), normal) in row.iter_mut().zip(&developed).zip(&self.normals[from..]) {
                // Nothing of this overflows; where that is checked, no two are worked out at once.
                let noise = (i32::from(pixel.deviation).wrapping_mul(i32::from(*normal)) >> 16) as i16;
                let parts = pixel.code.wrapping_add(noise).wrapping_add(1 << (CODE_BITS - 1));
                *value = (parts >> CODE_BITS).clamp(0, 255) as u8;
            }
        }
    }

    /// Draws what is seen of the gun, recoiled by a factor, over a picture that was cut.
    pub(super) fn draw_sight(&self, recoil: f64, rgb: &mut [u8]) {
        if let Some(sight) = &self.sight {
            sight.draw(recoil, rgb);
        }
    }

    /// Places in the panorama at which a row of pixels meets the edges of the mesh's cells.
    fn edge(&self, view: &PanoramaView<'_>, y: usize, edge: &mut [Place]) {
        // Half a step more, since weights are cut off and not rounded.
        let half = Vec2::splat(0.5 / (1 << WEIGHT) as f32);
        // A pixel between two that are in the panorama is in it, too.
        let last = |pixels: usize| (((pixels as i32 - 1) << FRACTION) - 1).max(0);
        let (last_column, last_row) = (last(view.columns), last(view.rows));
        let (line, share) = (y / MESH, (y % MESH) as f32 / MESH as f32 + 0.5 / MESH as f32);
        let upper = &self.places[line * self.nodes[0]..(line + 1) * self.nodes[0]];
        let lower = &self.places[(line + 1) * self.nodes[0]..(line + 2) * self.nodes[0]];
        for ((at, a), b) in edge.iter_mut().zip(upper).zip(lower) {
            let place = (a.lerp(*b, share) + half) * (1 << FRACTION) as f32;
            *at = [(place.x as i32).clamp(0, last_column), (place.y as i32).clamp(0, last_row)];
        }
    }
}

/// Develops a cell's row of pixels between two places of the panorama. `developed` begins with the cell's fall-off.
#[inline(always)]
fn develop(
    view: &PanoramaView<'_>,
    from: Place,
    to: Place,
    developed: &[Developed],
    pixels: &mut [Developed],
) {
    let Some((developed, _)) = developed.split_first_chunk::<FINE>() else { return };
    let step = [(to[0] - from[0]) / MESH as i32, (to[1] - from[1]) / MESH as i32];
    let mut place = [from[0] + step[0] / 2, from[1] + step[1] / 2];
    for pixel in pixels.chunks_exact_mut(3) {
        for (value, code) in pixel.iter_mut().zip(bilinear(view, place)) {
            *value = developed[(code >> (2 * WEIGHT - FINE_BITS)) as usize % FINE];
        }
        place = [place[0].wrapping_add(step[0]), place[1].wrapping_add(step[1])];
    }
}

/// Codes between four pixels, times 256. Red and blue are weighted side by side in the halves of a word, and both columns of the pair above
/// and below in the words of another.
#[inline(always)]
fn bilinear(view: &PanoramaView<'_>, place: Place) -> [u64; 3] {
    const EVEN: u64 = 0x00ff_00ff_00ff_00ff;
    const WHOLE: u64 = 1 << WEIGHT;
    let weight = |at: i32| (at >> (FRACTION - WEIGHT)) as u64 % WHOLE;
    let (x, y) = (weight(place[0]), weight(place[1]));
    let at = ((place[1] >> FRACTION) as usize)
        .wrapping_mul(view.columns)
        .wrapping_add((place[0] >> FRACTION) as usize);
    let (upper, lower) = (pair(view, at), pair(view, at.wrapping_add(view.columns)));
    // 16 bits hold each; where overflow is looked for, this takes twice the time.
    let between = |a: u64, b: u64, part: u64| {
        a.wrapping_mul(WHOLE.wrapping_sub(part)).wrapping_add(b.wrapping_mul(part))
    };
    let down = |upper: u64, lower: u64| between(upper & EVEN, lower & EVEN, y);
    let across = |pair: u64| between(pair & 0xffff_ffff, pair >> 32, x);
    let (red_blue, green) = (across(down(upper, lower)), across(down(upper >> 8, lower >> 8)));
    [red_blue & 0xffff, green & 0xffff, red_blue >> 16]
}

/// Two neighbours of a row; black outside.
#[inline(always)]
fn pair(view: &PanoramaView<'_>, at: usize) -> u64 {
    let Some([left, right]) = view.pixels.get(at..).and_then(|pixels| pixels.first_chunk()) else { return 0 };
    u64::from(u32::from_le_bytes(*left)) | u64::from(u32::from_le_bytes(*right)) << 32
}

/// Standard normal numbers in a random order.
fn normals(seed: u64) -> Vec<i16> {
    let table = normal_table(NORMAL);
    let mut random = Pcg32::new(seed, 1);
    (0..NORMALS).map(|_| (NORMAL_PARTS * table[random.next_u32() as usize % NORMAL]).round() as i16).collect()
}

/// Light of each quarter of a code, by bisection of the transfer curve.
fn inverse_transfer() -> Vec<f32> {
    (0..FINE)
        .map(|i| {
            let code = i as f32 * 256.0 / (255 * FINE) as f32;
            let (mut dark, mut bright) = (0.0, LIGHT_MAX);
            for _ in 0..40 {
                let middle = 0.5 * (dark + bright);
                if transfer(middle) < code {
                    dark = middle;
                } else {
                    bright = middle;
                }
            }
            0.5 * (dark + bright)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use bowwave_core::geometry::{Distortion, look};

    use super::*;

    #[test]
    fn codes_and_light_are_each_others_inverse() {
        let light = inverse_transfer();
        for code in 1..=253 {
            let back = 255.0 * transfer(light[code * FINE / 256]);
            assert!((back - code as f32).abs() < 0.02, "{code} {back}");
        }
    }

    #[test]
    fn the_noise_of_an_even_sky_has_the_sensors_deviation_and_no_bias() {
        let (mut recipe, grey) = (Recipe { width: 320, height: 180, ..Recipe::default() }, 120);
        recipe.camera.vignetting = 0.0;
        let quiet = {
            let mut quiet = recipe.clone();
            (quiet.camera.read_noise, quiet.camera.shot_noise) = (0.0, 0.0);
            quiet
        };
        let pixels = vec![[grey; 4]; 1024 * 800];
        let view = PanoramaView {
            pixels: &pixels,
            columns: 1024,
            rows: 800,
            focal: 400.0,
            centre: 512.0,
            level_row: 400.0,
        };
        let shoot = |recipe: &Recipe| {
            let mut camera = CutCamera::new(recipe);
            let turned = vec![look(0.0, 0.0, 0.0); camera.rows_s().count()];
            camera.aim(&view, turned);
            let mut pictures = [vec![0; camera.bytes()], vec![0; camera.bytes()]];
            for (frame, picture) in pictures.iter_mut().enumerate() {
                camera.cut(&view, frame as u32, picture);
            }
            pictures
        };
        let ([noisy, next], [clean, same]) = (shoot(&recipe), shoot(&quiet));
        assert_eq!(clean, same);
        assert!(clean.iter().all(|code| *code == grey));
        let mean = |f: &dyn Fn(usize) -> f64| (0..clean.len()).map(f).sum::<f64>() / clean.len() as f64;
        let off = |picture: &[u8], i: usize| f64::from(picture[i]) - f64::from(grey);
        assert!(mean(&|i| off(&noisy, i)).abs() < 0.05, "{}", mean(&|i| off(&noisy, i)));
        let code = |light: f64| 255.0 * f64::from(transfer(light as f32));
        let light = f64::from(inverse_transfer()[usize::from(grey) * FINE / 256]);
        let deviation = (recipe.camera.read_noise + recipe.camera.shot_noise * light).sqrt();
        let expected = code(light + deviation) - code(light);
        // Rounding to whole codes adds a twelfth to the variance.
        let found = mean(&|i| off(&noisy, i).powi(2)).sqrt();
        assert!((found / expected.hypot((1.0_f64 / 12.0).sqrt()) - 1.0).abs() < 0.03, "{found} {expected}");
        let common = mean(&|i| off(&noisy, i) * off(&next, i)) / (found * found);
        assert!(common.abs() < 0.02, "{common}");
    }

    /// A panorama whose red has waves over azimuth and whose green has waves over the tangent of the elevation.
    fn waves() -> Vec<[u8; 4]> {
        let wave = |angle: f64| (128.0 + 100.0 * (40.0 * angle).sin()).round() as u8;
        let place = |i: usize| ((i % 2048) as f64 + 0.5 - 1024.0, 500.0 - ((i / 2048) as f64 + 0.5));
        (0..2048 * 1000)
            .map(|i| {
                let (column, row) = place(i);
                [wave(column / 500.0), wave(row / 500.0), 0, 0]
            })
            .collect()
    }

    #[test]
    fn a_cut_picture_shows_each_direction_where_the_lens_has_it() {
        let pixels = waves();
        let view = PanoramaView {
            pixels: &pixels,
            columns: 2048,
            rows: 1000,
            focal: 500.0,
            centre: 1024.0,
            level_row: 500.0,
        };
        for (readout_ns, distortion) in [
            (0, Distortion::None),
            (20_000_000, Distortion::None),
            (0, Distortion::fisheye([0.02, -0.01, 0.003, -0.001])),
        ] {
            let mut recipe = Recipe { width: 640, height: 360, ..Recipe::default() };
            (recipe.camera.read_noise, recipe.camera.shot_noise, recipe.camera.vignetting) = (0.0, 0.0, 0.0);
            (recipe.camera.readout_ns, recipe.camera.distortion) = (readout_ns, distortion);
            let mut camera = CutCamera::new(&recipe);
            // Turned, rolled, and turning on at 1 rad/s.
            let at = |s: f64| look(0.7 + s, -0.12, 0.15);
            let turned: Vec<DQuat> = camera.rows_s().map(at).collect();
            let [left, right] = camera.aim(&view, turned);
            assert!(left < 0.3 && right > 1.1);
            let mut rgb = vec![0; camera.bytes()];
            camera.cut(&view, 0, &mut rgb);
            let lens = recipe.lens();
            let row_s = readout_ns as f64 * 1e-9 / 360.0;
            let (mut error, mut steepness) = ([0.0; 2], [0.0; 2]);
            for i in 0..640 * 360 {
                let (x, y) = ((i % 640) as f64 + 0.5, (i / 640) as f64 + 0.5);
                let d = at((y - 180.0) * row_s) * lens.unproject(DVec2::new(x, y));
                let angles = [d.x.atan2(d.y), d.z / d.x.hypot(d.y)];
                for (c, angle) in angles.into_iter().enumerate() {
                    let slope = 100.0 * 40.0 * (40.0 * angle).cos() / 500.0;
                    let off = f64::from(rgb[3 * i + c]) - (128.0 + 100.0 * (40.0 * angle).sin());
                    error[c] += off * slope;
                    steepness[c] += slope * slope;
                }
            }
            for c in 0..2 {
                let shift_px = error[c] / steepness[c];
                assert!(shift_px.abs() < 0.02, "{shift_px} px of the panorama, {readout_ns} {distortion:?}");
            }
        }
    }
}
