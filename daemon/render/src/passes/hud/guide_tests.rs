use proptest::prelude::*;

use super::{
    super::{
        QUADS_MAX, SHAPE_GLYPH,
        tests::{SIZES, blank, check, letters},
    },
    *,
};

fn gauge(name: &'static str, share: f64, rating: Option<Rating>) -> Gauge {
    Gauge { name, value: "12.3 mrad, 6.2 m at 500 m".to_owned(), share, rating }
}

fn full() -> Guide {
    Guide {
        title: "Calibrate: inertial unit to camera".to_owned(),
        says: "Roll camera and unit about the line of sight (by hand, or let the ship roll)".to_owned(),
        problem: Some("ONLY TRAVERSE SO FAR".to_owned()),
        gauges: vec![
            gauge("elevation", 0.1, Some(Rating::Poor)),
            gauge("traverse", 0.8, Some(Rating::Usable)),
            gauge("roll", 1.0, Some(Rating::Good)),
            gauge("time offset", 0.0, None),
        ],
        coverage: Some(Coverage { columns: 8, cells: vec![Cell::Many; 48], picture: (1280, 720) }),
        passed: Some(false),
        lines: vec!["32 s, horizon in 800 of 960 pictures".to_owned()],
        keys: "Enter or trigger: result   b: back   q: end",
    }
}

#[test]
fn a_full_page_fits_every_screen_and_what_to_do_is_whole() {
    for size in SIZES {
        let (glyphs, mut layout) = blank(size);
        let guide = full();
        let quads = layout.lay_out_guide(&glyphs, &guide).to_vec();
        check(size, &quads, "guide");
        assert!(quads.len() < QUADS_MAX, "{}", quads.len());
        let mute = Guide { says: String::new(), ..guide.clone() };
        let count = |quads: &[HudQuad]| quads.iter().filter(|q| q.shape == SHAPE_GLYPH).count();
        let without = count(layout.lay_out_guide(&glyphs, &Guide { lines: Vec::new(), ..mute }));
        let with = count(layout.lay_out_guide(&glyphs, &Guide { lines: Vec::new(), ..guide.clone() }));
        assert_eq!(with - without, letters(&guide.says), "{size:?}");
        // The middle of the picture stays free.
        if size == (800, 480) {
            let covers = |[x0, y0, x1, y1]: [f32; 4]| x0 < 440.0 && x1 > 360.0 && y0 < 260.0 && y1 > 220.0;
            assert!(!quads.iter().any(|q| covers(q.rect)), "{size:?}");
        }
    }
}

proptest! {
    #[test]
    fn odd_pages_neither_panic_nor_leave_the_screen(
        texts in prop::collection::vec("\\PC{0,200}", 5), share in prop::num::f64::ANY,
        columns in 0usize..90, cells in 0usize..90, gauges in 0usize..20,
        w in 320_u32..4000, h in 180_u32..2200,
    ) {
        let (glyphs, mut layout) = blank((w, h));
        let [title, says, problem, line, value] = texts.try_into().unwrap();
        let guide = Guide {
            title, says, problem: Some(problem), lines: vec![line],
            gauges: (0..gauges).map(|_| Gauge { name: "elevation", value: value.clone(), share, rating: None }).collect(),
            coverage: Some(Coverage { columns, cells: vec![Cell::Few; cells], picture: (0, 0) }),
            ..full()
        };
        let quads = layout.lay_out_guide(&glyphs, &guide);
        prop_assert!(quads.len() <= QUADS_MAX);
        for plate in layout.plates() {
            prop_assert!(plate.x + plate.width <= w && plate.y + plate.height <= h);
        }
    }
}
