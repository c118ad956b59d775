//! Time of each method on software Vulkan, the methods in turns over the same picture.
//!
//! Two clocks. The **processor time of the process** counts what the driver's threads do for a frame and not what other programs take
//! meanwhile; a reflection's is the frame's less that of the same turn's frame without one. The renderer's own **timestamps** around the
//! mirror and water passes are the second; there the passes do not overlap.

use std::fmt::Write as _;

use anyhow::{Context, Result};
use bowwave_core::{
    frame::scene::{LeftOut, Pass, PassDecision, Scene},
    geometry::Lens,
    model::Model,
    sea::BeaufortForce,
    water::ReflectionMethod,
};
use bowwave_render::SOFTWARE;
use image::RgbImage;
use rustix::time::{ClockId, clock_gettime};

use super::{
    draw::{Painter, TIMED_EVERY, picture, tones},
    grid::METHODS,
    index,
    scenes::{self, Afloats},
};
use crate::{
    front::median,
    table::TextTable,
    truth::{boat::box_boat, cell::HFOV_DEG},
};

/// Height of the eye, metres.
const EYE_M: f64 = 8.0;
/// Force of the wind.
const FORCE: u8 = 2;
/// Pictures' sizes.
pub const SIZES: [(u32, u32); 2] = [(1280, 720), (1920, 1080)];

/// Times of one method, milliseconds.
#[derive(Clone, Debug, Default)]
pub struct MethodTimes {
    /// Processor time of the whole frame, turn by turn.
    pub frame_cpu: Vec<f64>,
    /// Timestamps around the whole frame.
    pub frame_gpu: Vec<f64>,
    /// Timestamps around the passes that mirror.
    pub mirror_gpu: Vec<f64>,
}

/// Processor time of all threads of this process, milliseconds.
pub fn process_ms() -> f64 {
    let now = clock_gettime(ClockId::ProcessCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}

/// One picture with boats, for every method.
struct Bed {
    sea: RgbImage,
    scenes: [Scene; METHODS],
    painters: Vec<Painter>,
}

impl Bed {
    fn new(size: (u32, u32), model: &Model, boats: &[Afloats]) -> Result<Self> {
        let lens = Lens::pinhole(size.0, size.1, HFOV_DEG.to_radians());
        let nearest = boats.iter().map(|b| b.range_m).fold(f64::INFINITY, f64::min);
        let camera = scenes::camera(EYE_M, nearest);
        let sea = scenes::sea(&lens, &camera, 150.0, 15.0);
        let tones = tones(&sea, &lens, &camera);
        let force = BeaufortForce::new(FORCE).context("no such force")?;
        let scenes = ReflectionMethod::ALL
            .map(|method| scenes::scene((camera, lens), tones, model, boats, (method, force)));
        let models = std::slice::from_ref(model);
        let make = |m: &ReflectionMethod| Painter::new(size, models, &[*m], (boats.len(), Some(SOFTWARE)));
        let painters = ReflectionMethod::ALL.iter().map(make).collect::<Result<_>>()?;
        Ok(Self { sea, scenes, painters })
    }

    /// Draws turns of [`TIMED_EVERY`] frames a method; the first turn compiles and does not count.
    fn run(&mut self, turns: usize) -> Result<[MethodTimes; METHODS]> {
        let video = picture(&self.sea)?;
        let mut times: [MethodTimes; METHODS] = Default::default();
        for turn in 0..=turns {
            for i in 0..METHODS {
                // Each turn begins with another method.
                let i = (i + turn) % METHODS;
                let once = frames(&mut self.painters[i], &self.scenes[i], &video)?;
                if turn > 0 {
                    times[i].frame_cpu.push(once.0);
                    times[i].frame_gpu.extend(once.1);
                    times[i].mirror_gpu.extend(once.2);
                }
            }
        }
        Ok(times)
    }
}

/// Mean processor time of the frames without timestamps, and the timed one's times.
fn frames(
    painter: &mut Painter,
    scene: &Scene,
    video: &bowwave_core::event::Picture,
) -> Result<(f64, Option<f64>, Option<f64>)> {
    let (mut cpu, mut count, mut gpu, mut mirror) = (0.0, 0.0, None, None);
    for _ in 0..TIMED_EVERY {
        let start = process_ms();
        let frame = painter.frame(scene, video)?;
        let taken = process_ms() - start;
        match frame.frame_ms {
            Some(ms) => {
                gpu = Some(ms);
                let of = |pass: Pass| frame.passes_ms[pass as usize].unwrap_or(0.0);
                mirror = Some(of(Pass::Mirror) + of(Pass::Water));
            }
            None => (cpu, count) = (cpu + taken, count + 1.0),
        }
    }
    Ok((cpu / count, gpu, mirror))
}

/// Middle of the differences, turn by turn.
fn beyond(a: &[f64], b: &[f64]) -> f64 {
    median(&mut a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<_>>())
}

/// All scenes, `turns` turns each.
pub fn table(turns: usize) -> Result<String> {
    let model = box_boat();
    let at = Afloats::at;
    let three = [at(60.0), Afloats { right_m: 30.0, ..at(150.0) }, Afloats { right_m: -60.0, ..at(400.0) }];
    let mut text = format!(
        "software Vulkan, {turns} turns; times in ms, middle of the turns; ratios to full_as_published\n"
    );
    for (name, size, boats) in [
        ("one boat, 60 m", SIZES[0], &three[..1]),
        ("one boat, 150 m", SIZES[0], &three[1..2]),
        ("one boat, 400 m", SIZES[0], &three[2..]),
        ("three boats", SIZES[0], &three[..]),
        ("three boats", SIZES[1], &three[..]),
    ] {
        let times = Bed::new(size, &model, boats)?.run(turns)?;
        writeln!(text, "\n{name}, {}x{}\n{}", size.0, size.1, lines(&times).trim_end())?;
    }
    for size in SIZES {
        let ratio = boatless(size, &model, turns)?;
        writeln!(text, "\nno boat in view over the video pass alone, {}x{}: {ratio:.3}", size.0, size.1)?;
    }
    Ok(text)
}

fn lines(times: &[MethodTimes; METHODS]) -> String {
    let mut table = TextTable::new(
        1,
        [
            ("", 20),
            ("frame, CPU", 15),
            ("reflection, CPU", 19),
            ("ratio", 9),
            ("frame, stamps", 19),
            ("mirror and water", 19),
            ("ratio", 9),
        ],
    );
    let off = &times[index(ReflectionMethod::Off)];
    let printed = &times[index(ReflectionMethod::FullAsPublished)];
    let (printed_cpu, printed_gpu) =
        (beyond(&printed.frame_cpu, &off.frame_cpu), median(&mut printed.mirror_gpu.clone()));
    for (method, t) in ReflectionMethod::ALL.iter().zip(times) {
        let middle = |v: &[f64]| median(&mut v.to_vec());
        let (cpu, gpu) = (beyond(&t.frame_cpu, &off.frame_cpu), middle(&t.mirror_gpu));
        let (frame_cpu, frame_gpu) = (middle(&t.frame_cpu), middle(&t.frame_gpu));
        let numbers = [frame_cpu, cpu, cpu / printed_cpu, frame_gpu, gpu, gpu / printed_gpu];
        table.row([method.name().to_owned()].into_iter().chain(numbers.map(|v| format!("{v:.2}"))));
    }
    table.take()
}

/// Processor time of a frame of a renderer that could draw three boats and has none in view, over one of a renderer that can draw
/// nothing but the video.
fn boatless(size: (u32, u32), model: &Model, turns: usize) -> Result<f64> {
    let mut bed = Bed::new(size, model, &[Afloats::at(60.0)])?;
    let with = index(ReflectionMethod::Full);
    let mut scene = bed.scenes[with].clone();
    scene.boats.clear();
    for pass in [Pass::Mirror, Pass::Water, Pass::Boats] {
        scene.passes[pass as usize] = PassDecision::LeftOut(LeftOut::NoBoatInView);
    }
    let mut bare = Painter::new(size, &[], &[], (0, Some(SOFTWARE)))?;
    let video = picture(&bed.sea)?;
    let mut ratios = Vec::with_capacity(turns);
    for turn in 0..=turns {
        // Who comes first changes from turn to turn.
        let able = |bed: &mut Bed| frames(&mut bed.painters[with], &scene, &video);
        let (a, b) = if turn % 2 == 0 {
            let a = able(&mut bed)?.0;
            (a, frames(&mut bare, &scene, &video)?.0)
        } else {
            let b = frames(&mut bare, &scene, &video)?.0;
            (able(&mut bed)?.0, b)
        };
        if turn > 0 {
            ratios.push(a / b);
        }
    }
    Ok(median(&mut ratios))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_disturbance_adds_to_both_is_not_the_methods() {
        let quiet = [2.0, 2.0, 2.0, 2.0, 2.0];
        let noise = [0.0, 3.0, 0.5, 7.0, 0.1];
        let disturbed: Vec<f64> = quiet.iter().zip(noise).map(|(a, n)| a + n).collect();
        let dearer: Vec<f64> = disturbed.iter().map(|a| a + 1.5).collect();
        assert!((beyond(&dearer, &disturbed) - 1.5).abs() < 1e-12);
    }

    #[test]
    fn the_process_has_used_time() {
        let start = process_ms();
        let spun =
            (0..2_000_000_u64).fold(1_u64, |a, i| std::hint::black_box(a ^ i).wrapping_mul(0x9e37_79b9));
        assert!(process_ms() > start && spun != 0);
    }
}
