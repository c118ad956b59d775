//! Pictures of a sea under a sky, of which the direction of up is known: a renderer of its own, which shares no code with the
//! product.

use std::f64::consts::TAU;

use rayon::prelude::*;

/// A lens after Brown and Conrady, as the picture is drawn with.
#[derive(Clone, Copy, Debug)]
pub struct DrawnLens {
    /// Focal length in pixels.
    pub focal: f64,
    /// Radial coefficients.
    pub radial: [f64; 2],
}

/// The sun before the lens: it washes out what is near it, and its light goes to and fro between the glasses.
#[derive(Clone, Copy, Debug)]
pub struct Glare {
    /// Where the sun stands: azimuth, and elevation over the visible horizon, radians.
    pub sun: [f64; 2],
    /// How far its light is spread across and upwards (standard deviation), radians.
    pub spread: [f64; 2],
    /// Codes that it adds in the middle: several times the brightest code, so that a plateau is washed out.
    pub codes: f64,
}

impl Glare {
    /// Codes that it adds at an elevation and azimuth.
    fn veil(&self, elevation: f64, azimuth: f64) -> f64 {
        let off =
            ((azimuth - self.sun[0]) / self.spread[0]).hypot((elevation - self.sun[1]) / self.spread[1]);
        // What the lens scatters reaches farther than what blooms, and is faint.
        self.codes * (-0.5 * off * off).exp() + 25.0 * (-off / 3.0).exp()
    }

    /// Codes that its mirrored pictures add: discs on the line through the sun and the middle, beyond it, at `place` by the picture's
    /// half width from the middle, with the sun at `sun`.
    fn flare(place: [f64; 2], sun: [f64; 2]) -> f64 {
        let disc = |(along, radius, codes): (f64, f64, f64)| {
            let off = (place[0] + along * sun[0]).hypot(place[1] + along * sun[1]);
            codes * (0.5 + 0.5 * ((radius - off) / 0.01).clamp(-1.0, 1.0))
        };
        [(0.35, 0.05, 22.0), (0.7, 0.11, 14.0), (1.15, 0.07, 18.0)].into_iter().map(disc).sum()
    }
}

/// Contents of a picture.
#[derive(Clone, Debug)]
pub struct DrawnScene {
    /// Its kind, under which errors are gathered.
    pub kind: &'static str,
    /// Width and height, pixels.
    pub size: (usize, usize),
    /// The lens, centred.
    pub lens: DrawnLens,
    /// Roll of the camera clockwise and its elevation, radians.
    pub attitude: [f64; 2],
    /// Height of the eye, metres.
    pub eye_m: f64,
    /// Codes of the sky at the horizon and overhead, and of the sea near by.
    pub codes: [f64; 3],
    /// Codes by which clouds, and waves near by, differ (standard deviation).
    pub contrast: [f64; 2],
    /// Distance at which haze has taken two thirds of the sea's colour, metres.
    pub haze_m: f64,
    /// How far waves lift the horizon, pixels (standard deviation).
    pub ragged_px: f64,
    /// Noise of a pixel, codes.
    pub noise: f64,
    /// Azimuth under which the sun glitters on the water, radians.
    pub glitter: Option<f64>,
    /// The sun before the lens.
    pub glare: Option<Glare>,
    /// Ships before the horizon.
    pub ships: usize,
    /// Whether the own barrel stands in the picture.
    pub barrel: bool,
    /// Rows that the camera's motion smears.
    pub smear: usize,
    /// Seed.
    pub seed: u64,
    /// Where the camera looks, clockwise, radians.
    pub heading: f64,
    /// How far wind has turned the clouds, clockwise, radians.
    pub clouds_turned: f64,
    /// How far wind has carried the clouds, 1 km above a round sea, east and north, kilometres.
    pub clouds_gone: [f64; 2],
    /// How far the ships have gone, clockwise, radians.
    pub ships_turned: f64,
    /// Height of hills along the horizon, radians; nothing for none.
    pub coast: f64,
    /// Which picture of a series it is: noise is another in each.
    pub picture: u64,
}

impl DrawnScene {
    /// A plain fair day.
    pub fn fair(seed: u64) -> Self {
        Self {
            kind: "fair",
            size: (1280, 720),
            lens: DrawnLens { focal: 1108.5, radial: [0.0, 0.0] },
            attitude: [0.0, 0.0],
            eye_m: 8.0,
            codes: [190.0, 140.0, 70.0],
            contrast: [6.0, 10.0],
            haze_m: 30_000.0,
            ragged_px: 0.3,
            noise: 2.0,
            glitter: None,
            glare: None,
            ships: 0,
            barrel: false,
            smear: 0,
            seed,
            heading: 0.0,
            clouds_turned: 0.0,
            clouds_gone: [0.0; 2],
            ships_turned: 0.0,
            coast: 0.0,
            picture: 0,
        }
    }

    /// A number of 0 to 1 that belongs to this picture.
    pub fn even(&self, i: u64) -> f64 {
        hash(self.seed.wrapping_mul(0x9e37).wrapping_add(i), 77)
    }

    /// Share of the picture's width to either side of its middle, and of its height from below, that the barrel takes.
    pub const BARREL: (f64, f64) = (0.06, 0.7);

    fn is_barrel(&self, x: f64, y: f64) -> bool {
        let (w, h) = (self.size.0 as f64, self.size.1 as f64);
        let up = 1.0 - y / h;
        self.barrel && up < Self::BARREL.1 && (x / w - 0.5).abs() < Self::BARREL.0 * (1.0 - 0.6 * up)
    }

    /// Unit ray of a pixel's place: Newton's method on the distorted radius.
    fn ray(&self, x: f64, y: f64) -> [f64; 3] {
        let [k1, k2] = self.lens.radial;
        let (u, v) = (
            (x - self.size.0 as f64 / 2.0) / self.lens.focal,
            (y - self.size.1 as f64 / 2.0) / self.lens.focal,
        );
        let distorted = u.hypot(v);
        let mut r = distorted;
        for _ in 0..8 {
            let f = r * (1.0 + k1 * r * r + k2 * r.powi(4)) - distorted;
            r -= f / (1.0 + 3.0 * k1 * r * r + 5.0 * k2 * r.powi(4));
        }
        let s = if distorted > 0.0 { r / distorted } else { 1.0 };
        let n = (1.0 + (u * u + v * v) * s * s).sqrt();
        [u * s / n, v * s / n, 1.0 / n]
    }

    /// Up in the camera's axes (x right, y down, z forward).
    pub fn up(&self) -> [f64; 3] {
        let [roll, elevation] = self.attitude;
        [-roll.sin() * elevation.cos(), -roll.cos() * elevation.cos(), elevation.sin()]
    }

    /// By how much the visible horizon lies below the horizontal, radians. Bowditch: 1.76 minutes of arc by the root of the height in metres.
    fn dip(&self) -> f64 {
        (1.76 / 60.0 * self.eye_m.sqrt()).to_radians()
    }

    /// Elevation over the visible horizon, and azimuth clockwise from where heading is nothing, of a pixel's place, radians.
    fn angles(&self, x: f64, y: f64) -> (f64, f64) {
        let (d, u) = (self.ray(x, y), self.up());
        let [roll, _] = self.attitude;
        let right = [roll.cos(), -roll.sin(), 0.0];
        let sine: f64 = (0..3).map(|i| d[i] * u[i]).sum();
        let across: f64 = (0..3).map(|i| d[i] * right[i]).sum();
        let dip = self.dip();
        let off_axis = across.atan2((1.0 - sine * sine - across * across).max(0.0).sqrt());
        (sine.asin() + dip, self.heading + off_axis)
    }

    /// Luma codes, row by row.
    pub fn draw(&self) -> Vec<u8> {
        let (w, h) = self.size;
        let mut light: Vec<f64> = (0..w * h)
            .into_par_iter()
            .map(|i| self.code((i % w) as f64 + 0.5, (i / w) as f64 + 0.5))
            .collect();
        if self.smear > 1 {
            light = smeared(&light, w, h, self.smear);
        }
        let noisy = |(i, code): (usize, &f64)| {
            let key = i as u64 ^ self.seed.wrapping_mul(0x51_7cc1) ^ (self.picture << 40);
            let (a, b) = (hash(key, 1).max(1e-12), hash(key, 2));
            (code + self.noise * (-2.0 * a.ln()).sqrt() * (TAU * b).cos()).round().clamp(0.0, 255.0) as u8
        };
        light.par_iter().enumerate().map(noisy).collect()
    }

    fn code(&self, x: f64, y: f64) -> f64 {
        let Some(glare) = self.glare else { return self.without_glare(x, y) };
        let (elevation, azimuth) = self.angles(x, y);
        let half = self.size.0 as f64 / 2.0;
        let place = [x / half - 1.0, (y - self.size.1 as f64 / 2.0) / half];
        let sun = glare.sun.map(|angle| angle.tan() * self.lens.focal / half);
        let flare = Glare::flare(place, [sun[0], -sun[1]]);
        self.without_glare(x, y) + glare.veil(elevation, azimuth - self.heading) + flare
    }

    fn without_glare(&self, x: f64, y: f64) -> f64 {
        if self.is_barrel(x, y) {
            return 35.0 + 15.0 * noise(x / 40.0, y / 9.0, self.seed ^ 5);
        }
        let (elevation, azimuth) = self.angles(x, y);
        let pixel = 1.0 / self.lens.focal;
        let lift = self.ragged_px * pixel * 1.4 * noise(azimuth * 90.0, 3.0, self.seed ^ 6);
        let over = elevation - lift;
        if let Some(code) = self.ship(elevation, azimuth).or_else(|| self.hill(elevation, azimuth)) {
            return code;
        }
        // A lens spreads an edge over about a pixel and a half.
        let sky_share = (0.5 + over / (1.5 * pixel)).clamp(0.0, 1.0);
        let sky = if sky_share > 0.0 { self.sky(elevation.max(0.0), azimuth) } else { 0.0 };
        let sea = if sky_share < 1.0 { self.sea((-over).max(1e-6), azimuth) } else { 0.0 };
        sky * sky_share + sea * (1.0 - sky_share)
    }

    fn sky(&self, elevation: f64, azimuth: f64) -> f64 {
        let [horizon, zenith, _] = self.codes;
        let clear = zenith + (horizon - zenith) * (-elevation / 0.25).exp();
        let (elevation, azimuth) = self.before_wind(elevation, azimuth);
        // Clouds are flatter the nearer they are to the horizon.
        let height = (elevation + 0.03).ln() * 6.0;
        let octaves = [(1.0, 1.0), (2.3, 0.5), (5.1, 0.25)];
        let along = (azimuth - self.clouds_turned) * 7.0;
        let cloud: f64 = octaves.iter().map(|(f, a)| a * noise(along * f, height * f, self.seed ^ 11)).sum();
        clear + self.contrast[0] * 1.3 * cloud
    }

    /// Where clouds that are seen there by now were before wind carried them.
    fn before_wind(&self, elevation: f64, azimuth: f64) -> (f64, f64) {
        let [east, north] = self.clouds_gone;
        if east == 0.0 && north == 0.0 {
            return (elevation, azimuth);
        }
        // Along the sight a height of 1 km is reached after `far` km: far sin(e) + far^2 / 2 R = 1.
        let radius = 6371.0 * 7.0 / 6.0;
        let sine = (elevation - self.dip()).sin();
        let far = radius * ((sine * sine + 2.0 / radius).sqrt() - sine);
        let (x, y) = (far * azimuth.sin() - east, far * azimuth.cos() - north);
        let far = x.hypot(y).max(1.0);
        ((1.0 / far - far / (2.0 * radius)).asin() + self.dip(), x.atan2(y))
    }

    fn sea(&self, below: f64, azimuth: f64) -> f64 {
        let [horizon, _, near] = self.codes;
        let range = self.range(below);
        // More of the sky is mirrored towards the horizon.
        let mirrored = near + (horizon - near) * 0.35 * (-below / 0.03).exp();
        let (east, north) = (range * azimuth.sin(), range * azimuth.cos());
        let mut waves = 0.0;
        for (length, share) in [(40.0, 0.5), (9.0, 0.6), (2.0, 0.5), (0.5, 0.4)] {
            // What is finer than a pixel is not seen.
            let footprint = range / self.lens.focal / below.max(2e-3);
            let seen = 1.0 / (1.0 + (footprint / length).powi(2));
            if seen > 0.003 {
                waves += share * seen.max(0.15) * noise(east / length / 3.0, north / length, self.seed ^ 21);
            }
        }
        let mut code = mirrored + self.contrast[1] * 1.6 * waves;
        if let Some(sun) = self.glitter {
            let spark = noise(azimuth * 900.0, (below + 0.002).ln() * 60.0, self.seed ^ 31);
            let band = (-((azimuth - sun) / 0.08).powi(2)).exp();
            code += band * (40.0 + 140.0 * (spark - 0.4).max(0.0));
        }
        let haze = 1.0 - (-range / self.haze_m).exp();
        code + (horizon - code) * haze
    }

    /// Distance of the water that is seen `below` the visible horizon, metres, on a round Earth under standard refraction
    /// (radius 7/6 of its own, as mariners' tables have it).
    fn range(&self, below: f64) -> f64 {
        let radius = 6_371_000.0 * 7.0 / 6.0;
        let dip = (2.0 * self.eye_m / radius).sqrt();
        let down = dip + below;
        radius * (down - (down * down - dip * dip).sqrt())
    }

    /// Woods and rocks below a sky line of hills.
    fn hill(&self, elevation: f64, azimuth: f64) -> Option<f64> {
        if self.coast <= 0.0 {
            return None;
        }
        let ridge: f64 = [(6.0, 0.5), (17.0, 0.3), (60.0, 0.15), (190.0, 0.05)]
            .iter()
            .map(|(f, a)| a * noise(azimuth * f, 1.5, self.seed ^ 41))
            .sum();
        let top = self.coast * (0.6 + ridge);
        (elevation > 0.0 && elevation < top).then(|| {
            let texture = noise(azimuth * 300.0, elevation * 500.0, self.seed ^ 42);
            0.5 * self.codes[2] + 0.35 * self.codes[0] + 12.0 * texture
        })
    }

    fn ship(&self, elevation: f64, azimuth: f64) -> Option<f64> {
        (0..self.ships as u64).find_map(|i| {
            let middle = (self.even(400 + i) - 0.5) * 1.1 + self.ships_turned;
            let (half, height) = (0.01 + 0.05 * self.even(500 + i), 0.004 + 0.02 * self.even(600 + i));
            let inside = (azimuth - middle).abs() < half && elevation > -0.25 * height && elevation < height;
            inside.then(|| {
                30.0 + 200.0 * self.even(700 + i) + 25.0 * noise(azimuth * 700.0, elevation * 900.0, i)
            })
        })
    }
}

/// Means over `rows` rows.
fn smeared(light: &[f64], w: usize, h: usize, rows: usize) -> Vec<f64> {
    let mean = |i: usize| {
        let (x, y) = (i % w, i / w);
        let from = y.saturating_sub(rows / 2);
        let to = (from + rows).min(h);
        (from..to).map(|row| light[row * w + x]).sum::<f64>() / (to - from) as f64
    };
    (0..w * h).into_par_iter().map(mean).collect()
}

/// A number of 0 to 1 from two (Murmur's finaliser).
fn hash(a: u64, b: u64) -> f64 {
    let mut z = a.wrapping_mul(0xff51_afd7_ed55_8ccd) ^ b.wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    z = (z ^ (z >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    z = (z ^ (z >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    ((z ^ (z >> 33)) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Smooth noise between -1 and 1 on a lattice of ones.
fn noise(x: f64, y: f64, seed: u64) -> f64 {
    let (ix, iy) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (fx, fy) = (smooth(x - ix), smooth(y - iy));
    let at = |dx: f64, dy: f64| {
        let key = ((ix + dx) as i64 as u64).wrapping_mul(0x1_0000_01b3) ^ ((iy + dy) as i64 as u64);
        2.0 * hash(key, seed) - 1.0
    };
    let top = at(0.0, 0.0) + (at(1.0, 0.0) - at(0.0, 0.0)) * fx;
    let bottom = at(0.0, 1.0) + (at(1.0, 1.0) - at(0.0, 1.0)) * fx;
    top + (bottom - top) * fy
}
