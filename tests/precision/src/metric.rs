//! How far a picture is from another one to the eye.

use anyhow::{Result, ensure};

/// Mean FLIP (Andersson et al. 2020, through its authors' code) of `test` against `reference`, both sRGB bytes of `size`, over the pixels
/// that `mask` holds; 67 pixels a degree. `None` where the mask is empty.
pub fn flip_mean(reference: &[u8], test: &[u8], size: (u32, u32), mask: &[bool]) -> Result<Option<f64>> {
    let map = flip_map(reference, test, size)?;
    ensure!(mask.len() == map.len(), "a mask of {} pixels for a picture of {}", mask.len(), map.len());
    let (sum, count) = map
        .iter()
        .zip(mask)
        .filter(|(_, m)| **m)
        .fold((0.0, 0u32), |(sum, count), (&v, _)| (sum + f64::from(v), count + 1));
    Ok((count > 0).then(|| sum / f64::from(count)))
}

/// FLIP of every pixel.
pub fn flip_map(reference: &[u8], test: &[u8], size: (u32, u32)) -> Result<Vec<f32>> {
    let bytes = size.0 as usize * size.1 as usize * 3;
    ensure!(
        size.0 > 0 && size.1 > 0 && reference.len() == bytes && test.len() == bytes,
        "pictures of {} and {} bytes are not {} x {} RGB",
        reference.len(),
        test.len(),
        size.0,
        size.1
    );
    let picture = |data: &[u8]| nv_flip::FlipImageRgb8::with_data(size.0, size.1, data);
    Ok(nv_flip::flip(picture(reference), picture(test), nv_flip::DEFAULT_PIXELS_PER_DEGREE).to_vec())
}
