//! The video pass against the core's own conversion: every format, every run length, equal and other sizes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test that cannot go on fails")]

mod common;

use std::sync::Arc;

use bowwave_core::{
    event::{Picture, PixelFormat},
    frame::scene::{LeftOut, Pass, PassDecision},
};
use common::{at, draw, testing::empty_scene};
use rand_like::Numbers;

mod rand_like {
    /// A linear congruential generator: bytes without pattern, the same in every run.
    pub struct Numbers(pub u64);

    impl Numbers {
        pub fn byte(&mut self) -> u8 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 56) as u8
        }
    }
}

fn picture(format: PixelFormat, width: u32, height: u32) -> Picture {
    let mut numbers = Numbers(u64::from(width * 7 + height));
    let bytes: Vec<u8> = (0..format.byte_len(width, height)).map(|_| numbers.byte()).collect();
    Picture::new(format, width, height, Arc::from(bytes)).unwrap()
}

/// Draws nothing but the video.
fn video_only(picture: &Picture, width: u32, height: u32) -> Vec<u8> {
    let mut scene = empty_scene(width, height);
    scene.passes[Pass::Hud as usize] = PassDecision::LeftOut(LeftOut::NoBoats);
    draw(&scene, picture, &[])
}

#[test]
fn equal_size_is_within_one_code_of_the_reference_and_rgb_is_exact() {
    // Widths that take runs of four, two and one pixel.
    for (width, height) in [(64, 48), (62, 34), (61, 33)] {
        for format in [PixelFormat::Yuyv, PixelFormat::Nv12, PixelFormat::Rgb] {
            if (width % 2 == 1 || height % 2 == 1) && format != PixelFormat::Rgb {
                continue;
            }
            let picture = picture(format, width, height);
            let pixels = video_only(&picture, width, height);
            let mut worst = 0;
            for y in 0..height {
                for x in 0..width {
                    let want = picture.srgb_at(x, y).map(|c| (c * 255.0).round() as i32);
                    let got = at(&pixels, width, x, y).map(i32::from);
                    let error = (0..3).map(|i| (got[i] - want[i]).abs()).max().unwrap();
                    worst = worst.max(error);
                }
            }
            let allowed = if format == PixelFormat::Rgb { 0 } else { 1 };
            assert!(worst <= allowed, "{format:?} {width}x{height}: {worst} codes off");
        }
    }
}

/// Bilinear, scaled to cover and centred, by the definition; colours are mixed before they are converted.
fn covered(picture: &Picture, width: u32, height: u32, x: u32, y: u32) -> [f64; 3] {
    let (w, h) = (f64::from(picture.width()), f64::from(picture.height()));
    let scale = (f64::from(width) / w).max(f64::from(height) / h);
    let place = |p: u32, to: u32, from: f64| {
        ((f64::from(p) + 0.5 - f64::from(to) / 2.0) / scale + from / 2.0 - 0.5).clamp(0.0, from - 1.0)
    };
    let (px, py) = (place(x, width, w), place(y, height, h));
    let (x0, y0) = (px.floor() as u32, py.floor() as u32);
    let (fx, fy) = (px.fract(), py.fract());
    let mut sum = [0.0; 3];
    for (dx, dy, weight) in
        [(0, 0, (1.0 - fx) * (1.0 - fy)), (1, 0, fx * (1.0 - fy)), (0, 1, (1.0 - fx) * fy), (1, 1, fx * fy)]
    {
        let c = picture.srgb_at(x0 + dx, y0 + dy);
        (0..3).for_each(|i| sum[i] += weight * f64::from(c[i]) * 255.0);
    }
    sum
}

#[test]
fn other_sizes_are_covered_bilinearly_and_centred() {
    // Enlarged, cropped, only cropped, and made smaller; widths that are a multiple of four and that are not.
    let sizes = [
        ((64, 36), (96, 54)),
        ((64, 36), (80, 80)),
        ((36, 60), (96, 52)),
        ((64, 48), (64, 36)),
        ((80, 36), (64, 36)),
        ((62, 34), (96, 54)),
        ((96, 54), (64, 40)),
        ((62, 34), (50, 30)),
    ];
    for (from, to) in sizes {
        for format in [PixelFormat::Yuyv, PixelFormat::Nv12, PixelFormat::Rgb] {
            // Colours near grey: where a conversion clips, mixing before and after it differ.
            let noise = picture(format, from.0, from.1);
            let bytes: Vec<u8> = noise.bytes().iter().map(|b| 112 + b / 8).collect();
            let picture = Picture::new(format, from.0, from.1, Arc::from(bytes)).unwrap();
            let pixels = video_only(&picture, to.0, to.1);
            for y in 0..to.1 {
                for x in 0..to.0 {
                    let want = covered(&picture, to.0, to.1, x, y);
                    let got = at(&pixels, to.0, x, y);
                    for i in 0..3 {
                        let error = (f64::from(got[i]) - want[i]).abs();
                        assert!(
                            error < 1.02,
                            "{format:?} {from:?} to {to:?} at {x} {y}: {got:?}, not {want:?}"
                        );
                    }
                }
            }
        }
    }
}
