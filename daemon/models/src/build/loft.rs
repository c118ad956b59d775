//! Hulls from a lines plan: fore-and-aft curves (keel, chine, sheer, rail, ...) that sections are drawn through.

use glam::Vec3;

use super::{
    paint::Paint,
    solid::{Solid, key},
};

/// Control points of a hull's lines: x, y to port and z up, metres, from the stern to the stem.
pub(crate) type Offsets<const LINES: usize, const POINTS: usize> = [[[f32; 3]; POINTS]; LINES];

/// Reads a table of offsets when the program is built: comments begin with `#`, a line of the hull begins with its name, and the
/// numbers of its control points follow. A table of another size does not compile.
pub(crate) const fn offsets<const LINES: usize, const POINTS: usize>(text: &str) -> Offsets<LINES, POINTS> {
    let bytes = text.as_bytes();
    let mut table = [[[0.0; 3]; POINTS]; LINES];
    let (mut at, mut count) = (0, 0);
    while at < bytes.len() {
        match bytes[at] {
            b'#' => {
                while at < bytes.len() && bytes[at] != b'\n' {
                    at += 1;
                }
            }
            b'-' | b'0'..=b'9' => {
                assert!(count < LINES * POINTS * 3, "the table has more points than its hull");
                let (value, end) = decimal(bytes, at);
                table[count / (POINTS * 3)][count / 3 % POINTS][count % 3] = value;
                (at, count) = (end, count + 1);
            }
            _ => at += 1,
        }
    }
    assert!(count == LINES * POINTS * 3, "the table has fewer points than its hull");
    table
}

/// The decimal number that begins at `at`, and where it ends.
const fn decimal(bytes: &[u8], mut at: usize) -> (f32, usize) {
    let negative = bytes[at] == b'-';
    at += negative as usize;
    let (mut digits, mut scale, mut broken) = (0u32, 1u32, false);
    while at < bytes.len() && (bytes[at].is_ascii_digit() || bytes[at] == b'.') {
        if bytes[at] == b'.' {
            broken = true;
        } else {
            digits = digits * 10 + (bytes[at] - b'0') as u32;
            scale *= if broken { 10 } else { 1 };
        }
        at += 1;
    }
    // Both are whole numbers below 2^53, so that the quotient is the nearest number to what is written.
    let value = digits as f64 / scale as f64;
    ((if negative { -value } else { value }) as f32, at)
}

/// `line` moved outwards (inwards where negative) and up; its points in the centre plane move forward by `ahead` instead.
pub(crate) fn beside<const POINTS: usize>(
    line: &[[f32; 3]; POINTS],
    out: f32,
    up: f32,
    ahead: f32,
) -> [[f32; 3]; POINTS] {
    line.map(|[x, y, z]| if y > 0.0 { [x, y + out, z + up] } else { [x + ahead, y, z + up] })
}

/// A lines plan: fore-and-aft curves of the port half, from the keel outwards and up, then inwards; the first and the last lie in the
/// centre plane.
pub(crate) struct LinesPlan<'a> {
    /// x, y (to port), z of each control point of each line, from the stern to the stem; every line has as many.
    pub(crate) lines: &'a [&'a [[f32; 3]]],
    /// The lines at which sections have no corner.
    pub(crate) round: &'a [usize],
    /// Rows of faces between each line and the next.
    pub(crate) rows: &'a [usize],
    /// Paints of those rows, each with the number of lines that it begins at.
    pub(crate) paints: &'a [(Paint, usize)],
    /// Sections between two control points that are not close together.
    pub(crate) steps: usize,
    /// Faces that meet at more than this stay hard, degrees.
    pub(crate) crease: f32,
    /// Paint of the transom.
    pub(crate) transom: Paint,
}

impl LinesPlan<'_> {
    /// The closed surface of both halves.
    pub(crate) fn build(&self) -> Solid {
        let sections = self.sections();
        let paints = self.row_paints();
        let mut hull = Solid::new(self.crease);
        for pair in sections.windows(2) {
            for (row, paint) in paints.iter().enumerate() {
                let [a, b, c, d] = [pair[0][row], pair[1][row], pair[1][row + 1], pair[0][row + 1]];
                hull.quad([a, d, c, b], *paint);
                hull.quad([a, b, c, d].map(to_starboard), *paint);
            }
        }
        if let (Some(aft), Some(fore)) = (sections.first(), sections.last()) {
            close(&mut hull, aft, true, self.transom);
            close(&mut hull, fore, false, self.transom);
        }
        hull
    }

    /// Sections of the port half from the stern forward, points from the keel outwards.
    fn sections(&self) -> Vec<Vec<Vec3>> {
        let count = self.lines.iter().map(|l| l.len()).min().unwrap_or(0);
        let steps: Vec<usize> = (0..count.saturating_sub(1)).map(|i| self.steps_after(i)).collect();
        let lines: Vec<Vec<Vec3>> = self.lines.iter().map(|l| sample_line(&l[..count], &steps)).collect();
        let stations = lines.first().map_or(0, Vec::len);
        (0..stations)
            .map(|s| {
                let through: Vec<Vec3> = lines.iter().map(|l| l[s]).collect();
                self.sample_section(&through)
            })
            .collect()
    }

    /// Bulkheads and transoms are short; only real lengths of hull are divided.
    fn steps_after(&self, i: usize) -> usize {
        let at = |l: &[[f32; 3]], i: usize| Vec3::from_array(l[i]);
        let length = self
            .lines
            .first()
            .map_or(0.0, |l| l.last().map_or(0.0, |&last| Vec3::from_array(last).distance(at(l, 0))));
        let fore_and_aft = self.lines.iter().map(|l| (at(l, i + 1).x - at(l, i).x).abs()).fold(0.0, f32::max);
        if fore_and_aft < 0.03 * length { 1 } else { self.steps }
    }

    fn sample_section(&self, through: &[Vec3]) -> Vec<Vec3> {
        let corner = |i: usize| !self.round.contains(&i);
        let mut out = Vec::new();
        for (i, &rows) in self.rows.iter().enumerate().take(through.len().saturating_sub(1)) {
            for row in 0..rows {
                let mut p = spline(through, i, row as f32 / rows as f32, corner);
                p.y = p.y.max(0.0);
                out.push(p);
            }
        }
        out.extend(through.last());
        out
    }

    fn row_paints(&self) -> Vec<Paint> {
        let paints = self.paints.iter().flat_map(|&(paint, lines)| std::iter::repeat_n(paint, lines));
        let all_but_last = self.rows.split_last().map_or(&[][..], |(_, rest)| rest);
        paints.zip(all_but_last).flat_map(|(paint, &rows)| std::iter::repeat_n(paint, rows)).collect()
    }
}

/// A line sampled `steps[i]` times after each control point `i`. Where a line repeats a point it runs on smoothly; where it
/// jumps between two points at one x, as decks do at a bulkhead, it has a corner at both.
fn sample_line(points: &[[f32; 3]], steps: &[usize]) -> Vec<Vec3> {
    let p: Vec<Vec3> = points.iter().map(|&p| Vec3::from_array(p)).collect();
    let jump = |i: usize| {
        let step = p.get(i + 1).map_or(Vec3::ZERO, |next| *next - p[i]);
        step.x.abs() < 0.5 * step.length()
    };
    let corner = |i: usize| jump(i) || i.checked_sub(1).is_some_and(jump);
    let mut out = Vec::new();
    for (i, &steps) in steps.iter().enumerate() {
        out.extend((0..steps).map(|step| spline(&p, i, step as f32 / steps as f32, corner)));
    }
    out.extend(p.last());
    out
}

/// Point at `t` between control points `i` and `i + 1`: cubic Hermite with chord-limited Catmull-Rom slopes, so that
/// uneven spacing makes no loops; straight towards corners and ends.
fn spline(p: &[Vec3], i: usize, t: f32, corner: impl Fn(usize) -> bool) -> Vec3 {
    let (a, b) = (p[i], p[i + 1]);
    let chord = b - a;
    let slope = |k: usize| {
        let before = p[..k].iter().rev().find(|q| **q != p[k]);
        let after = p[k + 1..].iter().find(|q| **q != p[k]);
        let (Some(&before), Some(&after), false) = (before, after, corner(k)) else { return chord };
        let (before, after) = (p[k] - before, after - p[k]);
        let (lb, la) = (before.length(), after.length());
        // Slope per metre at the corner (non-uniform Catmull-Rom), times this chord's length.
        (before / lb * la + after / la * lb) / (la + lb) * chord.length()
    };
    let (m0, m1) = (slope(i), slope(i + 1));
    let (t2, t3) = (t * t, t * t * t);
    a * (2.0 * t3 - 3.0 * t2 + 1.0) + m0 * (t3 - 2.0 * t2 + t) + b * (3.0 * t2 - 2.0 * t3) + m1 * (t3 - t2)
}

fn to_starboard(p: Vec3) -> Vec3 {
    Vec3::new(p.x, -p.y, p.z)
}

/// Closes an end: the section with its mirror image is a polygon seen along x. An end that lies in the centre plane has no
/// area and needs nothing.
fn close(hull: &mut Solid, section: &[Vec3], aft: bool, paint: Paint) {
    // From the keel up to port, down to starboard: clockwise seen from astern, counter-clockwise from ahead.
    let starboard = section.iter().rev().map(|&p| to_starboard(p));
    let mut polygon: Vec<Vec3> = section.iter().copied().chain(starboard).collect();
    polygon.dedup_by_key(|p| key(*p));
    if polygon.len() > 1 && polygon.first().map(|p| key(*p)) == polygon.last().map(|p| key(*p)) {
        polygon.pop();
    }
    while let Some(ear) = best_ear(&polygon) {
        let [a, b, c] = corners_at(&polygon, ear);
        if aft {
            hull.tri(a, c, b, paint)
        } else {
            hull.tri(a, b, c, paint)
        }
        polygon.remove(ear);
    }
}

fn corners_at(polygon: &[Vec3], i: usize) -> [Vec3; 3] {
    let n = polygon.len();
    [polygon[(i + n - 1) % n], polygon[i], polygon[(i + 1) % n]]
}

/// Twice the area of a triangle seen along -x, positive where it runs counter-clockwise.
fn area_from_ahead([a, b, c]: [Vec3; 3]) -> f32 {
    (b.y - a.y) * (c.z - a.z) - (c.y - a.y) * (b.z - a.z)
}

/// The corner whose cutting off leaves the best-shaped triangle; none where no area is left.
fn best_ear(polygon: &[Vec3]) -> Option<usize> {
    if polygon.len() < 3 {
        return None;
    }
    let shape = |i: usize| {
        let t @ [a, b, c] = corners_at(polygon, i);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        let area = area_from_ahead(t);
        let holds = |p: Vec3| {
            let outside = [[a, b, p], [b, c, p], [c, a, p]].into_iter().any(|e| area_from_ahead(e) < 0.0);
            !t.contains(&p) && !outside
        };
        (area > 1e-6 && !polygon.iter().any(|&p| holds(p))).then_some(area / longest)
    };
    let ears = (0..polygon.len()).filter_map(|i| Some((i, shape(i)?)));
    ears.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// A path with a radius at each point, drawn smoothly through its points with `steps` pieces between two of them.
pub(crate) fn smooth(path: &[(Vec3, f32)], steps: usize) -> Vec<(Vec3, f32)> {
    let points: Vec<Vec3> = path.iter().map(|p| p.0).collect();
    let mut out = Vec::new();
    for (i, pair) in path.windows(2).enumerate() {
        out.extend((0..steps).map(|step| {
            let t = step as f32 / steps as f32;
            (spline(&points, i, t, |_| false), pair[0].1 + (pair[1].1 - pair[0].1) * t)
        }));
    }
    out.extend(path.last());
    out
}
