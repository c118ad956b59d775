//! Noise that is a function of place, and quantiles of the normal distribution.

/// Smooth noise on a unit lattice, mean 0, within -1 to 1 (Perlin 2002: gradients, quintic fade).
pub fn gradient_noise(x: f32, y: f32, seed: u32) -> f32 {
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let (ix, iy) = (x0 as i32, y0 as i32);
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let corner = |dx: i32, dy: i32| {
        let (gx, gy) = lattice_gradient(ix.wrapping_add(dx), iy.wrapping_add(dy), seed);
        gx * (fx - dx as f32) + gy * (fy - dy as f32)
    };
    let (u, v) = (fade(fx), fade(fy));
    let top = corner(0, 0) + u * (corner(1, 0) - corner(0, 0));
    let bottom = corner(0, 1) + u * (corner(1, 1) - corner(0, 1));
    1.41 * (top + v * (bottom - top))
}

fn lattice_gradient(ix: i32, iy: i32, seed: u32) -> (f32, f32) {
    let mut h = (ix as u32).wrapping_mul(0x8da6_b343) ^ (iy as u32).wrapping_mul(0xd816_3841) ^ seed;
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    h ^= h >> 15;
    // A point of the square, pushed to about unit length: cheaper than an angle and as good for clouds.
    let gx = (h & 0xffff) as f32 * (2.0 / 65_535.0) - 1.0;
    let gy = (h >> 16) as f32 * (2.0 / 65_535.0) - 1.0;
    let length = (gx * gx + gy * gy).sqrt().max(1e-3);
    (gx / length, gy / length)
}

/// Sum of `octaves` of [`gradient_noise`], each twice as fine and `gain` times as strong as the one before; about -1 to 1.
pub fn fractal_noise(x: f32, y: f32, octaves: u32, gain: f32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total) = (0.0, 1.0, 0.0);
    let (mut px, mut py) = (x, y);
    for octave in 0..octaves {
        sum += weight * gradient_noise(px, py, seed.wrapping_add(octave.wrapping_mul(0x68e3_1da4)));
        total += weight;
        weight *= gain;
        // Turned by an odd angle from octave to octave, so that lattice directions do not add up.
        (px, py) = (1.62 * px - 1.18 * py + 3.7, 1.18 * px + 1.62 * py - 1.3);
    }
    sum / total.max(1e-6)
}

/// Zero below `low`, one above `high`, smooth between.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// How many deviations a normal variable exceeds with probability `p` (Abramowitz and Stegun 26.2.23), for p below 0.5.
pub fn upper_quantile(p: f64) -> f64 {
    let t = (-2.0 * p.clamp(1e-9, 0.5).ln()).sqrt();
    t - (2.515_517 + t * (0.802_853 + t * 0.010_328))
        / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)))
}

/// Quantile of the standard normal distribution (Acklam 2003, relative error 1.2e-9).
pub fn normal_quantile(p: f64) -> f64 {
    const A: [f64; 6] = [
        -3.969_683_028_665_376e1,
        2.209_460_984_245_205e2,
        -2.759_285_104_469_687e2,
        1.383_577_518_672_69e2,
        -3.066_479_806_614_716e1,
        2.506_628_277_459_239,
    ];
    const B: [f64; 5] = [
        -5.447_609_879_822_406e1,
        1.615_858_368_580_409e2,
        -1.556_989_798_598_866e2,
        6.680_131_188_771_972e1,
        -1.328_068_155_288_572e1,
    ];
    const C: [f64; 6] = [
        -7.784_894_002_430_293e-3,
        -3.223_964_580_411_365e-1,
        -2.400_758_277_161_838,
        -2.549_732_539_343_734,
        4.374_664_141_464_968,
        2.938_163_982_698_783,
    ];
    const D: [f64; 4] =
        [7.784_695_709_041_462e-3, 3.224_671_290_700_398e-1, 2.445_134_137_142_996, 3.754_408_661_907_416];
    let poly = |c: &[f64], x: f64| c.iter().fold(0.0, |sum, &c| sum * x + c);
    let tail = |p: f64| {
        let q = (-2.0 * p.ln()).sqrt();
        poly(&C, q) / (poly(&D, q) * q + 1.0)
    };
    if p < 0.02425 {
        tail(p)
    } else if p > 1.0 - 0.02425 {
        -tail(1.0 - p)
    } else {
        let (q, r) = (p - 0.5, (p - 0.5) * (p - 0.5));
        poly(&A, r) * q / (poly(&B, r) * r + 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles() {
        for (p, expected) in [(0.158_655, 1.0), (0.022_750, 2.0), (0.001_350, 3.0)] {
            assert!((upper_quantile(p) - expected).abs() < 1e-3, "{p}");
        }
    }

    #[test]
    fn gradient_noise_is_continuous_across_lattice_lines() {
        for i in 0..200 {
            let y = i as f32 * 0.137 - 9.0;
            let x = (i % 11) as f32 - 5.0;
            let step = (gradient_noise(x - 1e-4, y, 5) - gradient_noise(x + 1e-4, y, 5)).abs();
            assert!(step < 2e-3, "{x} {y}: {step}");
        }
    }
}
