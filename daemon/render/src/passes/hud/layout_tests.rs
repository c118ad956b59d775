use bowwave_core::{fault::Severity, model::Zone};
use proptest::prelude::*;

use super::*;

pub(super) const SIZES: [(u32, u32); 7] =
    [(800, 480), (640, 360), (320, 180), (1024, 600), (1280, 720), (640, 480), (1920, 1080)];

/// Glyphs for a screen of `size`, and its layout with nothing on it.
pub(super) fn blank(size: (u32, u32)) -> (Glyphs, HudLayout) {
    let (large, small) = text_px(size);
    (Glyphs::new(large, small).unwrap(), HudLayout::new(size))
}

fn hud(status: Status, warning: Option<Fault>) -> Hud {
    Hud {
        status,
        warning,
        rounds_left: 9999,
        shots: 9999,
        hits: 9999,
        neutral_hits: 9999,
        clock_s: 359_999.0,
        ..Hud::READY
    }
}

fn shown(fault: Fault) -> Option<Status> {
    let (cause, action) = (fault.cause(), fault.action());
    match fault.severity() {
        Severity::Fault => Some(Status::Fault { cause, action }),
        Severity::NotScored => Some(Status::NotScored { cause, action }),
        Severity::Warning | Severity::Note => None,
    }
}

fn statuses() -> Vec<Status> {
    let unchecked = Status::NotChecked { cause: "NO HORIZON FOR 30 MIN" };
    let plain = [
        Status::Ready,
        Status::Hit { zone: Zone::Engine },
        Status::NeutralHit { zone: Zone::Engine },
        Status::Miss,
        unchecked,
    ];
    plain.into_iter().chain(Fault::ALL.into_iter().filter_map(shown)).collect()
}

/// Everything within the screen, plates apart from each other, and everything else within a plate.
pub(super) fn check(size: (u32, u32), quads: &[HudQuad], what: &str) {
    let (width, height) = (size.0 as f32, size.1 as f32);
    let plates: Vec<_> = quads.iter().filter(|q| q.shape == SHAPE_PLATE).map(|q| q.rect).collect();
    for quad in quads {
        let [x0, y0, x1, y1] = quad.rect;
        let inside = |[px0, py0, px1, py1]: [f32; 4]| {
            x0 >= px0 - 0.01 && y0 >= py0 - 0.01 && x1 <= px1 + 0.01 && y1 <= py1 + 0.01
        };
        assert!(inside([0.0, 0.0, width, height]), "{what} at {size:?}: outside the screen: {quad:?}");
        let held = quad.shape == SHAPE_PLATE || plates.iter().any(|p| inside(*p));
        assert!(held, "{what} at {size:?}: on no plate: {quad:?}");
    }
    for (i, a) in plates.iter().enumerate() {
        for b in &plates[..i] {
            let apart = a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1];
            assert!(apart, "{what} at {size:?}: {a:?} and {b:?} overlap");
        }
    }
}

#[test]
fn the_sea_stands_below_the_clock_and_hides_nothing() {
    for size in SIZES {
        let (glyphs, mut layout) = blank(size);
        for source in [SeaSource::Ordered, SeaSource::Measured, SeaSource::Kept, SeaSource::Assumed] {
            let without = glyph_count(layout.lay_out(&glyphs, &hud(Status::Ready, None)));
            let told = Hud { sea: WmoSeaState::new(3).map(|s| (s, source)), ..hud(Status::Ready, None) };
            let quads = layout.lay_out(&glyphs, &told);
            check(size, quads, &format!("{source:?}"));
            assert!(glyph_count(quads) > without + letters("SEA 3"), "{source:?} at {size:?}");
        }
    }
}

#[test]
fn the_headings_uncertainty_stands_below_and_hides_nothing() {
    for size in SIZES {
        let (glyphs, mut layout) = blank(size);
        let plain = glyph_count(layout.lay_out(&glyphs, &hud(Status::Ready, None)));
        for sea in [None, WmoSeaState::new(3).map(|s| (s, SeaSource::Assumed))] {
            let without = Hud { sea, ..hud(Status::Ready, None) };
            let other = glyph_count(layout.lay_out(&glyphs, &without));
            let quads = layout.lay_out(&glyphs, &Hud { heading_tenths_deg: Some(1234), ..without });
            check(size, quads, "heading");
            assert_eq!(glyph_count(quads), other + letters("HDG ±123.4°"), "{plain} at {size:?}");
        }
        // Neither sign is the question mark that stands for what the font lacks.
        let unknown = glyphs.get(TextSize::Small, '?').uv;
        assert!(['±', '°'].iter().all(|sign| glyphs.get(TextSize::Small, *sign).uv != unknown));
    }
}

fn glyph_count(quads: &[HudQuad]) -> usize {
    quads.iter().filter(|q| q.shape == SHAPE_GLYPH).count()
}

pub(super) fn letters(text: &str) -> usize {
    text.chars().filter(|c| *c != ' ').count()
}

#[test]
fn every_state_and_every_warning_fit_together_without_clipping_or_overlap() {
    for size in SIZES {
        let (glyphs, mut layout) = blank(size);
        for status in statuses() {
            let plain = layout.lay_out(&glyphs, &hud(status.clone(), None)).to_vec();
            check(size, &plain, &format!("{status:?}"));
            for fault in Fault::ALL {
                let quads = layout.lay_out(&glyphs, &hud(status.clone(), Some(fault))).to_vec();
                check(size, &quads, &format!("{status:?} with {fault:?}"));
                assert!(quads.len() < QUADS_MAX, "{} quads", quads.len());
                // Every letter is there, and the state's plate is where it is without the warning.
                let more = glyph_count(&quads) - glyph_count(&plain);
                let words = letters(fault.cause()) + letters(fault.action());
                assert!(
                    more == words || more == words + 1,
                    "{fault:?} at {size:?}: {more} of {words} letters"
                );
                let kept = plain.iter().all(|q| quads.contains(q));
                assert!(kept, "{status:?} at {size:?} moves when {fault:?} is shown");
            }
        }
    }
}

#[test]
fn no_two_states_have_shape_and_colour_in_common() {
    let size = (800, 480);
    let (glyphs, mut layout) = blank(size);
    let (cause, action) = ("A", "B");
    let states = [
        Status::Ready,
        Status::Hit { zone: Zone::Hull },
        Status::NeutralHit { zone: Zone::Engine },
        Status::Miss,
        // Ready, but for its colour.
        Status::NotChecked { cause },
        Status::Paused,
        Status::NotScored { cause, action },
        Status::Fault { cause, action },
    ];
    let words: Vec<_> = states.iter().map(|s| s.words().word).collect();
    assert_eq!(
        words,
        ["READY", "HIT", "NEUTRAL HIT", "MISS", "NOT CHECKED", "PAUSED", "NOT SCORED", "FAULT"]
    );
    let mut icons = Vec::new();
    for status in states {
        let quads = layout.lay_out(&glyphs, &hud(status, None));
        let icon: Vec<_> = quads.iter().filter(|q| q.shape > SHAPE_PLATE).collect();
        assert_eq!(icon.len(), 1);
        icons.push((icon[0].shape, icon[0].colour.map(f32::to_bits)));
    }
    let warned = layout.lay_out(&glyphs, &hud(Status::Ready, Some(Fault::Thermal)));
    let shapes: Vec<_> = warned.iter().filter(|q| q.shape > SHAPE_PLATE).map(|q| q.shape).collect();
    assert!(shapes.contains(&SHAPE_DIAMOND) && shapes.contains(&SHAPE_DISC), "{shapes:?}");
    for (i, a) in icons.iter().enumerate() {
        assert_ne!(a.0, SHAPE_DIAMOND);
        assert!(icons[..i].iter().all(|b| a != b), "{icons:?}");
    }
}

/// A 7 inch panel of 800x480 has an active area of 154.1 mm x 85.9 mm (AT070TN92 and its like).
const PITCH_MM: f64 = 85.92 / 480.0;
const ARM_MM: f64 = 700.0;

/// What a height on the screen subtends at arm's length, minutes of arc.
fn minutes(px: f32) -> f64 {
    (f64::from(px) * PITCH_MM / ARM_MM).atan().to_degrees() * 60.0
}

#[test]
fn texts_can_be_read_at_arms_length() {
    let (large, small) = text_px((800, 480));
    let glyphs = Glyphs::new(large, small).unwrap();
    let (word, rest) = (glyphs.cap(TextSize::Large), glyphs.cap(TextSize::Small));
    assert!(word >= 24.0, "capitals of the state word have {word} px");
    assert!(minutes(word) >= 20.0, "the state word subtends {:.1}'", minutes(word));
    assert!(minutes(rest) >= 16.0, "causes and actions subtend {:.1}'", minutes(rest));
    // The capital measured is the capital drawn.
    let [_, y0, _, y1] = glyphs.get(TextSize::Large, 'H').rect;
    assert!((y1 - y0 - word).abs() <= 1.0 && word <= large && rest <= small);
}

/// Relative luminance, ITU-R BT.709-6, 3.2.
fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

#[test]
fn every_colour_stands_out_from_its_plate_against_the_brightest_picture() {
    let [r, g, b, cover] = PLATE;
    let plate = luminance([r, g, b]) * cover + (1.0 - cover);
    for colour in [WHITE, GREEN, AMBER, RED, CYAN] {
        // ISO 9241-303 asks for 3:1; the 0.05 is light that the screen reflects, as in WCAG 2.
        let contrast = (luminance(colour) + 0.05) / (plate + 0.05);
        assert!(contrast >= 3.0, "{colour:?} has a contrast of {contrast:.2}");
    }
}

proptest! {
    #[test]
    fn odd_numbers_neither_panic_nor_grow(
        rounds_left: u32, shots: u32, hits: u32, clock_s in prop::num::f64::ANY,
        w in 320_u32..4000, h in 180_u32..2200,
    ) {
        let (glyphs, mut layout) = blank((w, h));
        let hud = Hud { rounds_left, shots, hits, clock_s, ..hud(Status::Ready, None) };
        check((w, h), layout.lay_out(&glyphs, &hud), "odd numbers");
    }
}
