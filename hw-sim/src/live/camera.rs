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
/// Steps from pixel to pixel of the panorama: two weights of 4 bits and a code of 8 fill 16 bits.
const STEPS: u64 = 16;
/// Codes of the panorama with their parts that are kept, as a table's index.
const FINE: usize = 256 * 16;
/// Steps of the lens's fall-off, from none to all.
const SHADES: usize = 256;
/// Values of the noise table; 10 bits of a random number choose one.
const NORMAL: usize = 1024;

/// Cuts pictures.
pub struct CutCamera {
    width: usize,
    height: usize,
    /// Rays of the mesh's nodes in the camera's axes, row by row.
    rays: Vec<DVec3>,
    nodes: [usize; 2],
    /// Step of the fall-off of each cell.
    shades: Vec<u8>,
    /// Code times 256 under each step of fall-off, by code of the panorama.
    developed: Vec<u16>,
    /// Deviation of the noise by code, codes times 256.
    deviation: [i32; 256],
    /// Standard normal numbers times 256.
    normal: Vec<i16>,
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
        Self {
            width,
            height,
            rays: (0..nodes[0] * nodes[1]).map(|i| lens.unproject(node(i))).collect(),
            nodes,
            shades: (0..cells[0] * cells[1]).map(shade).collect(),
            developed: (0..SHADES * FINE)
                .map(|i| {
                    let dimmed = light[i % FINE] * (i / FINE) as f32 / (SHADES - 1) as f32;
                    (255.0 * 256.0 * transfer(dimmed)).round() as u16
                })
                .collect(),
            deviation: std::array::from_fn(|code| {
                let light = light[code * FINE / 256];
                let deviation = (read + shot * light).sqrt();
                // The curve's slope over that deviation, which is finite where it begins.
                let slope = (transfer(light + deviation) - transfer(light)) / deviation.max(1e-9);
                (255.0 * 256.0 * slope * deviation).round() as i32
            }),
            normal: normal_table(NORMAL).into_iter().map(|n| (256.0 * n).round() as i16).collect(),
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
        // Half a step more, since weights are cut off and not rounded.
        let half = Vec2::splat(0.5 / STEPS as f32);
        let last = Vec2::new(view.columns as f32 - 1.01, view.rows as f32 - 1.01);
        let mut edge = vec![Vec2::ZERO; self.nodes[0]];
        for (y, row) in rgb.chunks_exact_mut(3 * self.width).enumerate() {
            let mut random = Pcg32::new(mix(self.seed ^ u64::from(frame)), y as u64);
            let (line, share) = (y / MESH, (y % MESH) as f32 / MESH as f32 + 0.5 / MESH as f32);
            let upper = &self.places[line * self.nodes[0]..(line + 1) * self.nodes[0]];
            let lower = &self.places[(line + 1) * self.nodes[0]..(line + 2) * self.nodes[0]];
            for ((at, a), b) in edge.iter_mut().zip(upper).zip(lower) {
                *at = a.lerp(*b, share) + half;
            }
            let shades = &self.shades[line * (self.nodes[0] - 1)..];
            for ((pixels, ends), shade) in row.chunks_mut(3 * MESH).zip(edge.windows(2)).zip(shades) {
                let step = (ends[1] - ends[0]) / MESH as f32;
                let mut place = ends[0] + 0.5 * step;
                let developed = &self.developed[usize::from(*shade) * FINE..][..FINE];
                for pixel in pixels.chunks_exact_mut(3) {
                    let codes = bilinear(view, place.clamp(Vec2::ZERO, last));
                    self.develop(codes, developed, random.next_u32(), pixel);
                    place += step;
                }
            }
        }
        if let Some(sight) = &self.sight {
            sight.draw(rgb);
        }
    }

    /// Adds fall-off and noise.
    #[inline(always)]
    fn develop(&self, codes: u64, developed: &[u16], random: u32, pixel: &mut [u8]) {
        for (c, value) in pixel.iter_mut().enumerate() {
            let clean = i32::from(developed[(codes >> (16 * c + 4)) as usize & (FINE - 1)]);
            let normal = i32::from(self.normal[(random >> (10 * c + 1)) as usize & (NORMAL - 1)]);
            let noise = (self.deviation[(clean >> 8) as usize & 255] * normal) >> 8;
            *value = ((clean + noise + 128) >> 8).clamp(0, 255) as u8;
        }
    }
}

/// Codes between four pixels: red, green and blue in the lowest three groups of 16 bits, times 256.
#[inline(always)]
fn bilinear(view: &PanoramaView<'_>, place: Vec2) -> u64 {
    let steps = (place * STEPS as f32).as_uvec2();
    let (column, row) = ((steps.x / STEPS as u32) as usize, (steps.y / STEPS as u32) as usize);
    let (x, y) = (u64::from(steps.x) % STEPS, u64::from(steps.y) % STEPS);
    let at = row * view.columns + column;
    let (Some(upper), Some(lower)) =
        (view.pixels.get(at..at + 2), view.pixels.get(at + view.columns..at + view.columns + 2))
    else {
        return 0;
    };
    let across = |pair: &[[u8; 4]]| spread(pair[0]) * (STEPS - x) + spread(pair[1]) * x;
    across(upper) * (STEPS - y) + across(lower) * y
}

/// Four bytes in groups of 16 bits.
#[inline(always)]
fn spread(pixel: [u8; 4]) -> u64 {
    let all = u64::from(u32::from_le_bytes(pixel));
    let pairs = (all | all << 16) & 0x0000_ffff_0000_ffff;
    (pairs | pairs << 8) & 0x00ff_00ff_00ff_00ff
}

/// Light of each sixteenth of a code, by bisection of the transfer curve.
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
