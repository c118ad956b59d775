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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flip_is_nothing_between_equals_and_counts_only_what_the_mask_holds() {
        let size = (40, 30);
        let grey = vec![120u8; 3600];
        let mut half = grey.clone();
        // The right half is red: FLIP's filters reach a few pixels over the edge.
        for (i, p) in half.chunks_exact_mut(3).enumerate() {
            if i % 40 >= 20 {
                p.copy_from_slice(&[200, 30, 30]);
            }
        }
        let columns = |from: usize, to: usize| -> Vec<bool> {
            (0..1200).map(|i| (from..to).contains(&(i % 40))).collect()
        };
        let flip = |test: &[u8], mask: &[bool]| flip_mean(&grey, test, size, mask).unwrap();
        assert_eq!(flip(&grey, &columns(0, 40)), Some(0.0));
        assert!(flip(&half, &columns(30, 40)).unwrap() > 0.3);
        assert!(flip(&half, &columns(0, 10)).unwrap() < 0.02);
        assert_eq!(flip(&half, &columns(0, 0)), None);
        assert!(flip_mean(&grey, &half[3..], size, &columns(0, 1)).is_err());
        assert!(flip_mean(&grey, &half, size, &[true]).is_err());
    }
}
