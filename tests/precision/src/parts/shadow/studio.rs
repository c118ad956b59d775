//! A boat in the sun as the product draws it, as every rival would, and as rays to the sun's disc see it.

use anyhow::{Context as _, Result};
use bowwave_core::{
    estimate::light::Light,
    frame::scene::{PixelRect, Scene},
    geometry::{CameraPose, Lens},
    sky::SkyLobes,
};
use glam::{DVec2, DVec3, Vec3};
use hw_sim::ocean::mesh::BoatMesh;
use image::{Rgb, RgbImage};

use crate::{
    metric::Cutout,
    parts::drawn_boat::{self, DrawnBoat, EYE_M, SIZE, in_shade, without_shadow},
    reflection::scenes::Afloats,
    shadows::{
        NamedMethod, ShadowEye, ShadowFrame,
        mesh::CasterMesh,
        seen::{SeenPoint, SeenPoints},
    },
    truth::{boat, files},
};

/// Ranges of the three boats of a scene, metres: one is judged, the others stand in the picture's other parts.
pub const RANGES_M: [f64; 3] = [60.0, 150.0, 400.0];

/// A boat in the sun.
#[derive(Clone, Copy, Debug)]
pub struct Sunlit {
    /// Distance by which the ranges of [`RANGES_M`] are multiplied: a ship is judged from farther off.
    pub scale: f64,
    /// Which of them it is.
    pub range: usize,
    /// Where the bow points, degrees clockwise from the direction of view.
    pub heading_deg: f64,
    /// Unit vector towards the sun; y ahead.
    pub sun: DVec3,
}

impl Sunlit {
    fn range_m(&self) -> f64 {
        RANGES_M[self.range] * self.scale
    }

    fn afloat(&self) -> Afloats {
        drawn_boat::afloat(self.range_m(), self.heading_deg)
    }

    /// The other two boats, to the side where the sun is not, so that they never shade the one that is judged.
    fn others(&self) -> impl Iterator<Item = Afloats> {
        let (case, aside) = (*self, if self.sun.x > 0.0 { -0.25 } else { 0.25 });
        (0..RANGES_M.len()).filter(move |i| *i != case.range).map(move |i| {
            let range_m = RANGES_M[i] * case.scale;
            Afloats { right_m: aside * range_m, heading_deg: case.heading_deg + 50.0, ..Afloats::at(range_m) }
        })
    }
}

/// Errors of a case, FLIP over the boat's pixels.
#[derive(Clone, Debug)]
pub struct CaseErrors {
    /// Of what the product draws.
    pub drawn: f64,
    /// Of what it draws without shadows.
    pub bare: f64,
    /// Of each method that was asked for.
    pub methods: Vec<f64>,
    /// Pixels of the boat.
    pub pixels: u32,
}

/// A case as every method gets it.
pub struct Staged {
    sun: Vec3,
    eye: ShadowEye,
    meshes: Vec<CasterMesh>,
    /// One point of each pixel, and up to four.
    pub seen: [SeenPoints; 2],
    /// Share of the sun's disc that each pixel sees; nothing where it shows no boat.
    truth: Vec<Option<f64>>,
}

impl Staged {
    /// The frame.
    pub fn frame(&self) -> ShadowFrame<'_> {
        ShadowFrame { sun: self.sun, meshes: &self.meshes, eye: self.eye }
    }

    /// Share of the sun by a method at each pixel that shows the boat.
    fn shares(&self, named: &NamedMethod) -> Vec<f64> {
        let mut method = (named.make)();
        let seen = &self.seen[usize::from(named.four_points)];
        method.prepare(&self.frame(), seen);
        let of_pixel = |pixel: &[u32]| {
            let points = &seen.points[pixel[0] as usize..pixel[1] as usize];
            let sum: f64 = points.iter().map(|p| f64::from(method.share(p))).sum();
            sum / points.len().max(1) as f64
        };
        seen.first.windows(2).map(of_pixel).collect()
    }
}

/// Everything that draws a boat, and the rays that judge it.
pub struct Studio(DrawnBoat);

impl Studio {
    /// For a boat of that name.
    pub fn new(boat: &str) -> Result<Self> {
        Ok(Self(DrawnBoat::new(boat)?))
    }

    /// The scene of a case as the product gets it.
    pub fn scene(&self, case: &Sunlit) -> Result<Scene> {
        let sky = Vec3::new(0.16, 0.2, 0.26);
        let light = Light {
            sun_direction: case.sun,
            sun: Vec3::new(0.85, 0.8, 0.72),
            sky,
            dome: SkyLobes::even(sky),
            horizon: sky,
            sea: 0.2 * sky,
        };
        self.0.scene(case.range_m(), case.afloat(), light)
    }

    /// Draws a scene.
    pub fn paint(&self, scene: &Scene) -> Result<RgbImage> {
        self.0.paint(scene)
    }

    /// A boat of this model between the eye and that sun, abeam to the light, so that its hull shades the eye. It hangs in the air: no boat but a
    /// frigate is as high as the eye.
    pub fn before_the_sun(&self, sun: DVec3) -> Afloats {
        const AWAY_M: f64 = 150.0;
        let away = sun * AWAY_M;
        Afloats {
            right_m: away.x,
            heading_deg: away.x.atan2(away.y).to_degrees() + 90.0,
            lifted_m: EYE_M + away.z,
            ..Afloats::at(away.y)
        }
    }

    /// The case as every method gets it, with `more` of this boat as well that need not be in the picture.
    pub fn stage(&self, case: &Sunlit, scene: &Scene, more: &[Afloats]) -> Result<Staged> {
        let hull =
            scene.boats.first().and_then(|boat| boat.hull).context("the boat is out of the picture")?;
        let origin = case.afloat().pose().position;
        let afloats = std::iter::once(case.afloat()).chain(case.others()).chain(more.iter().copied());
        let meshes = afloats.map(|afloat| CasterMesh::of(&self.0.model, afloat.pose(), origin)).collect();
        let mesh = boat::mesh(&self.0.model, case.afloat().pose());
        let (camera, lens) = (&scene.camera, &scene.lens);
        let rays = EyeRays { camera, lens, mesh: &mesh, origin };
        let (seen, truth) = rays.look(hull, case.sun);
        Ok(Staged { sun: case.sun.as_vec3(), eye: eye(camera, lens, origin), meshes, seen, truth })
    }

    /// Errors of the product and of `methods` in a case; `more` as in [`Self::stage`].
    pub fn errors(&self, case: &Sunlit, more: &[Afloats], methods: &[&NamedMethod]) -> Result<CaseErrors> {
        let scene = self.scene(case)?;
        let staged = self.stage(case, &scene, more)?;
        let bare = without_shadow(&scene);
        let around = in_shade(&scene);
        let seen = &staged.seen[0];
        let cutout = Cutout::new(seen.corner, seen.size, [SIZE.0, SIZE.1]);
        let paint = |scene: &Scene| Ok::<_, anyhow::Error>(cutout.cut(&self.paint(scene)?));
        let (drawn, bare, around) = (paint(&scene)?, paint(&bare)?, paint(&around)?);
        let on = &staged.truth;
        let truth = composed(&cutout, [&bare, &around], on, |pixel| on[pixel].unwrap_or(0.0));
        let error = |picture: &RgbImage| {
            let mean = cutout.flip_mean(&truth, picture, on.iter().map(Option::is_some))?;
            Ok::<_, anyhow::Error>(mean.unwrap_or(0.0))
        };
        let methods = methods.iter().map(|named| {
            let shares = staged.shares(named);
            error(&composed(&cutout, [&bare, &around], on, |pixel| shares[pixel]))
        });
        Ok(CaseErrors {
            drawn: error(&drawn)?,
            bare: error(&bare)?,
            methods: methods.collect::<Result<_>>()?,
            pixels: staged.truth.iter().flatten().count() as u32,
        })
    }
}

/// The eye as the methods get it.
pub fn eye(camera: &CameraPose, lens: &Lens, origin: DVec3) -> ShadowEye {
    ShadowEye {
        position: (camera.position - origin).as_vec3(),
        axes: DVec3::AXES.map(|axis| (camera.world_from_camera * axis).as_vec3()),
        reach: (0.5 * DVec2::new(f64::from(lens.width), f64::from(lens.height)) / lens.focal)
            .as_vec2()
            .to_array(),
        pixel: lens.focal.max_element().recip() as f32,
    }
}

/// The picture with so much of the sun at each pixel that shows the boat: between that with all of it and that without.
fn composed(
    cutout: &Cutout,
    [lit, dark]: [&RgbImage; 2],
    on: &[Option<f64>],
    share: impl Fn(usize) -> f64,
) -> RgbImage {
    let mut made = lit.clone();
    for (i, _) in on.iter().enumerate().filter(|(_, on)| on.is_some()) {
        let (x, y) = cutout.place(i);
        let (lit, dark, share) = (lit.get_pixel(x, y), dark.get_pixel(x, y), share(i) as f32);
        let mixed = [0, 1, 2].map(|c| {
            let (lit, dark) = (files::linear(lit[c]), files::linear(dark[c]));
            files::code(dark + (lit - dark) * share)
        });
        made.put_pixel(x, y, Rgb(mixed));
    }
    made
}

/// Rays from the eye to a boat, and on to the sun.
struct EyeRays<'a> {
    camera: &'a CameraPose,
    lens: &'a Lens,
    mesh: &'a BoatMesh,
    origin: DVec3,
}

impl EyeRays<'_> {
    /// Points of the boat within a part of the picture, one a pixel and up to four, and the share of the sun's disc that each pixel sees.
    fn look(&self, hull: PixelRect, sun: DVec3) -> ([SeenPoints; 2], Vec<Option<f64>>) {
        let centre = self.lens.centre.as_vec2().to_array();
        let lens = [centre, self.lens.focal.as_vec2().to_array()];
        let mut seen = [0, 1].map(|_| SeenPoints::begin([hull.x, hull.y], [hull.width, hull.height], lens));
        let mut truth = Vec::new();
        for y in hull.y..hull.y + hull.height {
            for x in hull.x..hull.x + hull.width {
                let corner = DVec2::new(f64::from(x), f64::from(y));
                let parts = [0, 1, 2, 3].map(|part| {
                    let within = DVec2::new(f64::from(part % 2), f64::from(part / 2)) * 0.5 + 0.25;
                    self.meet(corner + within)
                });
                let found: Vec<SeenPoint> = parts.into_iter().flatten().collect();
                if !found.is_empty() {
                    let middle = self.meet(corner + 0.5);
                    seen[0].push(middle.unwrap_or(found[0]));
                }
                let shares = (0..).zip(parts).filter_map(|(part, point)| {
                    Some(sun_seen(self.mesh, self.origin + point?.place.as_dvec3(), part, sun))
                });
                let (sum, count) = shares.fold((0.0, 0.0), |(sum, count), share| (sum + share, count + 1.0));
                truth.push((count > 0.0).then(|| sum / count));
                found.into_iter().for_each(|point| seen[1].push(point));
                seen.iter_mut().for_each(SeenPoints::end_pixel);
            }
        }
        (seen, truth)
    }

    /// Point of the boat that a place of the picture shows; nothing under water.
    fn meet(&self, pixel: DVec2) -> Option<SeenPoint> {
        let ray = self.lens.unproject(pixel);
        let along = (self.camera.world_from_camera * ray).normalize();
        let hit = self.mesh.meet(self.camera.position, along, f64::INFINITY)?;
        // A little before the surface.
        let place = self.camera.position + along * (hit.t - 0.003);
        let normal = if hit.normal.dot(along) > 0.0 { -hit.normal } else { hit.normal };
        (place.z >= 0.0).then(|| SeenPoint {
            number: 0,
            mesh: 0,
            place: (place - self.origin).as_vec3(),
            normal: normal.as_vec3(),
            ray: (ray / ray.z).as_vec3(),
            depth: self.camera.to_camera(place).z as f32,
        })
    }
}

/// Share of the sun's disc that a place sees, by eight rays of the quarter of a pixel that `part` numbers.
fn sun_seen(mesh: &BoatMesh, place: DVec3, part: u32, sun: DVec3) -> f64 {
    const RAYS: u32 = 8;
    let rays = (RAYS * part..RAYS * (part + 1)).zip(0..);
    let free = rays.filter(|(turn, ray)| {
        !mesh.blocks(place, on_disc(sun, *turn, (f64::from(*ray) + 0.5) / f64::from(RAYS)))
    });
    free.count() as f64 / f64::from(RAYS)
}

/// Direction to a place on the sun's disc: number `turn` of a spiral, at that share of its area from the middle outwards.
pub fn on_disc(sun: DVec3, turn: u32, area: f64) -> DVec3 {
    /// Radius of the disc, radians.
    const SUN_RADIUS: f64 = 0.5 * 0.53 * std::f64::consts::PI / 180.0;
    let across = sun.any_orthonormal_vector();
    let upwards = sun.cross(across);
    let (sin, cos) = (f64::from(turn) * 2.399_963).sin_cos();
    (sun + (across * cos + upwards * sin) * (SUN_RADIUS * area.sqrt())).normalize()
}
