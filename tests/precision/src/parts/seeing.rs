//! Whether somebody sees a boat: contrast thresholds, ranges of lights and search, against published human data.

use std::f64::consts::PI;

use anyhow::Result;
use bowwave_core::{
    daylight::illuminance_of_sun,
    world::seeing::{Ambient, Glare, Seeing, Target, threshold},
};
use glam::DVec3;

use super::{About, worst};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "seeing",
    what: "Says from when on a boat could be seen, and whether its crew sees the gun.",
    truth: "table VIII of Blackwell (1946), 450,000 answers, as Clark (1990) gives it for whole magnitudes: Crumey fitted his law to it, we chose nothing \
            by it. Ranges of lights by the COLREGS, annex I, 8, and of search by table N-4 of the IAMSAR manual, which only judge",
    rivals: "the two constants that were used before (two minutes of arc, .46 of the visibility), Weber's law with the table's best contrast, and \
             Ricco's law with one threshold of light",
    why: "the constants say nothing of light: by night they are wrong by the whole range. The law holds from starlight to noon within a tenth of a \
          decade in the middle, and takes less than a microsecond",
};

/// Discs of the table: their diameters, minutes of arc.
const MINUTES: [f64; 7] = [0.595, 3.60, 9.68, 18.2, 55.2, 121.0, 360.0];
/// Logarithms of threshold contrast by disc, from 4 magnitudes a square second of the background on, one more a row.
const BLACKWELL: [[f64; 7]; 24] = [
    [-0.3769, -1.8064, -2.3368, -2.4601, -2.5469, -2.5610, -2.5660],
    [-0.3315, -1.7747, -2.3337, -2.4608, -2.5465, -2.5607, -2.5658],
    [-0.2682, -1.7345, -2.3310, -2.4605, -2.5467, -2.5608, -2.5658],
    [-0.1982, -1.6851, -2.3140, -2.4572, -2.5481, -2.5615, -2.5665],
    [-0.1238, -1.6252, -2.2791, -2.4462, -2.5463, -2.5597, -2.5646],
    [-0.0424, -1.5529, -2.2297, -2.4214, -2.5343, -2.5501, -2.5552],
    [0.0498, -1.4655, -2.1659, -2.3763, -2.5047, -2.5269, -2.5333],
    [0.1596, -1.3581, -2.0810, -2.3036, -2.4499, -2.4823, -2.4937],
    [0.2934, -1.2256, -1.9674, -2.1965, -2.3631, -2.4092, -2.4318],
    [0.4557, -1.0673, -1.8186, -2.0531, -2.2445, -2.3083, -2.3491],
    [0.6500, -0.8841, -1.6292, -1.8741, -2.0989, -2.1848, -2.2505],
    [0.8808, -0.6687, -1.3967, -1.6611, -1.9284, -2.0411, -2.1375],
    [1.1558, -0.3952, -1.1264, -1.4176, -1.7300, -1.8727, -2.0034],
    [1.4822, -0.0419, -0.8243, -1.1475, -1.5021, -1.6768, -1.8420],
    [1.8559, 0.3458, -0.4924, -0.8561, -1.2661, -1.4721, -1.6624],
    [2.2669, 0.6960, -0.1315, -0.5510, -1.0562, -1.2892, -1.4827],
    [2.6760, 1.0880, 0.2060, -0.3210, -0.8800, -1.1370, -1.3620],
    [2.7766, 1.2065, 0.3467, -0.1377, -0.7361, -0.9964, -1.2439],
    [2.9304, 1.3821, 0.5353, 0.0328, -0.5605, -0.8606, -1.1187],
    [3.1634, 1.6107, 0.7708, 0.2531, -0.3895, -0.7030, -0.9681],
    [3.4643, 1.9034, 1.0338, 0.4943, -0.2033, -0.5259, -0.8288],
    [3.8211, 2.2564, 1.3265, 0.7605, 0.0172, -0.2992, -0.6394],
    [4.2210, 2.6320, 1.6990, 1.1320, 0.2860, -0.0510, -0.4080],
    [4.6100, 3.0660, 2.1320, 1.5850, 0.6520, 0.2410, -0.1210],
];
/// Lights and the ranges that they are to be seen at, candela and nautical miles (COLREGS, annex I, 8: 80 % of light through a mile).
const LIGHTS: [(f64, f64); 6] = [(0.9, 1.0), (4.3, 2.0), (12.0, 3.0), (27.0, 4.0), (52.0, 5.0), (94.0, 6.0)];
/// Factor of contrast for somebody who does not know where to look: five or more (American Meteorological Society, glossary, threshold contrast).
const UNALERTED: f64 = 5.0;
/// Metres in a nautical mile.
const NM: f64 = 1852.0;
/// Meteorological visibility of air that lets 80 % of light through a mile, metres: 3.912 / (-ln .8) miles.
const ANNEX_VISIBILITY_M: f64 = 17.53 * NM;

/// Range of a light by its intensity, candela and nautical miles.
type Range<'a> = &'a dyn Fn(f64) -> f64;

/// Logarithm of a threshold contrast by background, cd/m^2, and disc, minutes.
type Law = fn(f64, f64) -> f64;

fn disc_sr(minutes: f64) -> f64 {
    PI / 4.0 * (minutes * PI / 10_800.0).powi(2)
}

fn product(background: f64, minutes: f64) -> f64 {
    threshold::contrast(background, disc_sr(minutes)).log10()
}

/// The constants: nothing below two minutes is seen, and all above with a contrast of .05, whatever the light.
fn two_minutes(_: f64, minutes: f64) -> f64 {
    if minutes < 2.0 { 6.0 } else { 0.05f64.log10() }
}

fn weber(_: f64, _: f64) -> f64 {
    -2.566
}

/// One illuminance is needed, as of a light by night: what COLREGS and lighthouse authorities take.
fn one_threshold(background: f64, minutes: f64) -> f64 {
    (2e-7 / (background * disc_sr(minutes))).log10()
}

const LAWS: [(&str, &str, Law); 4] = [
    ("Crumey's law", "as published", product),
    ("two constants", "2 minutes, 5 %", two_minutes),
    ("Weber's law", ".27 %", weber),
    ("one threshold of light", "2e-7 lx", one_threshold),
];

/// Points of the table with its truth, for backgrounds between two magnitudes.
fn table(from: usize, to: usize) -> Vec<(f64, f64, f64)> {
    let row = |magnitude: usize| {
        let background = 10f64.powf(0.4 * (12.58 - magnitude as f64));
        MINUTES
            .into_iter()
            .zip(BLACKWELL[magnitude - 4])
            .map(move |(minutes, log)| (background, minutes, log))
    };
    (from..=to).flat_map(row).collect()
}

fn night(visibility_m: f64) -> Seeing {
    Seeing { ambient: Ambient::new(DVec3::NEG_Z, 1.0, None, 5.0), visibility_m }
}

/// A hull of no size with a light.
fn light(candela: f64) -> Target {
    Target { breadth_m: 1e-3, height_m: 1.0, reflectance: 0.3, lamp_lux: 0.0, candela }
}

/// Sweep width of a gunner's rate of finding, as the product limits it, nautical miles, for an even sky of a day: boats a half as wide to the eye as
/// they are long, and a quarter as high.
fn swept_nm(length_m: f64, visibility_nm: f64, width_nm: f64) -> f64 {
    const KNOTS: f64 = 10.0 / 3600.0;
    let day = Seeing { ambient: Ambient::new(DVec3::Z, 0.3, None, 5.0), visibility_m: visibility_nm * NM };
    let target = Target {
        breadth_m: 0.5 * length_m,
        height_m: 0.25 * length_m,
        reflectance: 0.3,
        lamp_lux: 0.0,
        candela: 0.0,
    };
    let rate = |range_nm: f64| {
        let at = DVec3::Y * range_nm * NM;
        let times = day.times_threshold(DVec3::Z * 8.0, at, &target, Glare::default());
        let found = KNOTS * width_nm * width_nm / (8.0 * PI * range_nm.max(0.02).powi(3));
        found * threshold::chance(times)
    };
    // Steps grow with the distance; both ways along the track.
    let exposure = |lateral_nm: f64| {
        let step = 0.03;
        let along = (0..300).map(|i| lateral_nm * 0.2 * (step * f64::from(i)).exp_m1());
        let nodes: Vec<f64> = along.collect();
        nodes
            .windows(2)
            .map(|w| 2.0 * (w[1] - w[0]) / KNOTS * rate((0.5 * (w[0] + w[1])).hypot(lateral_nm)))
            .sum::<f64>()
    };
    let laterals = (0..400).map(|i| (f64::from(i) + 0.5) * 0.05);
    laterals.map(|lateral| 2.0 * 0.05 * (1.0 - (-exposure(lateral)).exp())).sum()
}

/// Measures the scenes.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for (case, from, to) in [
        ("by day, 68 to 2700 cd/m^2", 4, 8),
        ("at dusk, .04 to 27 cd/m^2", 9, 16),
        ("by night, 1e-5 to .02 cd/m^2", 17, 25),
    ] {
        let points = table(from, to);
        let error = |law: Law| {
            let sum: f64 = points.iter().map(|(b, m, log)| (law(*b, *m) - log).powi(2)).sum();
            (sum / points.len() as f64).sqrt()
        };
        let ways = LAWS.iter().enumerate().map(|(i, (method, setting, law))| {
            let work = || points.iter().map(|(b, m, _)| law(*b, *m)).sum::<f64>();
            Way::new(method, setting, error(*law), points.len(), work).default_if(i == 0)
        });
        bench.scene(case, "decades of contrast", 0.05, ways.collect());
    }
    lights(bench);
    search(bench);
    extremes(bench);
    Ok(())
}

/// Ranges of lights on a dark night: an alert watcher who looks at one sees it farther than the least that the rules want.
fn lights(bench: &mut PartBench) {
    let night = night(ANNEX_VISIBILITY_M);
    let range_nm = |candela: f64| night.farthest_m(8.0, DVec3::Y, &light(candela), 1e5) / NM;
    let unalerted_nm = |candela: f64| range_nm(candela / UNALERTED);
    let short = |range: Range<'_>| {
        worst(LIGHTS.iter().map(|(candela, least_nm)| (1.0 - range(*candela) / least_nm).max(0.0)))
    };
    let off = |range: Range<'_>| {
        worst(LIGHTS.iter().map(|(candela, least_nm)| (range(*candela) / least_nm - 1.0).abs()))
    };
    let constants_nm = |_: f64| (1.0 / 0.000_581_8_f64).min(0.46 * ANNEX_VISIBILITY_M) / NM;
    let results = |error: &dyn Fn(Range<'_>) -> f64| {
        vec![
            ExtremeResult {
                default: true,
                ..ExtremeResult::rival("Crumey's law", "who looks there", 100.0 * error(&range_nm))
            },
            ExtremeResult::rival("Crumey's law", "who does not know where", 100.0 * error(&unalerted_nm)),
            ExtremeResult::rival("two constants", "a metre of hull", 100.0 * error(&constants_nm)),
        ]
    };
    bench.extreme("lights of annex I by night: range short of the rules'", "%", results(&short));
    bench.extreme("lights of annex I by night: range off the rules'", "%", results(&off));
}

/// Sweep widths as they are left of the manual's.
fn search(bench: &mut PartBench) {
    const WIDTHS: [(f64, [f64; 5]); 3] = [
        (5.0, [1.1, 1.4, 1.9, 2.1, 2.3]),
        (7.0, [2.0, 2.9, 4.3, 5.2, 5.8]),
        (12.0, [2.8, 4.5, 7.6, 9.4, 11.6]),
    ];
    for (length_m, widths) in WIDTHS {
        let lost = widths.iter().zip([3.0, 5.0, 10.0, 15.0, 20.0]).map(|(width_nm, visibility_nm)| {
            100.0 * (swept_nm(length_m, visibility_nm, *width_nm) / width_nm - 1.0).abs()
        });
        let limited = ExtremeResult::product("inverse cube law", "of what can be seen", worst(lost));
        let case = format!("sweep widths of boats of {length_m} m, visibilities of 3 to 20 miles");
        bench.extreme(&case, "% of the manual's", vec![limited]);
    }
}

/// Values that are no numbers, or negative.
fn extremes(bench: &mut PartBench) {
    let mut broken = 0.0;
    for sun_deg in (-90..=90).step_by(5) {
        let (sine, cosine) = f64::from(sun_deg).to_radians().sin_cos();
        let ambient = Ambient::new(DVec3::new(0.0, cosine, sine), 1.0, None, 5.0);
        broken += f64::from(u8::from(!illuminance_of_sun(sine).is_finite()));
        for visibility_m in [1.0, 1e3, 1e9] {
            for range_m in [0.0, 1.0, 1e3, 1e6] {
                let seeing = Seeing { ambient, visibility_m };
                let times =
                    seeing.times_threshold(DVec3::Z * 8.0, DVec3::Y * range_m, &light(1.0), Glare::default());
                broken += f64::from(u8::from(!(times.is_finite() && times >= 0.0)));
            }
        }
    }
    let result =
        ExtremeResult { default: true, ..ExtremeResult::rival("Crumey's law", "as published", broken) };
    bench.extreme(
        "suns of -90 to 90 degrees, 0 to 1e6 m, visibilities of 1 to 1e9 m: broken values",
        "",
        vec![result],
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_law_is_nearer_to_what_was_measured_than_any_constant() {
        let error = |law: Law| worst(table(4, 25).iter().map(|(b, m, log)| (law(*b, *m) - log).abs()));
        assert!(error(product) < 0.2, "{}", error(product));
        assert!(LAWS[1..].iter().all(|(_, _, law)| error(*law) > 1.0));
    }

    #[test]
    fn a_light_is_seen_at_least_as_far_as_the_rules_want() {
        let night = night(ANNEX_VISIBILITY_M);
        for (candela, least_nm) in LIGHTS {
            let range_nm = night.farthest_m(8.0, DVec3::Y, &light(candela / UNALERTED), 1e5) / NM;
            assert!(range_nm >= least_nm, "{candela} cd: {range_nm}");
        }
    }
}
