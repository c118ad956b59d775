//! A depth map as the sun sees a scene (Williams 1978), drawn and looked up on the processor.

use glam::{Mat3, Vec2, Vec3};

use super::mesh::CasterMesh;

/// Axes in which the sun looks along the third, towards itself.
#[derive(Clone, Copy, Debug)]
pub struct SunAxes {
    from_world: Mat3,
}

impl SunAxes {
    /// Axes whose first lies along `along` as the sun sees it, or along `or` where that points to the sun.
    pub fn new(sun: Vec3, along: Vec3, or: Vec3) -> Self {
        let right = along.reject_from_normalized(sun).try_normalize();
        let right = right.unwrap_or_else(|| or.reject_from_normalized(sun).normalize_or(Vec3::X));
        Self { from_world: Mat3::from_cols(right, sun.cross(right), sun).transpose() }
    }

    /// A place by these axes.
    pub fn of(&self, place: Vec3) -> Vec3 {
        self.from_world * place
    }

    /// Box that holds places.
    pub fn around(&self, places: impl IntoIterator<Item = Vec3>) -> SunBox {
        let empty = SunBox { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY };
        places.into_iter().fold(empty, |b, place| {
            let p = self.of(place);
            SunBox { low: b.low.min(p), high: b.high.max(p) }
        })
    }
}

/// A box along the sun's axes, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunBox {
    /// Its lowest corner.
    pub low: Vec3,
    /// Its highest corner.
    pub high: Vec3,
}

impl SunBox {
    /// What both hold; nothing where that is empty.
    pub fn common(&self, other: &Self) -> Option<Self> {
        let (low, high) = (self.low.max(other.low), self.high.min(other.high));
        (low.cmplt(high).all()).then_some(Self { low, high })
    }

    /// What holds both.
    pub fn joined(&self, other: &Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// Whether something in the other box may stand between this one and the sun.
    pub fn is_shaded_by(&self, other: &Self) -> bool {
        let apart = self.low.max(other.low).cmpge(self.high.min(other.high));
        !apart.x && !apart.y && other.high.z > self.low.z
    }
}

/// Faces that go into a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapFaces {
    /// Far sides of closed hulls, both sides of open shells: what is lit lies before the map by the hull's own thickness.
    FarSides,
    /// All faces: the nearest to the sun remains.
    All,
}

/// Depth map: how near to the sun the nearest surface is, metres along the sun's third axis.
#[derive(Clone, Debug)]
pub struct DepthMap {
    /// Texels across and down.
    pub size: [usize; 2],
    /// Nearness, row by row; less than anything where nothing is.
    pub nearest: Vec<f32>,
    axes: SunAxes,
    /// Texels of a metre, and the texel of the axes' origin.
    scale: Vec2,
    offset: Vec2,
    /// Corners of the mesh that is drawn, in texels.
    placed: Vec<Vec3>,
    /// Texels that hold all that was drawn: from and to, across and down.
    touched: [[usize; 2]; 2],
}

impl DepthMap {
    /// A map that is fitted later, of at most `width` by `height` texels.
    pub fn with_room(width: usize, height: usize) -> Self {
        Self {
            size: [width, height],
            nearest: vec![f32::NEG_INFINITY; width * height],
            axes: SunAxes::new(Vec3::Z, Vec3::X, Vec3::Y),
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            placed: Vec::new(),
            touched: [[width, height], [0, 0]],
        }
    }

    /// Clears it and fits it to a box, with so many texels across and down.
    pub fn fit(&mut self, axes: SunAxes, around: &SunBox, size: [usize; 2]) {
        /// Texels at each edge that stay empty.
        const EDGE: f32 = 1.0;
        self.size = size;
        self.axes = axes;
        self.touched = [size, [0, 0]];
        self.nearest.clear();
        self.nearest.resize(size[0] * size[1], f32::NEG_INFINITY);
        let span = (around.high - around.low).truncate().max(Vec2::splat(1e-3));
        self.scale = (Vec2::new(size[0] as f32, size[1] as f32) - 2.0 * EDGE).max(Vec2::ONE) / span;
        self.offset = Vec2::splat(EDGE) - around.low.truncate() * self.scale;
    }

    /// Texels that hold all that was drawn: from and to, across and down. All others are empty.
    pub fn touched(&self) -> [[usize; 2]; 2] {
        self.touched
    }

    /// Metres that a texel spans, the longer way.
    pub fn texel_m(&self) -> f32 {
        self.scale.recip().max_element()
    }

    /// Texel coordinates and nearness of a place.
    pub fn at(&self, place: Vec3) -> Vec3 {
        let p = self.axes.of(place);
        (p.truncate() * self.scale + self.offset).extend(p.z)
    }

    /// Draws a mesh.
    pub fn draw(&mut self, mesh: &CasterMesh, faces: MapFaces) {
        let mut placed = std::mem::take(&mut self.placed);
        placed.clear();
        placed.extend(mesh.places.iter().map(|p| self.at(*p)));
        for (t, closed) in mesh.triangles.iter().zip(&mesh.is_closed) {
            let corners = t.map(|i| placed[i as usize]);
            self.triangle(corners, faces == MapFaces::FarSides && *closed);
        }
        self.placed = placed;
    }

    /// Draws a triangle at the texels whose middle it holds; `far_only` leaves out one that the sun lights.
    fn triangle(&mut self, [a, b, c]: [Vec3; 3], far_only: bool) {
        let (ab, ac) = (b - a, c - a);
        let area = ab.x * ac.y - ab.y * ac.x;
        if area == 0.0 || (far_only && area > 0.0) {
            return;
        }
        // Nearness at a texel's middle is a plane over the map.
        let slope = Vec2::new(ab.z * ac.y - ac.z * ab.y, ac.z * ab.x - ab.z * ac.x) / area;
        let (b, c) = if area > 0.0 { (b, c) } else { (c, b) };
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let end = |v: f32, most: usize| (v.max(0.0) as usize).min(most);
        let rows = end((low.y - 0.5).ceil(), self.size[1])..end((high.y + 0.5).floor(), self.size[1]);
        let all = end((low.x - 0.5).ceil(), self.size[0])..end((high.x + 0.5).floor(), self.size[0]);
        if rows.is_empty() || all.is_empty() {
            return;
        }
        let [from, to] = &mut self.touched;
        *from = [from[0].min(all.start), from[1].min(rows.start)];
        *to = [to[0].max(all.end), to[1].max(rows.end)];
        for y in rows {
            let middle = y as f32 + 0.5;
            let (mut from, mut to) = (low.x, high.x);
            for (p, q) in [(a, b), (b, c), (c, a)] {
                let (dx, dy) = (q.x - p.x, q.y - p.y);
                if dy == 0.0 {
                    continue;
                }
                // Counter-clockwise, the inside lies to the left of each edge.
                let x = p.x + (middle - p.y) * dx / dy;
                if dy > 0.0 { to = to.min(x) } else { from = from.max(x) }
            }
            let columns = end((from - 0.5).ceil(), self.size[0])..end((to + 0.5).floor(), self.size[0]);
            let start = y * self.size[0];
            let nearness = a.z + slope.y * (middle - a.y) - slope.x * (a.x - 0.5);
            for x in columns {
                let texel = &mut self.nearest[start + x];
                *texel = texel.max(nearness + slope.x * x as f32);
            }
        }
    }

    /// Empties the texels within a box by its axes.
    pub fn forget(&mut self, within: &SunBox) {
        let texels = |p: Vec3| p.truncate() * self.scale + self.offset;
        let (low, high) = (texels(within.low), texels(within.high));
        let end = |v: f32, most: usize| (v.max(0.0).round() as usize).min(most);
        let columns = end(low.x, self.size[0])..end(high.x, self.size[0]);
        for y in end(low.y, self.size[1])..end(high.y, self.size[1]) {
            let start = y * self.size[0];
            self.nearest[start + columns.start..start + columns.end].fill(f32::NEG_INFINITY);
        }
    }

    fn nearest_at(&self, x: i32, y: i32) -> f32 {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.size[0] && (y as usize) < self.size[1];
        if inside { self.nearest[y as usize * self.size[0] + x as usize] } else { f32::NEG_INFINITY }
    }

    /// Share of the sun at texel coordinates and nearness: the one texel there.
    pub fn compared(&self, at: Vec3) -> f32 {
        f32::from(self.nearest_at(at.x.floor() as i32, at.y.floor() as i32) <= at.z)
    }

    /// The same from the four texels about the place, weighed (Reeves, Salesin and Cook 1987).
    pub fn compared_2x2(&self, at: Vec3) -> f32 {
        let texel = at.truncate() - 0.5;
        let low = texel.floor();
        let share = texel - low;
        let (x, y) = (low.x as i32, low.y as i32);
        let lit = |dx: i32, dy: i32| f32::from(self.nearest_at(x + dx, y + dy) <= at.z);
        let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
        mix(mix(lit(0, 0), lit(1, 0), share.x), mix(lit(0, 1), lit(1, 1), share.x), share.y)
    }

    /// Percentage closer filtering (Reeves, Salesin and Cook 1987): the mean over a square of `width` by `width` texels about the place, those at its edges by as
    /// much of them as lies within.
    pub fn filtered(&self, at: Vec3, width: u32) -> f32 {
        let corner = at.truncate() - 0.5 * width as f32;
        let low = corner.floor();
        let share = corner - low;
        let weight = |i: u32, share: f32| match i {
            0 => 1.0 - share,
            i if i == width => share,
            _ => 1.0,
        };
        let mut sum = 0.0;
        for j in 0..=width {
            let mut row = 0.0;
            for i in 0..=width {
                let texel = self.nearest_at(low.x as i32 + i as i32, low.y as i32 + j as i32);
                row += weight(i, share.x) * f32::from(texel <= at.z);
            }
            sum += weight(j, share.y) * row;
        }
        sum / (width * width) as f32
    }

    /// Bytes that it holds.
    pub fn bytes(&self) -> usize {
        self.nearest.capacity() * size_of::<f32>() + self.placed.capacity() * size_of::<Vec3>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_fill_the_texels_whose_middles_they_hold_and_nothing_else() {
        let mut map = DepthMap::with_room(8, 8);
        let (a, b, c) = (Vec3::new(1.0, 1.0, 2.0), Vec3::new(7.0, 1.0, 8.0), Vec3::new(1.0, 7.0, 2.0));
        map.triangle([a, b, c], false);
        for y in 0..8 {
            for x in 0..8 {
                let (px, py) = (x as f32 + 0.5, y as f32 + 0.5);
                let inside = px > 1.0 && py > 1.0 && (px - 1.0) + (py - 1.0) <= 6.0;
                let found = map.nearest[y * 8 + x];
                if inside {
                    assert!((found - (px + 1.0)).abs() < 1e-5, "{x} {y}: {found}");
                } else {
                    assert_eq!(found, f32::NEG_INFINITY, "{x} {y}");
                }
            }
        }
        // The sun sees it counter-clockwise: it is no far side.
        let mut far = DepthMap::with_room(8, 8);
        far.triangle([a, b, c], true);
        assert!(far.nearest.iter().all(|n| *n == f32::NEG_INFINITY));
        far.triangle([a, c, b], true);
        assert_eq!(far.nearest, map.nearest);
    }

    #[test]
    fn what_lies_behind_the_map_is_dark_and_at_its_edge_half() {
        let mut map = DepthMap::with_room(16, 16);
        let corners = [[0.0, 0.0], [8.0, 0.0], [8.0, 16.0], [0.0, 16.0]].map(|[x, y]| Vec3::new(x, y, 5.0));
        map.triangle([corners[0], corners[1], corners[2]], false);
        map.triangle([corners[0], corners[2], corners[3]], false);
        let at = |x: f32, z: f32| Vec3::new(x, 8.0, z);
        assert_eq!(
            [map.compared(at(4.0, 4.0)), map.compared(at(4.0, 6.0)), map.compared(at(12.0, 4.0))],
            [0.0, 1.0, 1.0]
        );
        assert!((map.compared_2x2(at(8.0, 4.0)) - 0.5).abs() < 1e-6);
        assert!((map.filtered(at(8.0, 4.0), 3) - 0.5).abs() < 1e-6);
        assert!(map.filtered(at(7.0, 4.0), 3) > 0.0 && map.compared_2x2(at(7.0, 4.0)) == 0.0);
    }
}
