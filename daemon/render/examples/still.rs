//! Draws two boxes as boats into a photograph: `still PHOTO OUT.png [printed|full|mirror|off] [BEAUFORT] [WIDTHxHEIGHT]`.

use std::{error::Error, sync::Arc, time::Duration};

use bowwave_core::{
    event::{Picture, PixelFormat},
    scene::{ReflectionMethod, ShadowLevel, Water},
    sea::BeaufortForce,
};
use bowwave_render::{Needs, RenderConfig, Renderer};

#[path = "../src/testing.rs"]
mod testing;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let (photo, out) = (args.next().ok_or("which photograph?")?, args.next().ok_or("which output?")?);
    let method = match args.next().as_deref() {
        Some("printed") => ReflectionMethod::FullAsPrinted,
        Some("mirror") => ReflectionMethod::Mirror,
        Some("off") => ReflectionMethod::Off,
        _ => ReflectionMethod::Full,
    };
    let force = args.next().map_or(Ok(1), |f| f.parse())?;
    let image = image::open(photo)?.to_rgb8();
    let (width, height) = match args.next().as_deref().and_then(|s| s.split_once('x')) {
        Some((w, h)) => (w.parse()?, h.parse()?),
        None => image.dimensions(),
    };
    let picture =
        Picture::new(PixelFormat::Rgb, image.width(), image.height(), Arc::from(image.as_raw().as_slice()))?;
    let models = [
        testing::box_model("white", [9.0, 2.6, 1.4], [0.8, 0.8, 0.78]),
        testing::box_model("red", [5.0, 2.0, 0.9], [0.5, 0.06, 0.04]),
    ];
    let mut scene = testing::empty_scene(width, height);
    let force = BeaufortForce::new(force).ok_or("no such wind force")?;
    scene.water = Water { method, force, shadow: ShadowLevel::Gradual };
    testing::add_boat(&mut scene, &models, 0, 60.0, -0.15, 0.4);
    testing::add_boat(&mut scene, &models, 1, 45.0, 0.22, 2.6);
    let config = RenderConfig {
        width,
        height,
        device: None,
        validation: std::env::var_os("VALIDATE").is_some(),
        frames_in_flight: 2,
        needs: Needs { boats_max: 4, rounds_max: 8, waters: vec![(method, ShadowLevel::Gradual)] },
        picture: None,
    };
    let (mut renderer, mut completions) = Renderer::new(&config, &models)?;
    renderer.submit(&scene, &picture, true)?;
    let frame = completions.wait_next(Duration::from_secs(10))?.ok_or("no frame")?;
    image::save_buffer(out, frame.rgba(), width, height, image::ExtendedColorType::Rgba8)?;
    eprintln!("{}: {:?} ms, passes {:?}", renderer.device().name, frame.frame_ms, frame.passes_ms);
    for message in renderer.validation_messages() {
        eprintln!("{message}");
    }
    Ok(())
}
