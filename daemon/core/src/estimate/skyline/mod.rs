//! Sky line, coast and clouds followed from picture to picture: by how much the believed heading is off.
//!
//! Points above the horizon are chosen where the picture has texture, spread over it (`corners`, `grid`), and keep the direction in the
//! world that they had when they were taken. In each picture they are sought where the believed orientation and the lens put them
//! (`patch`, on a pyramid of the reduced picture), always against how they looked when they were taken, so that nothing adds up from picture to
//! picture. The turn that most of them agree on (`fit`) is by how much the world as it is believed lies off the world of the anchor: the
//! picture whose orientation was believed without question. Points that are lost are replaced by others whose directions come from that turn; what
//! this errs by is counted.
//!
//! Wind carries clouds, and the less of that is seen the nearer they are to the horizon (`wind`): points at several elevations tell wind from
//! turn, and the turn is what is left where nothing of the wind is seen. Points at the sky line may be coast, which stands, or goes by as
//! the ship passes it; each goes with clouds or coast as fits it better. What this leaves open grows with the anchor's age and is said as a
//! rate of its own: few points, or points that are all equally high, leave most of it.

mod corners;
mod fit;
mod grid;
mod patch;
mod pyramid;
mod turn;
mod wind;

use glam::{DMat2, DMat3, DQuat, DVec2, DVec3};

use crate::{
    event::Picture,
    geometry::{Lens, horizon_dip, rotation_vector, turn_about_vertical},
    own_ship::Mask,
    time::Time,
};
use fit::{SkyTrack, SkylineFit, SkylinePrior};
use grid::{FIELD, FieldGrid};
use patch::HALF;
use pyramid::LEVELS;
use wind::{Wind, carried, nearness};

pub use patch::{PatchMatch, SkyPatch};
pub use pyramid::GreyPyramid;
pub use turn::{TurnFinder, TurnSeen};

/// For each point that is followed in a picture, so many are remembered, those out of view included.
const KEPT: usize = 3;
/// Fewer that agree are chance.
const POINTS_LEAST: usize = 7;
/// Where fewer than this share of the points agree, others are sought.
const FEW: f64 = 0.75;
/// Fields that are searched for others in one picture; an anchor searches all.
const FIELDS_A_LOOK: usize = 12;
/// A patch that looks less like itself than this is not it.
const LIKENESS_MIN: f32 = 0.7;
/// One that looks less like itself than this is taken anew where it is: clouds change their shape within seconds.
const LIKENESS_RENEW: f32 = 0.8;
/// Looks in a row that a point may be missed in.
const MISSES_MAX: u8 = 3;
/// A point that was out of view for longer than this is forgotten.
const KEPT_NS: i64 = 60_000_000_000;
/// An anchor that its points do not show for this long is lost.
const LOST_NS: i64 = 1_500_000_000;
/// A heading less certain than this is none, radians.
const SIGMA_MAX: f64 = 0.3 * std::f64::consts::PI / 180.0;
/// What a prediction may be off by in a level's pixels for it to be the coarsest that is looked at.
const FORETOLD_PX: f64 = 2.0;
/// Distance over which a patch's turn and stretch are told, pixels of the finest level.
const STRETCH_PX: f64 = HALF as f64;
/// A point that was tied in counts in full after so long: what moves by itself is found out before, seconds.
const TRUSTED_S: f64 = 2.0;
/// Drifts at the horizon that are no clouds', rad/s.
const DRIFTS: [f64; 2] = [1e-7, 1e-2];
/// Smallest picture, in fields.
const FIELDS_MIN: (usize, usize) = (4, 2);

/// Prior knowledge about a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkyView {
    /// The camera's lens; where it is given for another size than the picture has, it is scaled.
    pub lens: Lens,
    /// Height of the eye above the sea, metres.
    pub eye_height_m: f64,
    /// The believed orientation at the picture's exposure.
    pub world_from_camera: DQuat,
    /// By how much its change since the last look may be wrong about any axis, radians.
    pub sigma: f64,
    /// How fast clouds or coast at the horizon may drift by themselves (standard deviation), rad/s.
    pub drift: f64,
}

/// The heading, held against the anchor's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct YawSeen {
    /// The picture's time.
    pub time: Time,
    /// Time of the picture whose orientation is the anchor; equal to `time` where this one has become it.
    pub anchor: Time,
    /// By which the believed heading must be turned, counter-clockwise from above, radians.
    pub off: f64,
    /// Standard deviation of `off`, radians: of the sights, of their drift, and of what points that were tied in later err by.
    pub sigma: f64,
    /// Standard deviation of a rate at which `off` may grow by itself, rad/s: of what the sky leaves open of its own drift.
    pub drift_sigma: f64,
    /// Wind as clouds show it, heights of theirs a second towards x and y of the anchor's world, and its standard deviation on an axis.
    pub wind: (DVec2, f64),
    /// The whole turn from the believed world to the anchor's, a rotation vector in the world, radians.
    pub turn: DVec3,
    /// Covariance of the whole turn's error, of the sights alone, rad^2.
    pub covariance: DMat3,
    /// Points that agree, and points that were sought.
    pub points: (usize, usize),
    /// Standard deviation of a sight on an axis, pixels of the picture.
    pub scatter_px: f64,
}

impl YawSeen {
    /// Whether this picture has become the anchor: what was held against the one before ends.
    pub fn is_anchor(&self) -> bool {
        self.anchor == self.time
    }
}

/// Why there is no heading.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoYaw {
    /// Lens or orientation are no numbers, or of no lens.
    #[error("lens or orientation make no sense")]
    Senseless,
    /// The picture is too small.
    #[error("the picture is too small")]
    TooSmall,
    /// No part of the picture is above the horizon.
    #[error("there is no sky in view")]
    NoSky,
    /// There is nothing in the sky that could be followed.
    #[error("only {points} points of the sky have texture")]
    Featureless {
        /// Points that could be followed.
        points: usize,
    },
    /// Points are not found again: blur, fog, glare, or something before them.
    #[error("only {found} of {sought} points are found again")]
    Missed {
        /// Points that were found.
        found: usize,
        /// Points that should be in view.
        sought: usize,
    },
    /// They moved in ways that no turn of the camera explains.
    #[error("the {found} points that are found do not agree")]
    Disagreed {
        /// Points that were found.
        found: usize,
    },
    /// The points that agree do not tell the heading well enough.
    #[error("the heading is only known to {:.2} deg", .sigma.to_degrees())]
    Vague {
        /// Standard deviation, radians.
        sigma: f64,
    },
}

/// A point of the sky. Directions are unit vectors, or nearly, in the anchor's world.
#[derive(Clone, Debug)]
struct SkyPoint {
    /// Towards its middle, and a little to the right and down of it in the picture that its patch is from.
    middle: DVec3,
    right: DVec3,
    down: DVec3,
    patch: SkyPatch,
    /// When it had that direction, and when it was seen last.
    taken: Time,
    seen: Time,
    /// Whether it goes as what lies at the sky line, and not with the clouds.
    stands: bool,
    misses: u8,
    /// Variance of the heading that it was tied in with, rad^2.
    tied: f64,
}

/// Follows the sky; keeps its memory from picture to picture.
#[derive(Clone, Debug)]
pub struct Skyline {
    points_most: usize,
    pyramid: GreyPyramid,
    grid: FieldGrid,
    points: Vec<SkyPoint>,
    sights: Vec<SkyTrack>,
    places: Vec<DVec2>,
    taken: Vec<bool>,
    scratch: Vec<f64>,
    cursor: usize,
    anchor: Option<Anchor>,
    wind: Wind,
}

#[derive(Clone, Copy, Debug)]
struct Anchor {
    time: Time,
    /// When its points were seen last.
    held: Time,
    /// From the believed world to the anchor's.
    turn: DQuat,
    /// Wind by its points, heights of the clouds a second.
    wind: DVec2,
}

/// A picture under the lens that made it, both reduced.
struct ReducedPicture {
    time: Time,
    lens: Lens,
    world_from_camera: DQuat,
    sigma: f64,
    drift: f64,
    /// Sine of the elevation above which there is sky.
    sine: f64,
    /// Angle of a reduced pixel, radians.
    pixel: f64,
}

impl SkyPoint {
    /// How far wind has carried it in `age_s` seconds, heights of the clouds.
    fn gone(&self, wind: DVec2, age_s: f64) -> DVec2 {
        if self.stands { DVec2::ZERO } else { wind * age_s }
    }
}

impl ReducedPicture {
    /// What is known of the wind where that was `learnt`: as clouds at the horizon may drift, so may all of their layer.
    fn wind(&self, learnt: &Wind) -> Wind {
        Wind::calm(self.drift / nearness(DVec3::X)).and(learnt)
    }
}

impl Default for Skyline {
    fn default() -> Self {
        Self::of_points(Self::POINTS)
    }
}

impl Skyline {
    /// Points that are followed in a picture, usually.
    pub const POINTS: usize = 60;

    /// One that has not seen a picture.
    pub fn new() -> Self {
        Self::default()
    }

    /// One that follows so many points in a picture.
    pub fn of_points(points: usize) -> Self {
        Self {
            points_most: points.clamp(POINTS_LEAST, 1000),
            pyramid: GreyPyramid::default(),
            grid: FieldGrid::default(),
            points: Vec::new(),
            sights: Vec::new(),
            places: Vec::new(),
            taken: Vec::new(),
            scratch: Vec::new(),
            cursor: 0,
            anchor: None,
            wind: Wind::UNKNOWN,
        }
    }

    /// Sets the mask of the own ship or gun in the pictures, from now on.
    pub fn set_mask(&mut self, mask: Option<Mask>) {
        self.grid.set_mask(mask);
    }

    /// Forgets anchor, points and wind: the next picture with a sky is the anchor.
    pub fn forget(&mut self) {
        self.points.clear();
        self.anchor = None;
        self.wind = Wind::UNKNOWN;
    }

    /// The heading in `picture`, exposed at `time`, against the anchor's.
    pub fn look(&mut self, time: Time, picture: &Picture, view: &SkyView) -> Result<YawSeen, NoYaw> {
        self.pyramid.measure(picture);
        let look = self.prepare(time, picture, view)?;
        self.grid.make(&look.lens, self.pyramid.size);
        if self.grid.columns < FIELDS_MIN.0 || self.grid.rows < FIELDS_MIN.1 {
            return Err(NoYaw::TooSmall);
        }
        let up = look.world_from_camera.inverse() * DVec3::Z;
        let rows = self.grid.mark(up, look.sine).ok_or(NoYaw::NoSky)?;
        // Coarse patches hang over the horizon.
        self.pyramid.fill(picture, rows.start..rows.end + FIELD);
        self.points.retain(|p| time.ns_since(p.seen) <= KEPT_NS);
        self.points.drain(..self.points.len().saturating_sub(KEPT * self.points_most));
        let Some(anchor) = self.anchor else { return self.begin(&look) };
        let sought = self.seek(&look, &anchor);
        match self.agree(&look, &anchor, sought) {
            Ok(fit) => self.answer(&look, &anchor, &fit, sought),
            Err(_) if time.ns_since(anchor.held) > LOST_NS => self.begin(&look),
            Err(why) => Err(why),
        }
    }

    fn prepare(&self, time: Time, picture: &Picture, view: &SkyView) -> Result<ReducedPicture, NoYaw> {
        let full = DVec2::new(f64::from(picture.width()), f64::from(picture.height()));
        let scale = full
            / DVec2::new(f64::from(view.lens.width), f64::from(view.lens.height))
            / self.pyramid.reduction as f64;
        let lens = Lens {
            width: (f64::from(view.lens.width) * scale.x).round() as u32,
            height: (f64::from(view.lens.height) * scale.y).round() as u32,
            focal: view.lens.focal * scale,
            centre: view.lens.centre * scale,
            row_turn: view.lens.row_turn / scale.y,
            ..view.lens
        };
        let q = view.world_from_camera;
        let sensible = lens.focal.min_element() > 1.0
            && lens.focal.max_element() < 1e6
            && lens.centre.is_finite()
            && lens.distortion.is_finite()
            && q.is_finite()
            && (0.5..2.0).contains(&q.length())
            && view.sigma.is_finite()
            && view.drift.is_finite()
            && view.eye_height_m.is_finite();
        if !sensible {
            return Err(NoYaw::Senseless);
        }
        let pixel = 1.0 / lens.focal.x;
        let sigma = view.sigma.abs().clamp(0.1 * pixel, 0.2);
        // A patch must lie above the horizon, wherever that may be.
        let sine = (f64::from(HALF) * pixel + sigma).sin() - horizon_dip(view.eye_height_m).sin();
        let drift = view.drift.abs().clamp(DRIFTS[0], DRIFTS[1]);
        Ok(ReducedPicture { time, lens, world_from_camera: q.normalize(), sigma, drift, sine, pixel })
    }

    /// Makes this picture the anchor, where it has enough to hold on to.
    fn begin(&mut self, look: &ReducedPicture) -> Result<YawSeen, NoYaw> {
        let before = self.points.len();
        self.points.reserve(((KEPT + 1) * self.points_most).saturating_sub(before));
        self.taken.clear();
        self.taken.resize(self.grid.sky.len(), false);
        self.tie_in(look, DQuat::IDENTITY, 0.0, usize::MAX);
        let points = self.points.len() - before;
        if points < POINTS_LEAST {
            self.points.truncate(before);
            return Err(NoYaw::Featureless { points });
        }
        self.points.drain(..before);
        if let Some(lost) = self.anchor {
            self.wind = self.wind.turned(lost.turn.inverse());
        }
        let wind = look.wind(&self.wind);
        let (mean, sigma) = (wind.mean(), wind.sigma());
        let near = self.points.iter().map(|p| nearness(p.middle)).sum::<f64>() / points as f64;
        self.anchor = Some(Anchor { time: look.time, held: look.time, turn: DQuat::IDENTITY, wind: mean });
        Ok(YawSeen {
            time: look.time,
            anchor: look.time,
            off: 0.0,
            sigma: 0.0,
            drift_sigma: near * sigma,
            wind: (mean, sigma),
            turn: DVec3::ZERO,
            covariance: DMat3::ZERO,
            points: (points, points),
            scatter_px: 0.0,
        })
    }

    /// Seeks all points that should be in view; how many these are.
    fn seek(&mut self, look: &ReducedPicture, anchor: &Anchor) -> usize {
        let camera_from_anchor = (anchor.turn * look.world_from_camera).inverse();
        // How far a prediction may be off decides how coarse the search begins.
        let off_px = 3.0 * look.sigma / look.pixel;
        let coarsest =
            (0..LEVELS - 1).find(|k| off_px <= FORETOLD_PX * f64::from(1u32 << k)).unwrap_or(LEVELS - 1);
        self.sights.clear();
        self.places.clear();
        let mut sought = 0;
        for (index, point) in self.points.iter_mut().enumerate() {
            let age_s = look.time.secs_since(point.taken);
            let gone = point.gone(anchor.wind, age_s);
            let project = |d: DVec3| look.lens.project(camera_from_anchor * carried(d, gone));
            let Some(guess) = project(point.middle) else { continue };
            let in_sky = self.grid.field(guess).is_some_and(|f| self.grid.sky.get(f) == Some(&true));
            if !in_sky || !self.grid.is_open(guess) {
                continue;
            }
            let (Some(right), Some(down)) = (project(point.right), project(point.down)) else { continue };
            sought += 1;
            let turned = DMat2::from_cols(right - guess, down - guess) * (1.0 / STRETCH_PX);
            let found = point.patch.find(&self.pyramid, guess, turned, coarsest);
            let Some(found) = found.filter(|f| f.likeness >= LIKENESS_MIN) else {
                point.misses += 1;
                continue;
            };
            let seen = look.world_from_camera * look.lens.unproject(found.place);
            if seen.is_finite() {
                let with_anchor = point.taken == anchor.time;
                let trust = if with_anchor { 1.0 } else { (age_s / TRUSTED_S).min(1.0).powi(2) };
                self.sights.push(SkyTrack {
                    point: index,
                    seen,
                    held: point.middle,
                    age_s,
                    trust,
                    likeness: f64::from(found.likeness),
                    unit: point.patch.unit(),
                    ..SkyTrack::default()
                });
                self.places.push(found.place);
            }
        }
        sought
    }

    /// The turn that the sights agree on.
    fn agree(&mut self, look: &ReducedPicture, anchor: &Anchor, sought: usize) -> Result<SkylineFit, NoYaw> {
        let found = self.sights.len();
        let fit = if found < POINTS_LEAST {
            Err(NoYaw::Missed { found, sought })
        } else {
            let expected = SkylinePrior {
                turn: anchor.turn,
                tilt_sigma: look.sigma,
                pixel: look.pixel,
                wind: look.wind(&self.wind),
                rate_sigma: look.drift,
            };
            fit::fit(&mut self.sights, &expected, POINTS_LEAST, &mut self.scratch)
                .ok_or(NoYaw::Disagreed { found })
        };
        let fit = fit.and_then(|fit| {
            let sigma = fit.covariance.z_axis.z.max(0.0).sqrt();
            if sigma <= SIGMA_MAX { Ok(fit) } else { Err(NoYaw::Vague { sigma }) }
        });
        if fit.is_err() {
            // A picture that shows nothing says nothing of its points.
            self.points.iter_mut().for_each(|p| p.misses = 0);
        }
        fit
    }

    fn answer(
        &mut self,
        look: &ReducedPicture,
        anchor: &Anchor,
        fit: &SkylineFit,
        sought: usize,
    ) -> Result<YawSeen, NoYaw> {
        let (mut tied, mut weights) = (0.0, 0.0);
        for sight in &self.sights {
            if let Some(point) = self.points.get(sight.point) {
                tied += point.tied * sight.weight;
                weights += sight.weight;
            }
        }
        let variance = fit.covariance.z_axis.z + if weights > 0.0 { tied / weights } else { 0.0 };
        self.wind.learn(&fit.told, look.time.secs_since(anchor.held));
        self.anchor = Some(Anchor { held: look.time, turn: fit.turn, wind: fit.wind.mean(), ..*anchor });
        self.keep(look, fit);
        if (fit.inliers as f64) < FEW * self.points_most as f64 {
            self.tie_in(look, fit.turn, variance, FIELDS_A_LOOK);
        }
        Ok(YawSeen {
            time: look.time,
            anchor: anchor.time,
            off: turn_about_vertical(fit.turn),
            sigma: variance.max(0.0).sqrt(),
            drift_sigma: fit.rate_sigma,
            wind: (fit.wind.mean(), fit.wind.sigma()),
            turn: rotation_vector(fit.turn),
            covariance: fit.covariance,
            points: (fit.inliers, sought),
            scatter_px: fit.scatter / look.pixel * self.pyramid.reduction as f64,
        })
    }

    /// Notes which points were seen, takes patches anew that have changed, and lets go of points that are not where they should be.
    fn keep(&mut self, look: &ReducedPicture, fit: &SkylineFit) {
        self.taken.clear();
        self.taken.resize(self.grid.sky.len(), false);
        let anchor_from_camera = fit.turn * look.world_from_camera;
        let wind = fit.wind.mean();
        for (sight, place) in self.sights.iter().zip(&self.places) {
            let Some(point) = self.points.get_mut(sight.point) else { continue };
            if sight.weight <= 0.0 {
                point.misses += 1;
                continue;
            }
            point.seen = look.time;
            point.misses = 0;
            point.stands = sight.stands;
            if sight.likeness < f64::from(LIKENESS_RENEW)
                && let Some(patch) = SkyPatch::take(&self.pyramid, *place)
            {
                // The point stays where it was; only the way around it is that of this picture, before wind had carried it there.
                let age_s = look.time.secs_since(point.taken);
                let gone = -point.gone(wind, age_s);
                let ray = |by: DVec2| carried(anchor_from_camera * look.lens.unproject(*place + by), gone);
                let middle = ray(DVec2::ZERO);
                point.right = point.middle + ray(DVec2::X * STRETCH_PX) - middle;
                point.down = point.middle + ray(DVec2::Y * STRETCH_PX) - middle;
                point.patch = patch;
            }
            if let Some(taken) = self.grid.field(*place).and_then(|f| self.taken.get_mut(f)) {
                *taken = true;
            }
        }
        self.points.retain(|p| p.misses < MISSES_MAX);
    }

    /// Takes points where there are none, with the directions that `turn` gives them, from the horizon up; of `fields_most` fields, and
    /// of the next ones in the next picture.
    fn tie_in(&mut self, look: &ReducedPicture, turn: DQuat, variance: f64, fields_most: usize) {
        let count = self.grid.sky.len();
        let mut room = self.points_most.saturating_sub(self.taken.iter().filter(|t| **t).count());
        let mut searched = 0;
        for _ in 0..count {
            if room == 0 || searched == fields_most {
                return;
            }
            self.cursor = (self.cursor + 1) % count;
            let field = count - 1 - self.cursor;
            if self.grid.sky.get(field) != Some(&true) || self.taken.get(field) != Some(&false) {
                continue;
            }
            searched += 1;
            if let Some(point) = self.take(look, turn, field) {
                self.points.push(SkyPoint { tied: variance, ..point });
                room -= 1;
            }
        }
    }

    /// The best point of a field.
    fn take(&self, look: &ReducedPicture, turn: DQuat, field: usize) -> Option<SkyPoint> {
        let corner = (field % self.grid.columns * FIELD, field / self.grid.columns * FIELD);
        let up = look.world_from_camera.inverse() * DVec3::Z;
        let usable =
            |place: DVec2| look.lens.unproject(place).dot(up) > look.sine && self.grid.is_open(place);
        let place = corners::best(&self.pyramid, corner, usable)?;
        let patch = SkyPatch::take(&self.pyramid, place)?;
        let anchor_from_camera = turn * look.world_from_camera;
        let ray = |by: DVec2| anchor_from_camera * look.lens.unproject(place + by);
        let middle = ray(DVec2::ZERO);
        let (right, down) = (ray(DVec2::X * STRETCH_PX), ray(DVec2::Y * STRETCH_PX));
        let sound = [middle, right, down].iter().all(|d| d.is_finite());
        sound.then_some(SkyPoint {
            middle,
            right,
            down,
            patch,
            taken: look.time,
            seen: look.time,
            stands: false,
            misses: 0,
            tied: 0.0,
        })
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod wind_tests;
