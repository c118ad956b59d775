//! Times frames from submission to completion: `bench [FRAMES [WIDTHxHEIGHT [DEVICE [SCENE]]]]`, an empty
//! DEVICE being the first, SCENE a part of a scene's name. Prints p50 and p99 of the whole frame
//! and of each pass, for several scenes, and each scene's ratio to a bare video pass of the same run.

use std::{
    error::Error,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use bowwave_core::{
    event::{Picture, PixelFormat},
    scene::{LeftOut, Pass, PassDecision, ReflectionMethod, Scene, ShadowLevel},
};
use bowwave_render::{Needs, RenderConfig, Renderer, TimeOuts};

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

struct Case {
    name: String,
    scene: Scene,
    needs: Needs,
    format: PixelFormat,
    size: (u32, u32),
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let frames: usize = args.next().map_or(Ok(200), |n| n.parse())?;
    let size = args.next().unwrap_or_else(|| "1280x720".to_owned());
    let (w, h) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let (width, height) = (w.parse()?, h.parse()?);
    let device = args.next().filter(|d| !d.is_empty());
    let models = ["dhow", "skiff", "rhib"]
        .into_iter()
        .map(|name| bowwave_models::resolve(name, Path::new(".")))
        .collect::<Result<Vec<_>, _>>()?;
    let empty = testing::empty_scene(width, height);
    let mut bare = empty.clone();
    bare.passes[Pass::Hud as usize] = PassDecision::LeftOut(LeftOut::NoBoats);
    let case = |name: &str, scene: &Scene, format, from| Case {
        name: name.to_owned(),
        scene: scene.clone(),
        needs: Needs {
            boats_max: scene.boats.len(),
            rounds_max: 0,
            waters: if scene.boats.is_empty() {
                vec![]
            } else {
                vec![(scene.water.method, scene.water.shadow)]
            },
        },
        format,
        size: from,
    };
    let full = (width, height);
    let mut cases = vec![
        case("bare video YUYV", &bare, PixelFormat::Yuyv, full),
        case("bare video NV12", &bare, PixelFormat::Nv12, full),
        case("bare video RGB", &bare, PixelFormat::Rgb, full),
        case("bare video RGB scaled", &bare, PixelFormat::Rgb, (854, 480)),
        case("bare video YUYV scaled", &bare, PixelFormat::Yuyv, (854, 480)),
        case("no boat", &empty, PixelFormat::Yuyv, full),
    ];
    for method in [
        ReflectionMethod::Off,
        ReflectionMethod::Mirror,
        ReflectionMethod::Full,
        ReflectionMethod::FullAsPrinted,
        ReflectionMethod::PhysicsAsPrinted,
        ReflectionMethod::Physics,
        ReflectionMethod::Waves,
    ] {
        let mut scene = empty.clone();
        scene.water.method = method;
        scene.water.shadow = ShadowLevel::Gradual;
        testing::add_boat(&mut scene, &models, 0, 60.0, -0.15, 0.4);
        testing::add_boat(&mut scene, &models, 1, 120.0, 0.2, 1.4);
        testing::add_boat(&mut scene, &models, 2, 250.0, 0.05, 2.6);
        cases.push(case(&format!("three boats, {method:?}"), &scene, PixelFormat::Yuyv, full));
    }
    let mut reference = None;
    println!(
        "{:32} {:>7} {:>7} {:>7} {:>6} {:>7}  passes: p50 ms",
        "scene", "min ms", "p50 ms", "p99 ms", "ratio", "cpu ms"
    );
    let wanted = args.next().unwrap_or_default();
    for case in cases.into_iter().filter(|c| c.name.contains(&wanted)) {
        let config = RenderConfig {
            width,
            height,
            device: device.clone(),
            validation: false,
            frames_in_flight: 3,
            needs: case.needs.clone(),
            picture: None,
            time_outs: TimeOuts::default(),
        };
        let p50 = run(&case, &config, &models, frames, reference)?;
        reference = reference.or(Some(p50));
    }
    Ok(())
}

/// Draws one case and prints its line; returns the median.
fn run(
    case: &Case,
    config: &RenderConfig,
    models: &[bowwave_core::model::Model],
    frames: usize,
    reference: Option<f64>,
) -> Result<f64, Box<dyn Error>> {
    let (mut renderer, mut completions) = Renderer::new(config, models)?;
    let pictures = (0..4)
        .map(|phase| picture(case.format, case.size.0, case.size.1, phase))
        .collect::<Result<Vec<_>, _>>()?;
    let warm_up = 10;
    let (mut whole, mut passes) = (Vec::new(), vec![Vec::new(); Pass::COUNT]);
    let mut cpu_before = 0.0;
    for i in 0..frames + warm_up {
        if i == warm_up {
            cpu_before = cpu_ms();
        }
        let begun = Instant::now();
        renderer.submit(&case.scene, &pictures[i % 4], true)?;
        let frame = completions.wait_next(Duration::from_secs(5))?.ok_or("no frame within 5 s")?;
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        if i >= warm_up {
            whole.push(ms);
            for (list, ms) in passes.iter_mut().zip(frame.passes_ms) {
                list.extend(ms);
            }
        }
    }
    let p50 = percentile(&mut whole, 0.5);
    let p99 = percentile(&mut whole, 0.99);
    let ratio = p50 / reference.unwrap_or(p50);
    let list: Vec<String> = Pass::ALL
        .iter()
        .zip(&mut passes)
        .filter(|(_, ms)| !ms.is_empty())
        .map(|(pass, ms)| format!("{} {:.3}", pass.name(), percentile(ms, 0.5)))
        .collect();
    let cpu = (cpu_ms() - cpu_before) / frames as f64;
    let min = percentile(&mut whole, 0.0);
    println!("{:32} {min:7.3} {p50:7.3} {p99:7.3} {ratio:6.2} {cpu:7.3}  {}", case.name, list.join(", "));
    Ok(p50)
}

/// Processor time of all threads so far, to 10 ms: unlike the wall clock it does not grow with what else runs. 0 where the
/// system does not tell.
fn cpu_ms() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    after_name.split_whitespace().skip(11).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>()
        * 10.0
}

fn percentile(values: &mut [f64], q: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get((last as f64 * q).round() as usize).copied().unwrap_or(f64::NAN)
}
