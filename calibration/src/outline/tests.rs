//! Outlines found in made pictures.

use std::sync::Arc;

use bowwave_core::event::PixelFormat;

use super::*;

const SIZE: (u32, u32) = (320, 200);

/// A barrel with a sight, from the lower border up.
fn barrel() -> Phantom {
    let corners = [
        [118.0, 200.0],
        [148.3, 120.0],
        [156.0, 120.0],
        [157.5, 88.0],
        [162.5, 88.0],
        [164.0, 120.0],
        [171.7, 120.0],
        [202.0, 200.0],
    ];
    Phantom::new("barrel", corners.map(DVec2::from_array).to_vec(), SIZE)
}

/// A number from -1 to 1 that follows from its arguments.
fn chance(a: u32, b: u32) -> f64 {
    let mixed = (a.wrapping_mul(0x9e37_79b9) ^ b.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
    f64::from(mixed >> 8) / f64::from(1u32 << 23) - 1.0
}

/// A picture of the sea below a sky, tilted by `tilt` pixels, with the gun before it.
fn picture(number: u32, tilt: f64, gun: Option<&Phantom>) -> Picture {
    let mut bytes = Vec::new();
    for y in 0..SIZE.1 {
        for x in 0..SIZE.0 {
            let below = f64::from(y) - 60.0 - tilt;
            let wave = chance(number * 977 + x / 5, (below.max(0.0) as u32) / 3);
            let sea = if below > 0.0 { 90.0 + 22.0 * wave } else { 190.0 + 0.05 * below };
            let cover = gun.map_or(0.0, |g| {
                (0.5 - g.distance(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5)) / 1.5).clamp(0.0, 1.0)
            });
            let noise = 1.5 * chance(number * 31 + 7, y * SIZE.0 + x);
            let code = (sea * (1.0 - cover) + 40.0 * cover + noise).round() as u8;
            bytes.extend([code; 3]);
        }
    }
    Picture::new(PixelFormat::Rgb, SIZE.0, SIZE.1, Arc::from(bytes)).unwrap()
}

fn found(pictures: u32, tilt: f64, gun: Option<&Phantom>) -> Result<FoundOutlines, OutlineError> {
    let mut finder = OutlineFinder::new(SIZE);
    for number in 0..pictures {
        finder.see(&picture(number, tilt * (f64::from(number) * 0.37).sin(), gun));
    }
    finder.find()
}

#[test]
fn the_gun_is_found_to_a_third_of_a_pixel() {
    let gun = barrel();
    let found = found(120, 90.0, Some(&gun)).unwrap();
    assert_eq!(found.phantoms.len(), 1, "{found:?}");
    let outline = &found.phantoms[0];
    let mut squares = Vec::new();
    for (from, to) in gun.edges() {
        let steps = (from.distance(to) / 2.0).ceil() as usize;
        squares.extend(
            (0..steps).map(|i| outline.distance(from.lerp(to, (i as f64 + 0.5) / steps as f64)).powi(2)),
        );
    }
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    assert!(rms < 0.35, "{rms} px");
    assert!(outline.outline().len() <= 24, "{} corners", outline.outline().len());
}

#[test]
fn a_sky_that_stays_in_the_picture_is_no_gun() {
    let found = found(120, 12.0, None).unwrap();
    assert_eq!(found.phantoms, []);
}

#[test]
fn too_little_is_said_to_be_too_little() {
    assert_eq!(found(20, 90.0, None).unwrap_err(), OutlineError::Pictures(20));
    let mut finder = OutlineFinder::new(SIZE);
    let still = picture(1, 0.0, None);
    (0..PICTURES_LEAST).for_each(|_| finder.see(&still));
    assert_eq!(finder.find().unwrap_err(), OutlineError::Still(0.0));
}

#[test]
fn an_opening_is_told() {
    // A ring: a disc keeps still but for its middle.
    let mut finder = OutlineFinder::new(SIZE);
    for number in 0..PICTURES_LEAST {
        let mut bytes = picture(number, 90.0 * (f64::from(number) * 0.37).sin(), None).bytes().to_vec();
        for (i, value) in bytes.iter_mut().enumerate() {
            let pixel = i as u32 / 3;
            let at = DVec2::new(f64::from(pixel % SIZE.0) - 160.0, f64::from(pixel / SIZE.0) - 120.0);
            if (20.0..32.0).contains(&at.length()) {
                *value = 40;
            }
        }
        finder.see(&Picture::new(PixelFormat::Rgb, SIZE.0, SIZE.1, Arc::from(bytes)).unwrap());
    }
    let found = finder.find().unwrap();
    assert_eq!((found.phantoms.len(), found.openings.len()), (1, 1), "{found:?}");
    let [low, high] = found.phantoms[0].bounds();
    assert!((high.x - low.x - 64.0).abs() < 2.0, "{low} {high}");
}
