//! The gun's own outline in the camera's picture, by pictures, models and planes, and its recoil.

mod made;

use anyhow::{Context, Result};
use bowwave_calibration::outline::OutlineFinder;
use bowwave_core::{
    estimate::recoil::RecoilFinder,
    event::{CameraFrame, Event},
    own_ship::{OwnShip, Phantom, Phantoms},
    time::NS_PER_S,
    world::scenario::{BUILT_IN, Scenario},
};
use glam::DVec2;
use hw_sim::{
    live::{Hands, Live, LiveOptions, Script, calibration},
    panorama::{self, PanoramaRecipe},
};

use super::{About, rms, worst};
use crate::bench::{ExtremeResult, PartBench};

/// Description of this part.
pub const ABOUT: About = About {
    part: "phantom",
    what: "Finds what the camera sees of the gun, so that it hides the boats behind it, and follows its recoil. Outlines a model of it, and tells \
           the place of what is traced on a plane.",
    truth: "the outline that the simulated camera draws its barrel and front sight by, and its recoil at the frame's exposure; the hull of a \
            solid's corners or circles in the undistorted view; a plane's own points, marked with an error of half a pixel",
    rivals: "where the mean of all pictures is half as dark as the barrel; a recoil that is not followed; a model's corners joined by straight \
             lines; the direct linear transform in pixels and metres",
    why: "how much of the sea's change a pixel shares says how much of it the gun covers, whatever the sea's colour. The settings are by \
          construction: a half is the edge. No recording chose them; those of this row only judge",
};

/// Seconds of pictures by which an outline is found, and of fire.
const FOUND_S: i64 = 12;
const FIRE_S: i64 = 6;
/// Seconds at the begin in which the barrel's look is learnt.
const LEARN_S: i64 = 1;
/// Rounds a minute of the heavy machine gun.
const RATE: f64 = 550.0;

/// A gun that turns and tilts by so many degrees a second, before a scenario's sea.
struct Turned {
    scenario: &'static str,
    deg_s: f64,
}

/// A simulated gun with its sea.
struct Simulated {
    _folder: tempfile::TempDir,
    recipe: PanoramaRecipe,
    panorama: std::path::PathBuf,
}

impl Simulated {
    fn new(scenario: &str, size: (u32, u32)) -> Result<Self> {
        let (_, text) =
            BUILT_IN.into_iter().find(|(name, _)| *name == scenario).context("no such scenario")?;
        let recipe = PanoramaRecipe::of_scenario(&Scenario::parse(text, scenario)?, size);
        let folder = tempfile::tempdir()?;
        let panorama = folder.path().join("sea");
        panorama::make(&recipe, &panorama, &mut |_, _| {})?;
        Ok(Self { _folder: folder, recipe, panorama })
    }

    fn size(&self) -> (u32, u32) {
        (self.recipe.recipe.width, self.recipe.recipe.height)
    }

    fn own_ship(&self) -> OwnShip {
        calibration(&self.recipe).own_ship()
    }

    /// Plays a script without a clock; `seen` gets each picture and the barrel's true factor. Rounds go off from second `fire_s` on.
    fn play(
        &self,
        script: &str,
        seconds: i64,
        fire_s: Option<i64>,
        mut seen: impl FnMut(&CameraFrame, f64),
    ) -> Result<()> {
        let hands = Hands::default();
        let options = LiveOptions {
            recipe: &self.recipe,
            panorama: &self.panorama,
            hands: hands.clone(),
            script: Some(Script::parse(script, "script")?),
            realtime: false,
            is_coded: false,
        };
        let mut live = Live::start(options)?;
        let (mut events, mut fired) = (Vec::new(), 0u32);
        for ms in 0..1000 * seconds {
            live.collect(live.origin().plus_ns(ms * NS_PER_S / 1000), &mut events)?;
            let since = fire_s.map_or(-1.0, |from| ms as f64 / 1000.0 - from as f64);
            let due = (since.max(0.0) * RATE / 60.0) as u32;
            hands.blow(due - fired);
            fired = due;
            for event in events.drain(..) {
                if let Event::Frame(frame) = event {
                    seen(&frame, live.recoil_at(frame.mid_exposure).unwrap_or(1.0));
                }
            }
        }
        Ok(())
    }
}

/// A gun that sweeps to and fro, up and down.
fn sweep(deg_s: f64) -> String {
    let steps = (FOUND_S as f64 * 2.0) as i64;
    let step = |i: i64| {
        let side = if i % 2 == 0 { 1.0 } else { -1.0 };
        let (azimuth, elevation) = (side * deg_s / 4.0, if i / 2 % 2 == 0 { -6.0 } else { 3.0 });
        format!(
            "[[step]]\nat_s = {:.1}\nazimuth_deg = {azimuth:.2}\nelevation_deg = {elevation:.2}\nover_s = 0.5\n",
            i as f64 * 0.5
        )
    };
    (0..steps).map(step).collect()
}

/// A gun that keeps to one place of the sea.
const HELD: &str = "[[step]]\nat_s = 0\nazimuth_deg = 2\nelevation_deg = -4\n";

/// Distances of the true outline's places from those that were found, pixels.
fn distances(truth: &Phantoms, found: &[Phantom]) -> Vec<f64> {
    let union =
        |parts: &[Phantom], at: DVec2| parts.iter().map(|p| p.distance(at)).fold(f64::INFINITY, f64::min);
    let mut off = Vec::new();
    for part in truth.parts.iter() {
        for (from, to) in part.edges() {
            let steps = from.distance(to).ceil() as u32;
            let places = (0..steps).map(|i| from.lerp(to, (f64::from(i) + 0.5) / f64::from(steps)));
            // What lies within another part is no edge.
            off.extend(places.filter(|at| union(&truth.parts, *at) > -0.01).map(|at| union(found, at)));
        }
    }
    off
}

/// Errors of the outlines found while the gun turns: by the sea's change, and by the mean picture.
fn found(simulated: &Simulated, deg_s: f64) -> Result<[f64; 2]> {
    let mut finder = OutlineFinder::new(simulated.size());
    simulated.play(&sweep(deg_s), FOUND_S, None, |frame, _| finder.see(&frame.picture))?;
    let truth = simulated.own_ship().phantoms;
    let outlines = finder.find().map(|found| found.phantoms).unwrap_or_default();
    let mean = finder.mean();
    let (width, height) = simulated.size();
    let code = |x: u32, y: u32| f64::from(mean[(y.min(height - 1) * width + x.min(width - 1)) as usize]);
    // Along the normal, where the mean is between its codes 6 px inside and outside.
    let mut by_mean = Vec::new();
    for part in truth.parts.iter() {
        for (from, to) in part.edges() {
            let steps = from.distance(to).ceil() as u32;
            let across = (to - from).normalize_or_zero().perp();
            for i in 0..steps {
                let at = from.lerp(to, (f64::from(i) + 0.5) / f64::from(steps));
                let out = if part.distance(at + across) > 0.0 { across } else { -across };
                let value = |px: f64| {
                    let p = (at + out * px).max(DVec2::ZERO);
                    code(p.x as u32, p.y as u32)
                };
                let half = 0.5 * (value(-2.0) + value(6.0));
                let found = (-12..=24)
                    .map(|k| f64::from(k) * 0.25)
                    .find(|px| (value(*px) > half) == (value(6.0) > half));
                by_mean.push(found.unwrap_or(6.0));
            }
        }
    }
    Ok([rms(distances(&truth, &outlines)), rms(by_mean)])
}

/// Errors of the muzzle's place while rounds go off, pixels: followed and not; and the largest while none does.
fn recoil(simulated: &Simulated) -> Result<[f64; 3]> {
    let truth = simulated.own_ship().phantoms;
    let mut finder = RecoilFinder::new(&truth).context("the barrel recoils")?;
    let barrel = truth.parts.iter().find(|part| part.name == "barrel").context("there is a barrel")?;
    let muzzle = barrel.outline()[0].distance(truth.bore);
    let (mut followed, mut left, mut at_rest) = (Vec::new(), Vec::new(), Vec::new());
    simulated.play(HELD, LEARN_S + FIRE_S, Some(LEARN_S), |frame, factor| {
        finder.observe(&frame.picture);
        let off = (finder.factor() - factor) * muzzle;
        if factor > 1.0 {
            followed.push(off);
            left.push((1.0 - factor) * muzzle);
        } else {
            at_rest.push(off.abs());
        }
    })?;
    Ok([rms(followed), rms(left), worst(at_rest)])
}

/// Measures outlines and recoil.
pub fn measure(bench: &mut PartBench) -> Result<()> {
    made::models(bench);
    made::planes(bench);
    let (cases, size): (&[Turned], _) = if bench.is_quick() {
        (&[Turned { scenario: "first-target", deg_s: 10.0 }], (640, 360))
    } else {
        (
            &[
                Turned { scenario: "first-target", deg_s: 4.0 },
                Turned { scenario: "first-target", deg_s: 40.0 },
                Turned { scenario: "rough-water", deg_s: 10.0 },
                Turned { scenario: "swarm-of-nine", deg_s: 40.0 },
            ],
            (1280, 720),
        )
    };
    let mut made: Option<(&str, Simulated)> = None;
    for Turned { scenario, deg_s } in cases {
        let simulated = match made.take() {
            Some((name, simulated)) if name == *scenario => simulated,
            _ => Simulated::new(scenario, size)?,
        };
        let [by_change, by_mean] = found(&simulated, *deg_s)?;
        bench.extreme(
            &format!("{scenario}, turned at {deg_s} deg/s: outline found"),
            "px rms",
            vec![
                ExtremeResult::product("share of the sea's change", "", by_change),
                ExtremeResult::rival("half way in the mean picture", "", by_mean),
            ],
        );
        if *deg_s != 40.0 || bench.is_quick() {
            let [followed, left, at_rest] = recoil(&simulated)?;
            bench.extreme(
                &format!("{scenario}: muzzle while it recoils"),
                "px rms",
                vec![
                    ExtremeResult::product("outline parts gun from sea", "", followed)
                        .note(format!("at rest between rounds {at_rest:.2} px at most")),
                    ExtremeResult::rival("left at rest", "", left),
                ],
            );
        }
        made = Some((scenario, simulated));
    }
    Ok(())
}
