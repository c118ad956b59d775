//! The ladder of scenes from empty to full, and what each step costs: `bench [FRAMES [WIDTHxHEIGHT [DEVICE [SCENE [CSV]]]]]`, an empty
//! DEVICE being the first, SCENE a part of a scene's name (the bare video is always measured), CSV a file to write.
//!
//! All scenes are drawn in turns in one run, so that what else the machine does strikes all alike. `wall` is from submission to
//! completion, one frame at a time; `cpu` is the time of all threads of this process, drivers that draw on the processor included.
//! Only ratios to the bare video of the same run are comparable between machines and runs.

use std::{
    error::Error,
    fmt::Write as _,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use bowwave_core::{
    event::{Picture, PixelFormat},
    frame::{
        fires::Burning,
        lamps::LampView,
        scene::{LeftOut, Pass, PassDecision, RoundView, Scene},
        searchlight::SearchlightView,
    },
    model::Model,
    water::{ReflectionMethod, ShadowLevel},
    world::searchlight::SearchlightSpec,
};
use bowwave_render::{Completions, DrawRequest, Needs, RenderConfig, Renderer, TimeOuts};
use glam::{DVec2, DVec3, Vec3};
use rustix::time::{ClockId, clock_gettime};

#[allow(dead_code, clippy::unwrap_used, reason = "each user takes a part; scenes of constants are sound")]
#[path = "../src/testing.rs"]
mod testing;

/// A sea of stripes that move, so that no two pictures are alike.
fn picture(format: PixelFormat, width: u32, height: u32, phase: u32) -> Result<Picture, Box<dyn Error>> {
    let bytes: Vec<u8> = (0..format.byte_len(width, height))
        .map(|i| (90 + (i as u32 / 7 + i as u32 / width * 5 + phase * 3) % 60) as u8)
        .collect();
    Ok(Picture::new(format, width, height, Arc::from(bytes))?)
}

/// A step of the ladder.
struct Case {
    name: String,
    /// The step below it, and what is dearer.
    over: &'static str,
    why: &'static str,
    scene: Scene,
    format: PixelFormat,
    size: (u32, u32),
}

/// A step being measured.
struct Running {
    case: Case,
    renderer: Renderer,
    completions: Completions,
    pictures: Vec<Picture>,
    wall_ms: Vec<f64>,
    cpu_ms: Vec<f64>,
    passes_ms: Vec<Vec<f64>>,
}

const BARE: &str = "bare video";

fn cases((width, height): (u32, u32), models: &[Model]) -> Vec<Case> {
    let full = (width, height);
    let empty = testing::empty_scene(width, height);
    let mut bare = empty.clone();
    bare.passes[Pass::Hud as usize] = PassDecision::LeftOut(LeftOut::NoTrainee);
    let video = |name: &str, why, format, size| Case {
        name: name.to_owned(),
        over: BARE,
        why,
        scene: bare.clone(),
        format,
        size,
    };
    let mut cases = vec![
        video(BARE, "YUYV, pixel for pixel: converted, copied to the host", PixelFormat::Yuyv, full),
        video("video NV12", "chroma from a second plane", PixelFormat::Nv12, full),
        video("video RGB", "three bytes a pixel to fetch, none to convert", PixelFormat::Rgb, full),
        video("video scaled", "four pixels fetched and blended for one", PixelFormat::Yuyv, (854, 480)),
    ];
    let mut step = |name: &str, over, why, scene: &Scene| {
        let name = name.to_owned();
        cases.push(Case { name, over, why, scene: scene.clone(), format: PixelFormat::Yuyv, size: full });
    };
    step("no boat", BARE, "head-up display: its plates alone are blended", &empty);
    // From here on without display, so that steps stand for themselves.
    let with = |method, shadow, range: f64| {
        let mut scene = bare.clone();
        (scene.water.method, scene.water.shadow) = (method, shadow);
        testing::add_boat(&mut scene, models, 0, range, -0.05, 0.4);
        scene.passes[Pass::Shadow as usize] = PassDecision::LeftOut(LeftOut::NoSun);
        for pass in [Pass::Mirror, Pass::Water] {
            if method == ReflectionMethod::Off {
                scene.passes[pass as usize] = PassDecision::LeftOut(LeftOut::ReflectionOff);
            }
        }
        scene
    };
    let (off, none) = (ReflectionMethod::Off, ShadowLevel::None);
    step("boat far", BARE, "its mesh and the pixels of its hull", &with(off, none, 400.0));
    step("boat near", "boat far", "more pixels and triangles of the hull", &with(off, none, 60.0));
    let mut sunlit = with(off, none, 60.0);
    sunlit.passes[Pass::Shadow as usize] = PassDecision::Run;
    step(
        "boat near, sun",
        "boat near",
        "the mesh as the sun sees it, four texels a pixel of the hull",
        &sunlit,
    );
    let spec = SearchlightSpec::default();
    let mut beam = with(off, none, 60.0);
    beam.searchlight = Some(SearchlightView::new(&spec, DVec3::Z, 0.5, 10_000.0));
    beam.passes[Pass::Lamplight as usize] = PassDecision::Run;
    step(
        "boat near, searchlight",
        "boat near",
        "a third of the pixels blended once more, light at each corner of the mesh",
        &beam,
    );
    let mut lit = beam.clone();
    let lamp = |at: DVec3, candela: f32, is_high| LampView {
        at,
        strength: Vec3::splat(candela / 0.5),
        extinction_per_m: 3.912 / 10_000.0,
        is_high,
    };
    let fires = [DVec3::new(-15.0, 120.0, 2.0), DVec3::new(30.0, 260.0, 2.0)];
    lit.lamps = fires.map(|at| lamp(at, 12_700.0, false)).to_vec();
    lit.lamps.push(lamp(DVec3::new(30.0, 450.0, 280.0), 80_000.0, true));
    step(
        "boat near, searchlight, flare, fires",
        "boat near, searchlight",
        "all pixels blended twice over, three lamps at each corner of the mesh, 3700 nodes",
        &lit,
    );
    let mut burns = with(off, none, 60.0);
    let (at, eye) = (burns.boats[0].pose.position + DVec3::Z, burns.camera.position);
    let wind = DVec2::new(4.0, 1.0);
    let burning = Burning { boat: 0, since_s: 0.0, wind, eye, visibility_m: 10_000.0, white_cd_m2: 0.5 };
    burning.puffs(60.0, |_| Some(at), &mut burns.rounds);
    burns.rounds.sort_by(|a, b| b.place().distance(eye).total_cmp(&a.place().distance(eye)));
    burns.passes[Pass::Rounds as usize] = PassDecision::Run;
    step("boat near, on fire", "boat near", "46 puffs, each over those behind it", &burns);
    for (name, method, why) in [
        ("mirror", ReflectionMethod::Mirror, "the mesh mirrored, once a pixel of water"),
        (
            "full as printed",
            ReflectionMethod::FullAsPublished,
            "ten pixels of video compared at each of water",
        ),
        ("full", ReflectionMethod::Full, "video compared a cell at a time, mirror softened"),
        ("physics as printed", ReflectionMethod::PhysicsAsPublished, "nine rays a pixel of water"),
        ("physics", ReflectionMethod::Physics, "nine rays a pixel, eight waves each"),
        ("waves", ReflectionMethod::Baked, "bands, sums, a grid, two layers a pixel"),
    ] {
        step(name, "boat near", why, &with(method, none, 60.0));
    }
    let shaded = with(ReflectionMethod::Baked, ShadowLevel::Gradual, 60.0);
    step("waves, shadow", "waves", "what the hull keeps off the water before it", &shaded);
    let mut moving = bare.clone();
    (moving.water.method, moving.water.shadow) = (ReflectionMethod::Baked, ShadowLevel::Gradual);
    testing::add_moving_boat(&mut moving, models, 0, [60.0, -0.05, 0.4], [7.0, 0.0]);
    step("waves, shadow, wake", "waves, shadow", "the ribbon of the wake, foam beside the hull", &moving);
    let mut rounds = moving.clone();
    add_rounds(&mut rounds);
    step("and rounds", "waves, shadow, wake", "tracer, splash and strike", &rounds);
    for (name, over, method, speed_m_s) in [
        ("three still, full", "full", ReflectionMethod::Full, 0.0),
        ("three boats, full", "three still, full", ReflectionMethod::Full, 7.0),
        ("three still, waves", "waves, shadow", ReflectionMethod::Baked, 0.0),
        ("three boats, waves", "three still, waves", ReflectionMethod::Baked, 7.0),
    ] {
        let mut scene = empty.clone();
        (scene.water.method, scene.water.shadow) = (method, ShadowLevel::Gradual);
        for (i, place) in [[60.0, -0.15, 0.4], [120.0, 0.2, 1.4], [250.0, 0.05, 2.6]].into_iter().enumerate()
        {
            testing::add_moving_boat(&mut scene, models, i, place, [speed_m_s, 0.0]);
        }
        add_rounds(&mut scene);
        step(
            name,
            over,
            if speed_m_s > 0.0 { "their wakes" } else { "three boats, rounds and the display" },
            &scene,
        );
    }
    cases
}

fn add_rounds(scene: &mut Scene) {
    let Some(at) = scene.boats.last().map(|b| b.pose.position) else { return };
    scene.rounds = vec![
        RoundView::Splash { at: at + DVec3::new(4.0, 6.0, 0.0), height_m: 4.0, radius_m: 0.9, opacity: 0.9 },
        RoundView::Strike { at: at + DVec3::Z * 1.5, radius_m: 0.8, opacity: 0.9 },
        RoundView::Tracer { from: at * 0.5, to: at * 0.8, radiance: Vec3::new(4.0, 1.2, 0.5) },
    ];
    scene.passes[Pass::Rounds as usize] = PassDecision::Run;
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let frames: usize = args.next().map_or(Ok(200), |n| n.parse())?;
    let size = args.next().unwrap_or_else(|| "1280x720".to_owned());
    let (w, h) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let size = (w.parse()?, h.parse()?);
    let device = args.next().filter(|d| !d.is_empty());
    let (wanted, csv) = (args.next().unwrap_or_default(), args.next());
    let models = ["dhow", "skiff", "rhib"]
        .into_iter()
        .map(|name| bowwave_models::resolve(name, Path::new(".")))
        .collect::<Result<Vec<_>, _>>()?;
    let mut running = cases(size, &models)
        .into_iter()
        .filter(|c| c.name == BARE || c.name.contains(&wanted))
        .map(|case| Running::new(case, size, device.clone(), &models))
        .collect::<Result<Vec<_>, _>>()?;
    let warm_up = 8;
    for i in 0..frames + warm_up {
        for case in &mut running {
            case.frame(i, i >= warm_up)?;
        }
    }
    let table = table(&mut running);
    println!("{}", text(&table));
    if let Some(path) = csv {
        std::fs::write(path, csv_of(&table))?;
    }
    Ok(())
}

impl Running {
    fn new(
        case: Case,
        size: (u32, u32),
        device: Option<String>,
        models: &[Model],
    ) -> Result<Self, Box<dyn Error>> {
        let scene = &case.scene;
        let water = scene.runs(Pass::Water).then_some((scene.water.method, scene.water.shadow));
        let config = RenderConfig {
            width: size.0,
            height: size.1,
            device,
            validation: false,
            frames_in_flight: 3,
            needs: Needs {
                noise: false,
                boats_max: scene.boats.len(),
                lights_max: scene.lights.len(),
                lamps: scene.runs(Pass::Lamplight),
                rounds_max: scene.rounds.len(),
                wakes_max: scene.boats.iter().filter(|b| b.wake.is_some()).count(),
                waters: water.into_iter().collect(),
                optics: scene.lens.optics(),
                phantoms: Default::default(),
            },
            picture: None,
            time_outs: TimeOuts::default(),
        };
        let (mut renderer, completions) = Renderer::new(&config, models)?;
        renderer.time_every(4);
        let pictures = (0..4)
            .map(|phase| picture(case.format, case.size.0, case.size.1, phase))
            .collect::<Result<Vec<_>, _>>()?;
        let passes_ms = vec![Vec::new(); Pass::COUNT];
        Ok(Self { case, renderer, completions, pictures, wall_ms: Vec::new(), cpu_ms: Vec::new(), passes_ms })
    }

    fn frame(&mut self, i: usize, counts: bool) -> Result<(), Box<dyn Error>> {
        let (begun, cpu) = (Instant::now(), cpu_ms());
        self.renderer.submit(DrawRequest::new(&self.case.scene, &self.pictures[i % 4], true))?;
        let frame = self.completions.wait_next(Duration::from_secs(20))?.ok_or("no frame within 20 s")?;
        let (wall, cpu) = (begun.elapsed().as_secs_f64() * 1e3, cpu_ms() - cpu);
        if !counts {
            return Ok(());
        }
        if frame.passes_ms.iter().any(Option::is_some) {
            // A timed frame is a slower one.
            for (list, ms) in self.passes_ms.iter_mut().zip(frame.passes_ms) {
                list.extend(ms);
            }
        } else {
            self.wall_ms.push(wall);
            self.cpu_ms.push(cpu);
        }
        Ok(())
    }
}

/// Processor time of all threads so far.
fn cpu_ms() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}

/// A line of the table.
struct Line {
    scene: String,
    passes: String,
    memory_mb: f64,
    wall_ms: [f64; 3],
    cpu_ms: f64,
    wall_ratio: f64,
    cpu_ratio: f64,
    /// What it costs more than the step below it, in bare videos.
    step: f64,
    over: &'static str,
    why: &'static str,
}

fn table(running: &mut [Running]) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for case in running {
        let wall_ms = [0.0, 0.5, 0.99].map(|q| percentile(&mut case.wall_ms, q));
        let cpu_ms = percentile(&mut case.cpu_ms, 0.5);
        let of = |name: &str| lines.iter().find(|l| l.scene == name);
        let bare = lines.first();
        let cpu_ratio = bare.map_or(1.0, |b| cpu_ms / b.cpu_ms);
        let timed = Pass::ALL.iter().zip(&mut case.passes_ms).filter(|(_, ms)| !ms.is_empty());
        let passes: Vec<_> =
            timed.map(|(pass, ms)| format!("{} {:.2}", pass.name(), percentile(ms, 0.5))).collect();
        lines.push(Line {
            passes: passes.join(" + "),
            memory_mb: case.renderer.memory().iter().map(|(_, bytes)| *bytes as f64).sum::<f64>() * 1e-6,
            wall_ratio: bare.map_or(1.0, |b| wall_ms[1] / b.wall_ms[1]),
            step: cpu_ratio - of(case.case.over).map_or(0.0, |l| l.cpu_ratio),
            scene: case.case.name.clone(),
            wall_ms,
            cpu_ms,
            cpu_ratio,
            over: case.case.over,
            why: case.case.why,
        });
    }
    lines
}

fn text(table: &[Line]) -> String {
    let head = format!(
        "{:21} {:>6} {:>7} {:>7} {:>7} {:>7} {:>6} {:>6} {:>6}  passes, p50 ms; step over\n",
        "scene", "MB", "min ms", "p50 ms", "p99 ms", "cpu ms", "wall", "cpu", "step"
    );
    let line = |l: &Line| {
        let [min, p50, p99] = l.wall_ms;
        format!(
            "{:21} {:6.1} {min:7.2} {p50:7.2} {p99:7.2} {:7.2} {:6.2} {:6.2} {:+6.2}  {}; {}: {}\n",
            l.scene, l.memory_mb, l.cpu_ms, l.wall_ratio, l.cpu_ratio, l.step, l.passes, l.over, l.why
        )
    };
    head + &table.iter().map(line).collect::<String>()
}

fn csv_of(table: &[Line]) -> String {
    let mut text = "scene,memory_mb,wall_min_ms,wall_p50_ms,wall_p99_ms,cpu_p50_ms,wall_ratio,cpu_ratio,step,over,passes_p50_ms,why\n"
        .to_owned();
    for l in table {
        let [min, p50, p99] = l.wall_ms;
        let numbers = [l.memory_mb, min, p50, p99, l.cpu_ms, l.wall_ratio, l.cpu_ratio, l.step];
        let numbers = numbers.map(|n| format!("{n:.3}")).join(",");
        let _ = writeln!(text, "\"{}\",{numbers},\"{}\",\"{}\",\"{}\"", l.scene, l.over, l.passes, l.why);
    }
    text
}

fn percentile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((last as f64 * q).round() as usize).copied().unwrap_or(f64::NAN)
}
