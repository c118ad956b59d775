use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};
use proptest::prelude::*;

use super::*;

fn jpeg(width: u16, height: u16, kind: ExtendedColorType, value: u8) -> Vec<u8> {
    let channels = if kind == ExtendedColorType::L8 { 1 } else { 3 };
    let len = usize::from(width) * usize::from(height) * channels;
    // Not flat, so that there are coded pixels to damage.
    let pixels: Vec<u8> = (0..len).map(|i| value.saturating_add((i * 7 % 23) as u8)).collect();
    let mut bytes = Vec::new();
    let mut encoder = JpegEncoder::new_with_quality(&mut bytes, 95);
    encoder.encode(&pixels, width.into(), height.into(), kind).unwrap();
    bytes
}

/// `jpeg` with another declared size.
fn declaring(mut jpeg: Vec<u8>, width: u16, height: u16) -> Vec<u8> {
    let at = jpeg.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    jpeg[at + 5..at + 7].copy_from_slice(&height.to_be_bytes());
    jpeg[at + 7..at + 9].copy_from_slice(&width.to_be_bytes());
    jpeg
}

#[test]
fn colour_and_grey_become_rgb() {
    let mut decoder = Decoder::for_camera();
    for kind in [ExtendedColorType::Rgb8, ExtendedColorType::L8] {
        let picture = decoder.decode(&jpeg(32, 16, kind, 200), Some((32, 16))).unwrap();
        assert_eq!((picture.format(), picture.width(), picture.height()), (PixelFormat::Rgb, 32, 16));
        assert!(picture.bytes().iter().all(|v| (190..=232).contains(v)), "{:?}", picture.bytes());
    }
}

#[test]
fn a_bomb_is_refused_by_its_header() {
    let bomb = declaring(jpeg(32, 16, ExtendedColorType::Rgb8, 90), 65_535, 65_535);
    let mut decoder = Decoder::for_camera();
    let refused = decoder.decode(&bomb, Some((32, 16))).unwrap_err();
    assert_eq!(refused, JpegError::Size { width: 65_535, height: 65_535, expected: Some((32, 16)) });
    assert!(matches!(Decoder::for_recordings().decode(&bomb, None), Err(JpegError::Size { .. })));
    let empty = declaring(jpeg(32, 16, ExtendedColorType::Rgb8, 90), 0, 16);
    assert!(matches!(decoder.decode(&empty, None), Err(JpegError::Malformed(_))));
}

#[test]
fn a_picture_without_its_end_is_cut_short_and_padding_is_no_matter() {
    let whole = jpeg(64, 48, ExtendedColorType::Rgb8, 90);
    let mut decoder = Decoder::for_camera();
    let expected = decoder.decode(&whole, None).unwrap();
    for padding in [&[0; 100][..], b"\x00\xff\xaa trailing"] {
        assert_eq!(decoder.decode(&[&whole[..], padding].concat(), None).unwrap(), expected);
    }
    let start = header(&whole).unwrap().scan_start;
    for end in start..whole.len() - 1 {
        let cut = decoder.decode(&whole[..end], None);
        assert!(matches!(cut, Err(JpegError::Truncated { .. })), "{end}: {cut:?}");
    }
    for end in 0..start {
        assert!(matches!(decoder.decode(&whole[..end], None), Err(JpegError::Malformed(_))), "{end}");
    }
    assert!(matches!(decoder.decode(&[], None), Err(JpegError::Malformed(_))));
}

#[test]
fn a_marker_within_the_pixels_is_damage_to_a_camera() {
    let mut damaged = jpeg(64, 48, ExtendedColorType::Rgb8, 90);
    let start = header(&damaged).unwrap().scan_start;
    let middle = start + (damaged.len() - start) / 2;
    damaged[middle..middle + 2].copy_from_slice(&[0xff, 0xc8]);
    assert!(matches!(Decoder::for_camera().decode(&damaged, None), Err(JpegError::Damaged(_))));
}

#[test]
fn other_kinds_are_named() {
    let whole = jpeg(32, 16, ExtendedColorType::Rgb8, 90);
    let at = whole.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    let with = |marker: u8| {
        let mut bytes = whole.clone();
        bytes[at + 1] = marker;
        bytes
    };
    assert!(header(&with(0xc2)).unwrap().progressive);
    assert!(matches!(Decoder::for_camera().decode(&with(0xc2), None), Err(JpegError::Unsupported(_))));
    assert!(matches!(header(&with(0xc3)), Err(JpegError::Unsupported(_))));
    let mut deep = whole;
    deep[at + 4] = 12;
    assert!(matches!(header(&deep), Err(JpegError::Unsupported(_))));
}

proptest! {
    #[test]
    fn bytes_never_panic_and_never_give_another_size(
        bytes in prop::collection::vec(any::<u8>(), 0..300),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        cut in any::<prop::sample::Index>(),
    ) {
        let mut decoder = Decoder::for_camera();
        let _ = decoder.decode(&bytes, Some((32, 16)));
        let _ = decoder.decode(&[&[0xff, 0xd8, 0xff], &bytes[..]].concat(), Some((32, 16)));
        let mut damaged = jpeg(32, 16, ExtendedColorType::Rgb8, 90);
        for (at, value) in changes {
            *at.get_mut(&mut damaged) = value;
        }
        damaged.truncate(cut.index(damaged.len()) + 1);
        for mut decoder in [decoder, Decoder::for_recordings()] {
            if let Ok(picture) = decoder.decode(&damaged, Some((32, 16))) {
                prop_assert_eq!((picture.width(), picture.height()), (32, 16));
            }
        }
    }

    #[test]
    fn a_header_says_what_was_encoded(width in 1u16..200, height in 1u16..200) {
        let header = header(&jpeg(width, height, ExtendedColorType::Rgb8, 10)).unwrap();
        prop_assert_eq!((header.width, header.height), (width.into(), height.into()));
        prop_assert!(header.components == 3 && !header.progressive);
    }
}
