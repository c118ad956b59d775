//! The camera of a picture: lens, height, and how it was held.

use glam::{DMat3, DQuat, DVec2, DVec3};

use bowwave_core::{
    frame::view::ViewFrustum,
    geometry::{CameraPose, Distortion, EARTH_RADIUS_M, Lens, REFRACTION, horizon_dip, look},
    text::toml::{TomlError, TomlPlace},
};

/// Diagonal of a 35 mm film frame, millimetres: what "35 mm equivalent" focal lengths count from (CIPA DCG-001).
const FILM_DIAGONAL_MM: f64 = 43.266_615_3;

/// Least distance of two points of the horizon, as a share of the picture's width.
const HORIZON_SHARE: f64 = 0.1;

/// How the focal length is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Focal {
    /// Pixels.
    Pixels(f64),
    /// Horizontal field of view, radians.
    Across(f64),
    /// 35 mm equivalent, millimetres: the focal length at which a frame with a diagonal of 43.27 mm shows as much.
    Film(f64),
    /// As the picture tells.
    OfPicture,
}

/// A 35 mm equivalent focal length in pixels of a picture.
pub fn film_focal_px(film_mm: f64, (width, height): (u32, u32)) -> f64 {
    film_mm / FILM_DIAGONAL_MM * f64::from(width).hypot(f64::from(height))
}

/// How the camera was held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StillAttitude {
    /// Radians above the horizontal, and clockwise.
    Given {
        /// Upwards.
        pitch: f64,
        /// Clockwise.
        roll: f64,
    },
    /// Two points of the sea's horizon, pixels.
    Horizon([DVec2; 2]),
}

/// The camera.
#[derive(Clone, Debug, PartialEq)]
pub struct StillCamera {
    /// Height over the mean sea, metres.
    pub eye_height_m: f64,
    /// Focal length.
    pub focal: Focal,
    /// Principal point, pixels; `None` for the picture's middle.
    pub centre: Option<DVec2>,
    /// Radial coefficients k1, k2 as in [`Distortion`].
    pub radial: DVec2,
    /// Tangential coefficients p1, p2 as in [`Distortion`].
    pub tangential: DVec2,
    /// Where the middle of the picture lies, radians clockwise from north.
    pub azimuth: f64,
    /// How it was held.
    pub attitude: StillAttitude,
    pub(super) focal_at: TomlPlace,
    pub(super) attitude_at: TomlPlace,
}

impl StillCamera {
    /// The lens of a picture of that size.
    pub(super) fn lens(&self, (width, height): (u32, u32), own_px: Option<f64>) -> Result<Lens, TomlError> {
        let size = DVec2::new(f64::from(width), f64::from(height));
        let refuse = |problem: String| Err(self.focal_at.clone().of_key("camera.focal_px").error(problem));
        let focal = match self.focal {
            Focal::Pixels(px) => px,
            Focal::Across(angle) => size.x / 2.0 / (angle / 2.0).tan(),
            Focal::Film(mm) => film_focal_px(mm, (width, height)),
            Focal::OfPicture => match own_px {
                Some(px) => px,
                None => {
                    return refuse(
                        "is missing, and the picture does not tell it; give focal_35mm_mm, hfov_deg or focal_px \
                         (a telephone's main camera has about focal_35mm_mm = 26)"
                            .to_owned(),
                    );
                }
            },
        };
        let across = 2.0 * (size.x / 2.0 / focal).atan();
        if !(0.2..=150.0).contains(&across.to_degrees()) {
            return refuse(format!(
                "makes a field of view of {:.2} degrees in a picture of {width}x{height}; it must be 0.2 to 150 degrees",
                across.to_degrees()
            ));
        }
        let centre = self.centre.unwrap_or(size / 2.0);
        if centre.cmplt(DVec2::ZERO).any() || centre.cmpgt(size).any() {
            let problem = format!("{} lies outside the picture of {width}x{height}", pair(centre));
            return Err(self.focal_at.clone().of_key("camera.centre_px").error(problem));
        }
        Ok(Lens {
            width,
            height,
            focal: DVec2::splat(focal),
            centre,
            distortion: Distortion::radial_tangential(self.radial, self.tangential),
            row_turn: DVec3::ZERO,
        })
    }

    /// Where the camera stands and looks.
    pub(super) fn pose(&self, lens: &Lens) -> Result<CameraPose, TomlError> {
        let position = DVec3::new(0.0, 0.0, self.eye_height_m);
        let world_from_camera = match self.attitude {
            StillAttitude::Given { pitch, roll } => look(self.azimuth, pitch, roll),
            StillAttitude::Horizon(points) => self.levelled_by(lens, points)?,
        };
        Ok(CameraPose { world_from_camera, position })
    }

    /// Both points lie the horizon's dip below the horizontal: that gives the vertical in the camera's space.
    fn levelled_by(&self, lens: &Lens, points: [DVec2; 2]) -> Result<DQuat, TomlError> {
        let refuse = |problem: String| Err(self.attitude_at.clone().of_key("camera.horizon").error(problem));
        let size = DVec2::new(f64::from(lens.width), f64::from(lens.height));
        for point in points {
            if point.cmplt(DVec2::ZERO).any() || point.cmpgt(size).any() {
                let (w, h) = (lens.width, lens.height);
                return refuse(format!("{} lies outside the picture of {w}x{h}", pair(point)));
            }
        }
        if points[0].distance(points[1]) < HORIZON_SHARE * size.x {
            return refuse(format!(
                "the two points are {:.0} pixels apart; take points farther apart than a tenth of the picture's width",
                points[0].distance(points[1])
            ));
        }
        let rays = points.map(|p| lens.unproject(p));
        // up = along * (r1 + r2) + across * n with r1 . up = r2 . up = -sin(dip) and |up| = 1.
        let sum = rays[0] + rays[1];
        let normal = rays[0].cross(rays[1]).normalize();
        let along = -horizon_dip(self.eye_height_m).sin() / (1.0 + rays[0].dot(rays[1]));
        let across = (1.0 - along * along * sum.length_squared()).max(0.0).sqrt();
        // The camera's y axis points down.
        let up = along * sum - across * normal * normal.y.signum();
        let level = DVec3::Z - up * up.z;
        let Some(ahead) = level.try_normalize().filter(|_| up.is_finite() && level.length() > 0.05) else {
            return refuse("the camera would look straight up or down; check the two points".to_owned());
        };
        let right = ahead.cross(up);
        let camera_from_level = DMat3::from_cols(right, ahead, up);
        Ok(DQuat::from_rotation_z(-self.azimuth) * DQuat::from_mat3(&camera_from_level.transpose()))
    }
}

/// World x and y of the water that is seen on `pixel`: where its line of sight meets the curved sea.
pub(super) fn on_the_sea(eye: &ViewFrustum<'_>, pixel: DVec2) -> Result<DVec2, String> {
    let (width, height) = (eye.lens.width, eye.lens.height);
    let size = DVec2::new(f64::from(width), f64::from(height));
    if pixel.cmplt(DVec2::ZERO).any() || pixel.cmpgt(size).any() {
        return Err(format!("{} lies outside the picture of {width}x{height}", pair(pixel)));
    }
    let ray = eye.camera.world_from_camera * eye.lens.unproject(pixel);
    let level = ray.truncate().length();
    // Height of the line of sight over the sea at a distance s: h + s tan(elevation) + k s^2.
    let (h, t) = (eye.camera.position.z, ray.z / level.max(1e-9));
    let k = (1.0 - REFRACTION) / (2.0 * EARTH_RADIUS_M);
    let root = t * t - 4.0 * k * h;
    if t >= 0.0 || root < 0.0 {
        return Err(format!("{} lies above the sea's horizon; give a point of the water", pair(pixel)));
    }
    let distance_m = 2.0 * h / (root.sqrt() - t);
    if distance_m > super::RANGE_MAX_M {
        let at_most = super::RANGE_MAX_M;
        return Err(format!("{} is {distance_m:.0} m away, farther than {at_most} m", pair(pixel)));
    }
    Ok(ray.truncate() / level.max(1e-9) * distance_m)
}

fn pair(p: DVec2) -> String {
    format!("[{}, {}]", p.x, p.y)
}
