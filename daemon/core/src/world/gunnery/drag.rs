//! Drag of standard projectiles, and of one whose drag is given as a table.

/// Mach number and drag coefficient of the G7 standard projectile: long, pointed, boat-tailed (public BRL/JBM tabulation).
#[allow(clippy::approx_constant)] // 0.3010 is a measured drag, not a logarithm.
#[rustfmt::skip] // Several pairs a line.
const G7: [(f64, f64); 84] = [
    (0.000, 0.1198), (0.050, 0.1197), (0.100, 0.1196), (0.150, 0.1194), (0.200, 0.1193), (0.250, 0.1194),
    (0.300, 0.1194), (0.350, 0.1194), (0.400, 0.1193), (0.450, 0.1193), (0.500, 0.1194), (0.550, 0.1193),
    (0.600, 0.1194), (0.650, 0.1197), (0.700, 0.1202), (0.725, 0.1207), (0.750, 0.1215), (0.775, 0.1226),
    (0.800, 0.1242), (0.825, 0.1266), (0.850, 0.1306), (0.875, 0.1368), (0.900, 0.1464), (0.925, 0.1660),
    (0.950, 0.2054), (0.975, 0.2993), (1.000, 0.3803), (1.025, 0.4015), (1.050, 0.4043), (1.075, 0.4034),
    (1.100, 0.4014), (1.125, 0.3987), (1.150, 0.3955), (1.200, 0.3884), (1.250, 0.3810), (1.300, 0.3732),
    (1.350, 0.3657), (1.400, 0.3580), (1.500, 0.3440), (1.550, 0.3376), (1.600, 0.3315), (1.650, 0.3260),
    (1.700, 0.3209), (1.750, 0.3160), (1.800, 0.3117), (1.850, 0.3078), (1.900, 0.3042), (1.950, 0.3010),
    (2.000, 0.2980), (2.050, 0.2951), (2.100, 0.2922), (2.150, 0.2892), (2.200, 0.2864), (2.250, 0.2835),
    (2.300, 0.2807), (2.350, 0.2779), (2.400, 0.2752), (2.450, 0.2725), (2.500, 0.2697), (2.550, 0.2670),
    (2.600, 0.2643), (2.650, 0.2615), (2.700, 0.2588), (2.750, 0.2561), (2.800, 0.2533), (2.850, 0.2506),
    (2.900, 0.2479), (2.950, 0.2451), (3.000, 0.2424), (3.100, 0.2368), (3.200, 0.2313), (3.300, 0.2258),
    (3.400, 0.2205), (3.500, 0.2154), (3.600, 0.2106), (3.700, 0.2060), (3.800, 0.2017), (3.900, 0.1975),
    (4.000, 0.1935), (4.200, 0.1861), (4.400, 0.1793), (4.600, 0.1730), (4.800, 0.1672), (5.000, 0.1618),
];

/// The same of the G1 standard projectile: flat-based, two calibres of ogive.
#[rustfmt::skip] // Several pairs a line.
const G1: [(f64, f64); 79] = [
    (0.000, 0.2629), (0.050, 0.2558), (0.100, 0.2487), (0.150, 0.2413), (0.200, 0.2344), (0.250, 0.2278),
    (0.300, 0.2214), (0.350, 0.2155), (0.400, 0.2104), (0.450, 0.2061), (0.500, 0.2032), (0.550, 0.2020),
    (0.600, 0.2034), (0.700, 0.2165), (0.725, 0.2230), (0.750, 0.2313), (0.775, 0.2417), (0.800, 0.2546),
    (0.825, 0.2706), (0.850, 0.2901), (0.875, 0.3136), (0.900, 0.3415), (0.925, 0.3734), (0.950, 0.4084),
    (0.975, 0.4448), (1.000, 0.4805), (1.025, 0.5136), (1.050, 0.5427), (1.075, 0.5677), (1.100, 0.5883),
    (1.125, 0.6053), (1.150, 0.6191), (1.200, 0.6393), (1.250, 0.6518), (1.300, 0.6589), (1.350, 0.6621),
    (1.400, 0.6625), (1.450, 0.6607), (1.500, 0.6573), (1.550, 0.6528), (1.600, 0.6474), (1.650, 0.6413),
    (1.700, 0.6347), (1.750, 0.6280), (1.800, 0.6210), (1.850, 0.6141), (1.900, 0.6072), (1.950, 0.6003),
    (2.000, 0.5934), (2.050, 0.5867), (2.100, 0.5804), (2.150, 0.5743), (2.200, 0.5685), (2.250, 0.5630),
    (2.300, 0.5577), (2.350, 0.5527), (2.400, 0.5481), (2.450, 0.5438), (2.500, 0.5397), (2.600, 0.5325),
    (2.700, 0.5264), (2.800, 0.5211), (2.900, 0.5168), (3.000, 0.5133), (3.100, 0.5105), (3.200, 0.5084),
    (3.300, 0.5067), (3.400, 0.5054), (3.500, 0.5040), (3.600, 0.5030), (3.700, 0.5022), (3.800, 0.5016),
    (3.900, 0.5010), (4.000, 0.5006), (4.200, 0.4998), (4.400, 0.4995), (4.600, 0.4992), (4.800, 0.4990),
    (5.000, 0.4988),
];

/// The same of a smooth sphere.
#[rustfmt::skip] // Several pairs a line.
const SPHERE: [(f64, f64); 81] = [
    (0.000, 0.4662), (0.050, 0.4689), (0.100, 0.4717), (0.150, 0.4745), (0.200, 0.4772), (0.250, 0.4800),
    (0.300, 0.4827), (0.350, 0.4852), (0.400, 0.4882), (0.450, 0.4920), (0.500, 0.4970), (0.550, 0.5080),
    (0.600, 0.5260), (0.650, 0.5590), (0.700, 0.5920), (0.750, 0.6258), (0.800, 0.6610), (0.850, 0.6985),
    (0.900, 0.7370), (0.950, 0.7757), (1.000, 0.8140), (1.050, 0.8512), (1.100, 0.8870), (1.150, 0.9210),
    (1.200, 0.9510), (1.250, 0.9740), (1.300, 0.9910), (1.350, 0.9990), (1.400, 1.0030), (1.450, 1.0060),
    (1.500, 1.0080), (1.550, 1.0090), (1.600, 1.0090), (1.650, 1.0090), (1.700, 1.0090), (1.750, 1.0080),
    (1.800, 1.0070), (1.850, 1.0060), (1.900, 1.0040), (1.950, 1.0025), (2.000, 1.0010), (2.050, 0.9990),
    (2.100, 0.9970), (2.150, 0.9956), (2.200, 0.9940), (2.250, 0.9916), (2.300, 0.9890), (2.350, 0.9869),
    (2.400, 0.9850), (2.450, 0.9830), (2.500, 0.9810), (2.550, 0.9790), (2.600, 0.9770), (2.650, 0.9750),
    (2.700, 0.9730), (2.750, 0.9710), (2.800, 0.9690), (2.850, 0.9670), (2.900, 0.9650), (2.950, 0.9630),
    (3.000, 0.9610), (3.050, 0.9589), (3.100, 0.9570), (3.150, 0.9555), (3.200, 0.9540), (3.250, 0.9520),
    (3.300, 0.9500), (3.350, 0.9485), (3.400, 0.9470), (3.450, 0.9450), (3.500, 0.9430), (3.550, 0.9414),
    (3.600, 0.9400), (3.650, 0.9385), (3.700, 0.9370), (3.750, 0.9355), (3.800, 0.9340), (3.850, 0.9325),
    (3.900, 0.9310), (3.950, 0.9295), (4.000, 0.9280),
];

/// Slopes of the interpolant at the tables' points.
static G7_SLOPES: [f64; G7.len()] = slopes(&G7);
static G1_SLOPES: [f64; G1.len()] = slopes(&G1);
static SPHERE_SLOPES: [f64; SPHERE.len()] = slopes(&SPHERE);

/// Drag of a round as a function of its Mach number.
#[allow(clippy::large_enum_variant, reason = "a round is copied with its drag, and there are few")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DragModel {
    /// As the G7 standard projectile.
    G7,
    /// As the G1 standard projectile.
    G1,
    /// As a smooth sphere.
    Sphere,
    /// As measured.
    Table(DragTable),
}

impl DragModel {
    /// Drag coefficient at `mach`; the table's end values beyond its ends.
    pub fn coefficient(&self, mach: f64) -> f64 {
        match self {
            Self::G7 => interpolated(&G7, &G7_SLOPES, mach),
            Self::G1 => interpolated(&G1, &G1_SLOPES, mach),
            Self::Sphere => interpolated(&SPHERE, &SPHERE_SLOPES, mach),
            Self::Table(table) => {
                interpolated(&table.points[..table.count], &table.slopes[..table.count], mach)
            }
        }
    }

    /// The name used in scenarios.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::G7 => "g7",
            Self::G1 => "g1",
            Self::Sphere => "sphere",
            Self::Table(_) => "table",
        }
    }
}

/// A measured drag coefficient by Mach number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DragTable {
    points: [(f64, f64); Self::MOST],
    slopes: [f64; Self::MOST],
    count: usize,
}

impl DragTable {
    /// Points that a table holds at most.
    pub const MOST: usize = 32;

    /// A table of Mach numbers (0 to 10, rising) and drag coefficients (.01 to 5); `None` for one that has fewer than two or more than
    /// [`Self::MOST`] points, or others.
    pub fn new(given: &[(f64, f64)]) -> Option<Self> {
        let rises = given.windows(2).all(|pair| pair[1].0 - pair[0].0 > 1e-3);
        let fits = |&(mach, cd): &(f64, f64)| (0.0..=10.0).contains(&mach) && (0.01..=5.0).contains(&cd);
        if !(2..=Self::MOST).contains(&given.len()) || !rises || !given.iter().all(fits) {
            return None;
        }
        let (mut points, mut table) = ([(0.0, 0.0); Self::MOST], [0.0; Self::MOST]);
        points[..given.len()].copy_from_slice(given);
        for (i, slope) in table[..given.len()].iter_mut().enumerate() {
            *slope = slope_at(given, i);
        }
        Some(Self { points, slopes: table, count: given.len() })
    }
}

const fn slopes<const N: usize>(points: &[(f64, f64); N]) -> [f64; N] {
    let mut slopes = [0.0; N];
    let mut i = 0;
    while i < N {
        slopes[i] = slope_at(points, i);
        i += 1;
    }
    slopes
}

/// Slope of the interpolant at point `i` of two or more: Fritsch and Butland 1984 (as SciPy's `PchipInterpolator`).
///
/// The interpolant has neither kinks, which would cost the integrator its order, nor overshoot in the steep rise at Mach 1.
const fn slope_at(points: &[(f64, f64)], i: usize) -> f64 {
    let last = points.len() - 1;
    if last == 1 {
        return interval(points, 0).1;
    }
    if i == 0 {
        return end_slope(interval(points, 0), interval(points, 1));
    }
    if i == last {
        return end_slope(interval(points, last - 1), interval(points, last - 2));
    }
    let (left_h, left) = interval(points, i - 1);
    let (right_h, right) = interval(points, i);
    if left * right > 0.0 {
        let (w1, w2) = (2.0 * right_h + left_h, right_h + 2.0 * left_h);
        (w1 + w2) / (w1 / left + w2 / right)
    } else {
        0.0
    }
}

/// Width and chord slope of the interval that starts at point `i`.
const fn interval(points: &[(f64, f64)], i: usize) -> (f64, f64) {
    let width = points[i + 1].0 - points[i].0;
    (width, (points[i + 1].1 - points[i].1) / width)
}

/// One-sided three-point slope, limited so that the interpolant stays monotone.
const fn end_slope((h0, d0): (f64, f64), (h1, d1): (f64, f64)) -> f64 {
    let slope = ((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1);
    if slope * d0 <= 0.0 {
        0.0
    } else if d0 * d1 <= 0.0 && slope.abs() > 3.0 * d0.abs() {
        3.0 * d0
    } else {
        slope
    }
}

/// The cubic through `points` with `slopes` at `mach`; the end values beyond the ends.
fn interpolated(points: &[(f64, f64)], slopes: &[f64], mach: f64) -> f64 {
    let upper = points.partition_point(|&(m, _)| m <= mach);
    if upper == 0 {
        return points[0].1;
    }
    if upper == points.len() {
        return points[points.len() - 1].1;
    }
    let i = upper - 1;
    let (width, chord) = interval(points, i);
    let t = (mach - points[i].0) / width;
    // Cubic Hermite on the interval, in the form that needs the fewest operations.
    let (m0, m1) = (slopes[i], slopes[i + 1]);
    let (c, d) = (3.0 * chord - 2.0 * m0 - m1, m0 + m1 - 2.0 * chord);
    points[i].1 + width * t * (m0 + t * (c + t * d))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_data::rows;

    /// A model, its points, and the text of the published table.
    type Standard = (DragModel, &'static [(f64, f64)], &'static str);

    const STANDARD: [Standard; 3] = [
        (DragModel::G7, &G7, include_str!("../../../data/drag_g7.csv")),
        (DragModel::G1, &G1, include_str!("../../../data/drag_g1.csv")),
        (DragModel::Sphere, &SPHERE, include_str!("../../../data/drag_sphere.csv")),
    ];

    #[test]
    fn holds_the_published_tables() {
        for (model, points, published) in STANDARD {
            let table = rows(published);
            assert_eq!(table.len(), points.len());
            for (row, &(mach, cd)) in table.iter().zip(points) {
                assert_eq!((row[0], row[1]), (mach, cd));
                assert_eq!(model.coefficient(mach), cd);
            }
        }
    }

    #[test]
    fn is_bounded_by_its_neighbours_everywhere() {
        for (model, points, _) in STANDARD {
            for pair in points.windows(2) {
                let (low, high) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
                for i in 0..=100 {
                    let mach = pair[0].0 + (pair[1].0 - pair[0].0) * f64::from(i) / 100.0;
                    let cd = model.coefficient(mach);
                    assert!(
                        (low - 1e-12..=high + 1e-12).contains(&cd),
                        "{}, mach {mach}: {cd}",
                        model.name()
                    );
                }
            }
        }
    }

    #[test]
    fn has_no_kinks() {
        for (model, points, _) in STANDARD {
            let slope = |mach: f64| (model.coefficient(mach + 5e-7) - model.coefficient(mach - 5e-7)) / 1e-6;
            for &(mach, _) in &points[1..points.len() - 1] {
                let (before, after) = (slope(mach - 1e-5), slope(mach + 1e-5));
                let name = model.name();
                assert!((before - after).abs() < 0.05, "{name}, mach {mach}: slope {before} then {after}");
            }
        }
    }

    #[test]
    fn beyond_the_table_its_ends_hold() {
        for (mach, cd) in [(-1.0, 0.1198), (9.0, 0.1618), (f64::INFINITY, 0.1618)] {
            assert_eq!(DragModel::G7.coefficient(mach), cd);
        }
        assert!(DragModel::G7.coefficient(f64::NAN).is_finite());
    }

    #[test]
    fn a_table_of_all_points_of_g7_that_it_holds_is_g7_there() {
        let given = &G7[20..20 + DragTable::MOST];
        let table = DragModel::Table(DragTable::new(given).expect("sound"));
        for i in 0..200 {
            let mach = given[1].0 + (given[DragTable::MOST - 2].0 - given[1].0) * f64::from(i) / 200.0;
            assert!((table.coefficient(mach) - DragModel::G7.coefficient(mach)).abs() < 1e-12, "mach {mach}");
        }
        let two = DragModel::Table(DragTable::new(&[(0.0, 0.1), (1.0, 0.3)]).expect("sound"));
        assert!((two.coefficient(0.5) - 0.2).abs() < 1e-12);
        for wrong in [
            &[(0.0, 0.1)][..],
            &[(0.0, 0.1), (0.0, 0.2)],
            &[(1.0, 0.1), (0.5, 0.2)],
            &[(0.0, 0.0), (1.0, 0.2)],
            &[(0.0, f64::NAN), (1.0, 0.2)],
            &G7[..=DragTable::MOST],
        ] {
            assert_eq!(DragTable::new(wrong), None, "{wrong:?}");
        }
    }
}
