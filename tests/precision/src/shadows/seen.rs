//! What the eye sees, found once by rays and given to every method alike.

use glam::Vec3;

/// A place that a pixel shows.
#[derive(Clone, Copy, Debug)]
pub struct SeenPoint {
    /// Its number among all points.
    pub number: u32,
    /// Which mesh it lies on; [`SeenPoint::GROUND`] for none.
    pub mesh: u32,
    /// Metres about the frame's origin.
    pub place: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Right, down and ahead from the eye, the last of them 1.
    pub ray: Vec3,
    /// Distance ahead, metres.
    pub depth: f32,
}

impl SeenPoint {
    /// Mesh number of what belongs to no mesh.
    pub const GROUND: u32 = u32::MAX;
}

/// All that is seen within a part of the picture, pixel by pixel.
#[derive(Clone, Debug, Default)]
pub struct SeenPoints {
    /// Left upper corner of that part, pixels.
    pub corner: [u32; 2],
    /// Its width and height, pixels.
    pub size: [u32; 2],
    /// Number of the first point of each pixel, row by row, and after the last of them of how many there are.
    pub first: Vec<u32>,
    /// Points.
    pub points: Vec<SeenPoint>,
    /// Where the axis of view meets the picture, and the pixels of a tangent of 1, across and down.
    pub lens: [[f32; 2]; 2],
}

impl SeenPoints {
    /// An empty part of a picture whose pixels are to follow row by row.
    pub fn begin(corner: [u32; 2], size: [u32; 2], lens: [[f32; 2]; 2]) -> Self {
        Self { corner, size, first: vec![0], points: Vec::new(), lens }
    }

    /// Ends a pixel: the next points are those of the one after it.
    pub fn end_pixel(&mut self) {
        self.first.push(self.points.len() as u32);
    }

    /// Adds a point to the present pixel; its number is set here.
    pub fn push(&mut self, point: SeenPoint) {
        let number = self.points.len() as u32;
        self.points.push(SeenPoint { number, ..point });
    }

    /// Numbers of the points of a pixel of the part, counted from its corner.
    pub fn of_pixel(&self, x: u32, y: u32) -> std::ops::Range<usize> {
        let pixel = (y * self.size[0] + x) as usize;
        self.first[pixel] as usize..self.first[pixel + 1] as usize
    }
}
