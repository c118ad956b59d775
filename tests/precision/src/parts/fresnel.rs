//! Reflectance of the water.

use anyhow::{Result, ensure};
use bowwave_core::sea::{SEA_INDEX, fresnel};

use super::{About, table, worst};
use crate::bench::{ExtremeResult, PartBench, Way};

/// Description of this part.
pub const ABOUT: About = About {
    part: "fresnel",
    what: "Share of light that the sea's surface reflects by the angle of view.",
    truth: "Fresnel's sine and tangent laws in f64, another form than the product's; both are held against \
            data/fresnel_seawater.csv, which was made elsewhere",
    rivals: "a constant, Schlick's power, Schlick's power with the exponent fitted to water, polynomials of the cosine fitted at \
             Chebyshev points, a table with linear interpolation, the exact form in f32",
    why: "the exact form costs one square root and three divisions; Schlick errs by a fifth between 40 and 60 degrees, the view \
          of nearby water",
};

const TABLE: &str = include_str!("../../data/fresnel_seawater.csv");

/// The laws of sines and tangents, which need the angles themselves.
fn truth(cos: f64) -> f64 {
    let incidence = cos.clamp(0.0, 1.0).acos();
    if incidence < 1e-6 {
        return ((SEA_INDEX - 1.0) / (SEA_INDEX + 1.0)).powi(2);
    }
    let inside = (incidence.sin() / SEA_INDEX).asin();
    let s = (incidence - inside).sin() / (incidence + inside).sin();
    let p = (incidence - inside).tan() / (incidence + inside).tan();
    0.5 * (s * s + p * p)
}

fn normal() -> f64 {
    ((SEA_INDEX - 1.0) / (SEA_INDEX + 1.0)).powi(2)
}

fn exact_f32(cos: f64) -> f64 {
    let (c, n2) = (cos.max(0.0) as f32, (SEA_INDEX * SEA_INDEX) as f32);
    let inside = (n2 - 1.0 + c * c).sqrt();
    let s = (c - inside) / (c + inside);
    let p = (n2 * c - inside) / (n2 * c + inside);
    f64::from(0.5 * (s * s + p * p))
}

/// Coefficients of the polynomial through the truth at Chebyshev points of the cosine, by Newton's divided differences.
struct Polynomial {
    at: Vec<f64>,
    coefficients: Vec<f64>,
}

impl Polynomial {
    fn fitted(degree: usize) -> Self {
        let n = degree + 1;
        let at: Vec<f64> =
            (0..n).map(|i| 0.5 + 0.5 * ((i as f64 + 0.5) / n as f64 * std::f64::consts::PI).cos()).collect();
        let mut coefficients: Vec<f64> = at.iter().map(|c| truth(*c)).collect();
        for order in 1..n {
            for i in (order..n).rev() {
                coefficients[i] = (coefficients[i] - coefficients[i - 1]) / (at[i] - at[i - order]);
            }
        }
        Self { at, coefficients }
    }

    fn at(&self, cos: f64) -> f64 {
        let terms = self.coefficients.iter().zip(&self.at).rev();
        terms.fold(0.0, |sum, (c, x)| sum * (cos - x) + c)
    }
}

/// A table over the cosine, linear between its steps.
struct StepTable(Vec<f32>);

impl StepTable {
    fn of(count: usize) -> Self {
        Self((0..=count).map(|i| truth(i as f64 / count as f64) as f32).collect())
    }

    fn at(&self, cos: f64) -> f64 {
        let x = cos as f32 * (self.0.len() - 1) as f32;
        let i = (x as usize).min(self.0.len() - 2);
        f64::from(self.0[i] + (self.0[i + 1] - self.0[i]) * (x - i as f32))
    }
}

fn cosines(count: usize, from: f64, to: f64) -> Vec<f64> {
    (0..count).map(|i| from + (to - from) * (i as f64 + 0.5) / count as f64).collect()
}

/// An extreme case: its name, from which cosine to which.
type CosineCase = (&'static str, f64, f64);

/// A grazing angle of 0.05 degrees has a cosine of 8.7e-4.
const CASES: [CosineCase; 4] = [
    ("grazing, 0 to 0.05 deg above the water", 0.0, 8.73e-4),
    ("40 to 60 deg, Brewster's angle within", 0.5, 0.766),
    ("normal view, 0 to 1 deg", 0.999_85, 1.0),
    ("cosines that rounding left outside 0 to 1", -1e-7, 0.0),
];

/// Ways and what they made of the extreme cases.
struct FresnelWays<'a> {
    views: &'a [f64],
    used: &'a [f64],
    ways: Vec<Way<'a>>,
    tried: [Vec<ExtremeResult>; CASES.len()],
}

impl<'a> FresnelWays<'a> {
    fn add(&mut self, method: &str, setting: &str, bytes: usize, f: impl Fn(f64) -> f64 + 'a) {
        let worst_of = |views: &[f64]| worst(views.iter().map(|c| (f(*c) - truth(*c)).abs()));
        let default = method == "exact" && setting == "f64";
        for ((_, from, to), tried) in CASES.iter().zip(&mut self.tried) {
            let error = worst_of(&cosines(501, *from, *to));
            tried.push(ExtremeResult { default, ..ExtremeResult::rival(method, setting, error) });
        }
        let error = worst_of(self.views);
        let used = self.used;
        let work = move || used.iter().map(|c| f(*c)).sum::<f64>();
        let way = Way::new(method, setting, error, used.len(), work);
        self.ways.push(way.holds(bytes).default_if(default));
    }
}

/// Measures the scene and extreme cases.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    for row in table(TABLE) {
        let cos = row[0].to_radians().cos();
        let (by_laws, by_product) = (truth(cos), fresnel(cos));
        // The table has eight digits, its angles five.
        ensure!((by_laws - row[3]).abs() < 2e-7, "truth {by_laws} at {} deg, table {}", row[0], row[3]);
        ensure!(
            (by_product - row[3]).abs() < 2e-7,
            "product {by_product} at {} deg, table {}",
            row[0],
            row[3]
        );
    }
    let (views, used) = (cosines(4096, 0.0, 1.0), cosines(256, 0.0, 1.0));
    let mut all = FresnelWays { views: &views, used: &used, ways: Vec::new(), tried: Default::default() };
    all.add("constant", "at normal view", 0, |_| normal());
    all.add("Schlick", "power 5", 0, |c| {
        let x = 1.0 - c;
        normal() + (1.0 - normal()) * (x * x) * (x * x) * x
    });
    all.add("Schlick", "power 5.6", 0, |c| normal() + (1.0 - normal()) * (1.0 - c).max(0.0).powf(5.6));
    for degree in [4, 8, 12] {
        let p = Polynomial::fitted(degree);
        let bytes = (degree + 1) * 2 * size_of::<f64>();
        all.add("polynomial", &format!("degree {degree}"), bytes, move |c| p.at(c));
    }
    for count in [64, 1024] {
        let steps = StepTable::of(count);
        all.add("table", &format!("{count} steps"), (count + 1) * size_of::<f32>(), move |c| steps.at(c));
    }
    all.add("exact", "f32", 0, exact_f32);
    all.add("exact", "f64", 0, fresnel);
    // Near normal view the laws of sines and tangents divide near zeros.
    bench.scene("all angles", "reflectance", 1e-13, all.ways);
    for ((case, ..), tried) in CASES.into_iter().zip(all.tried) {
        bench.extreme(case, "reflectance", tried);
    }
    Ok(())
}
