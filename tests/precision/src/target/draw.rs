//! Pictures of a board with known truth: every pixel's rays are followed to the board by formulas of their own.

use bowwave_calibration::{
    simulated::Random,
    target::{MODULES, Target, is_white},
};
use glam::{DMat3, DQuat, DVec2, DVec3};

/// A lens as OpenCV defines them; pixels count from the edge of the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrueLens {
    /// Width and height, pixels.
    pub size: (usize, usize),
    /// fx, fy, cx, cy, then k1, k2, p1, p2 or the fisheye's k1 to k4.
    pub numbers: [f64; 8],
    /// Whether it is the fisheye.
    pub fisheye: bool,
}

impl TrueLens {
    /// A usual camera: 1280 x 720 pixels over 71 degrees, with barrel distortion.
    pub const PINHOLE: Self = Self {
        size: (1280, 720),
        numbers: [905.0, 902.0, 652.0, 349.0, -0.21, 0.06, 8e-4, -1.1e-3],
        fisheye: false,
    };
    /// A wide one: 180 degrees across.
    pub const FISHEYE: Self = Self {
        size: (1280, 720),
        numbers: [405.0, 403.0, 645.0, 355.0, -0.03, 0.008, -0.004, 0.0008],
        fisheye: true,
    };

    fn distort(&self, n: DVec2) -> DVec2 {
        let [.., a, b, c, d] = self.numbers;
        if self.fisheye {
            // `n` is the angle from the axis along the direction.
            let t2 = n.length_squared();
            return n * (1.0 + t2 * (a + t2 * (b + t2 * (c + t2 * d))));
        }
        let r2 = n.length_squared();
        let shift = DVec2::new(
            2.0 * c * n.x * n.y + d * (r2 + 2.0 * n.x * n.x),
            c * (r2 + 2.0 * n.y * n.y) + 2.0 * d * n.x * n.y,
        );
        n * (1.0 + r2 * (a + r2 * b)) + shift
    }

    /// Where a point of the camera's space falls; `None` behind a pinhole.
    pub fn project(&self, point: DVec3) -> Option<DVec2> {
        let across = point.truncate();
        let n = if self.fisheye {
            across.normalize_or_zero() * across.length().atan2(point.z)
        } else if point.z > 0.0 {
            across / point.z
        } else {
            return None;
        };
        let [fx, fy, cx, cy, ..] = self.numbers;
        Some(self.distort(n) * DVec2::new(fx, fy) + DVec2::new(cx, cy))
    }

    /// The direction that falls on a pixel, unit length.
    pub fn direction(&self, pixel: DVec2) -> DVec3 {
        let [fx, fy, cx, cy, ..] = self.numbers;
        let seen = (pixel - DVec2::new(cx, cy)) / DVec2::new(fx, fy);
        let mut n = seen;
        for _ in 0..200 {
            let step = seen - self.distort(n);
            n += step;
            if step.length_squared() < 1e-26 {
                break;
            }
        }
        if self.fisheye {
            let angle = n.length();
            return (n.normalize_or_zero() * angle.sin()).extend(angle.cos());
        }
        n.extend(1.0).normalize()
    }

    /// The directions of all pixels' centres, row by row.
    pub fn directions(&self) -> Vec<DVec3> {
        let (w, h) = self.size;
        (0..w * h).map(|i| self.direction(DVec2::new((i % w) as f64, (i / w) as f64) + 0.5)).collect()
    }
}

/// Where the board is, how it is lit and what the camera makes of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoardShot {
    /// From the board's axes (x right, y up, z towards the viewer) to the camera's.
    pub camera_from_board: DQuat,
    /// The middle of the board in the camera's space, metres.
    pub middle: DVec3,
    /// Codes of black and white.
    pub levels: [f64; 2],
    /// Standard deviation of the lens's blur, pixels.
    pub blur_px: f64,
    /// How far the picture moves during the exposure, pixels.
    pub smear_px: DVec2,
    /// Standard deviation of the noise, codes.
    pub noise: f64,
    /// How much brighter the picture's right and lower edges are than its left and upper ones, by the middle.
    pub shade: DVec2,
    /// A light's reflection: middle by the picture's size, radius by its width, codes.
    pub glare: Option<(DVec2, f64, f64)>,
    /// Seed of the noise.
    pub seed: u64,
}

impl BoardShot {
    /// A board seen from the front by a middling camera, `distance_m` away.
    pub fn frontal(distance_m: f64) -> Self {
        Self {
            // The board's y is up, the picture's is down.
            camera_from_board: DQuat::from_mat3(&DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z)),
            middle: DVec3::new(0.0, 0.0, distance_m),
            levels: [30.0, 210.0],
            blur_px: 0.7,
            smear_px: DVec2::ZERO,
            noise: 2.0,
            shade: DVec2::ZERO,
            glare: None,
            seed: 1,
        }
    }

    /// The board turned, in the camera's axes.
    #[must_use]
    pub fn turned(self, by: DQuat) -> Self {
        Self { camera_from_board: by * self.camera_from_board, ..self }
    }
}

/// A drawn picture and the truth about its corners.
#[derive(Clone, Debug)]
pub struct DrawnBoard {
    /// Width and height, pixels.
    pub size: (usize, usize),
    /// Codes, row by row.
    pub grey: Vec<u8>,
    /// Tag, corner of the tag and place, pixels, of all corners that fall into the picture.
    pub corners: Vec<(usize, usize, DVec2)>,
}

/// Colour of the board: 1 white, 0 black; beyond its edge a wall of middling grey.
fn albedo(target: &Target, at: DVec2) -> f64 {
    let (tag, gap) = (target.tag_m(), target.tag_m() * target.spacing());
    let end = target.size_m() - gap;
    let rim = 0.5 * tag;
    if at.cmplt(DVec2::splat(-gap - rim)).any() || at.cmpgt(end + rim).any() {
        return 0.55;
    }
    if at.cmplt(DVec2::splat(-gap)).any() || at.cmpgt(end).any() {
        return 1.0;
    }
    let cell = (at / (tag + gap)).floor();
    let within = at - cell * (tag + gap);
    match (within.x < tag, within.y < tag) {
        (true, true) if cell.min_element() >= 0.0 => {
            let id = cell.y as usize * target.columns() + cell.x as usize;
            let module = within / tag * MODULES as f64;
            let (row, column) = (MODULES - 1 - (module.y as usize).min(MODULES - 1), module.x as usize);
            f64::from(u8::from(is_white(id, row, column.min(MODULES - 1))))
        }
        (false, false) => 0.0,
        _ => 1.0,
    }
}

/// Draws what `lens` (its `directions` made once) sees.
pub fn draw(target: &Target, lens: &TrueLens, directions: &[DVec3], shot: &BoardShot) -> DrawnBoard {
    draw_by_rows(target, lens, directions, shot, &vec![(shot.camera_from_board, shot.middle); lens.size.1])
}

/// The same where the camera moves while it reads one row after the other: `rows` have the board's attitude and middle for each.
pub fn draw_by_rows(
    target: &Target,
    lens: &TrueLens,
    directions: &[DVec3],
    shot: &BoardShot,
    rows: &[(DQuat, DVec3)],
) -> DrawnBoard {
    let (w, h) = lens.size;
    let half = target.size_m() / 2.0 - target.tag_m() * target.spacing();
    let hit = |i: usize, direction: DVec3| -> Option<DVec2> {
        let (camera_from_board, middle) = rows.get(i / w)?;
        let board_from_camera = camera_from_board.inverse();
        let (eye, d) = (board_from_camera * -*middle, board_from_camera * direction);
        let t = -eye.z / d.z;
        (t > 0.0 && t.is_finite()).then(|| (eye + d * t).truncate() + half)
    };
    let hits: Vec<Option<DVec2>> = directions.iter().enumerate().map(|(i, d)| hit(i, *d)).collect();
    let at = |x: usize, y: usize| hits[y.min(h - 1) * w + x.min(w - 1)];
    let mut bright = vec![0.55; w * h];
    for y in 0..h {
        for x in 0..w {
            let (Some(c), Some(r), Some(b)) = (at(x, y), at(x + 1, y), at(x, y + 1)) else { continue };
            // At the far edges the neighbour before tells the slope.
            let right = if x + 1 < w { r - c } else { c - at(x - 1, y).unwrap_or(c) };
            let down = if y + 1 < h { b - c } else { c - at(x, y - 1).unwrap_or(c) };
            bright[y * w + x] = pixel(target, c, right, down);
        }
    }
    blur(&mut bright, w, h, shot.blur_px);
    smear(&mut bright, w, h, shot.smear_px);
    let mut random = Random::new(shot.seed);
    let grey = bright.iter().enumerate().map(|(i, v)| {
        let share = DVec2::new((i % w) as f64 / w as f64, (i / w) as f64 / h as f64);
        let mut code = shot.levels[0] + (shot.levels[1] - shot.levels[0]) * v;
        code *= 1.0 + (share - 0.5).dot(shot.shade);
        if let Some((middle, radius, codes)) = shot.glare {
            let off = (share - middle) * DVec2::new(1.0, h as f64 / w as f64) / radius;
            code += codes * (-0.5 * off.length_squared()).exp();
        }
        (code + shot.noise * random.gauss()).round().clamp(0.0, 255.0) as u8
    });
    DrawnBoard { size: lens.size, grey: grey.collect(), corners: true_corners(target, lens, shot) }
}

/// Tag, corner of the tag and place, pixels, of all corners that fall into the picture.
pub fn true_corners(target: &Target, lens: &TrueLens, shot: &BoardShot) -> Vec<(usize, usize, DVec2)> {
    let half = target.size_m() / 2.0 - target.tag_m() * target.spacing();
    let mut out = Vec::new();
    for id in 0..target.tags() {
        for (i, corner) in target.corners(id).into_iter().enumerate() {
            let point = shot.camera_from_board * (corner - half).extend(0.0) + shot.middle;
            let inside = |p: &DVec2| {
                (0.0..lens.size.0 as f64).contains(&p.x) && (0.0..lens.size.1 as f64).contains(&p.y)
            };
            out.extend(lens.project(point).filter(inside).map(|p| (id, i, p)));
        }
    }
    out
}

/// Mean colour of a pixel whose centre shows `c`: asked more often where edges cross it. The places are those of Roberts' sequence, on which
/// no straight edge lies along many.
fn pixel(target: &Target, c: DVec2, right: DVec2, down: DVec2) -> f64 {
    let first = albedo(target, c);
    let coarse = (0..16).map(|i| DVec2::new(f64::from(i % 4), f64::from(i / 4)) / 3.0 - 0.5);
    let at = |place: DVec2| albedo(target, c + right * place.x + down * place.y);
    if coarse.into_iter().all(|place| at(place) == first) {
        return first;
    }
    const COUNT: usize = 400;
    let place =
        |i: usize| (DVec2::new(0.754_877_666_246_693, 0.569_840_290_998_053) * i as f64).fract() - 0.5;
    (0..COUNT).map(|i| at(place(i))).sum::<f64>() / COUNT as f64
}

/// A Gaussian blur.
fn blur(values: &mut [f64], w: usize, h: usize, sigma: f64) {
    if sigma <= 0.0 {
        return;
    }
    let reach = (4.0 * sigma).ceil() as isize;
    let mut kernel: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let sum: f64 = kernel.iter().sum();
    kernel.iter_mut().for_each(|k| *k /= sum);
    let pass = |from: &[f64], stride: isize, count: isize, along: &dyn Fn(usize) -> isize| -> Vec<f64> {
        (0..from.len())
            .map(|i| {
                let at = along(i);
                let tap = |(k, weight): (usize, &f64)| {
                    let to = (at + k as isize - reach).clamp(0, count - 1);
                    weight * from[(i as isize + (to - at) * stride) as usize]
                };
                kernel.iter().enumerate().map(tap).sum()
            })
            .collect()
    };
    let across = pass(values, 1, w as isize, &|i| (i % w) as isize);
    let down = pass(&across, w as isize, h as isize, &|i| (i / w) as isize);
    values.copy_from_slice(&down);
}

/// Movement during the exposure: the mean over a straight way about the middle.
fn smear(values: &mut [f64], w: usize, h: usize, way: DVec2) {
    let count = (way.length() * 4.0).ceil() as usize;
    if count < 2 {
        return;
    }
    let from = values.to_vec();
    let at = |p: DVec2| {
        let p = p.clamp(DVec2::ZERO, DVec2::new((w - 1) as f64, (h - 1) as f64));
        let (x, y) = ((p.x as usize).min(w - 2), (p.y as usize).min(h - 2));
        let (a, b) = (p.x - x as f64, p.y - y as f64);
        let row = |y: usize| from[y * w + x] * (1.0 - a) + from[y * w + x + 1] * a;
        row(y) * (1.0 - b) + row(y + 1) * b
    };
    for (i, value) in values.iter_mut().enumerate() {
        let here = DVec2::new((i % w) as f64, (i / w) as f64);
        let step = |k: usize| way * ((k as f64 + 0.5) / count as f64 - 0.5);
        *value = (0..count).map(|k| at(here + step(k))).sum::<f64>() / count as f64;
    }
}
