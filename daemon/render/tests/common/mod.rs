//! Drawing one frame with Vulkan's validation layer watching.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::{sync::Arc, time::Duration};

use bowwave_core::{
    event::{Picture, PixelFormat},
    frame::scene::Scene,
    model::Model,
};
use bowwave_render::{Completions, DrawRequest, Needs, PictureShape, RenderConfig, Renderer, TimeOuts};

#[path = "../../src/testing.rs"]
pub mod testing;

/// Names the GPU to draw with, by its number or a part of its name, in place of the software driver.
pub const TEST_GPU: &str = "BOWWAVE_TEST_GPU";

/// The configuration for scenes like `scene`.
pub fn config(scene: &Scene) -> RenderConfig {
    RenderConfig {
        width: scene.lens.width,
        height: scene.lens.height,
        // The software driver: the same pixels everywhere. A real GPU is held against them by its number or a part of its name.
        device: Some(std::env::var(TEST_GPU).unwrap_or_else(|_| "llvmpipe".to_owned())),
        validation: true,
        frames_in_flight: 2,
        needs: Needs {
            noise: scene.runs(bowwave_core::frame::scene::Pass::Noise),
            boats_max: scene.boats.len(),
            lights_max: scene.lights.len(),
            lamps: scene.runs(bowwave_core::frame::scene::Pass::Lamplight),
            rounds_max: scene.rounds.len(),
            wakes_max: scene.boats.iter().filter(|b| b.wake.is_some()).count(),
            waters: vec![(scene.water.method, scene.water.shadow)],
            optics: scene.lens.optics(),
            phantoms: Default::default(),
        },
        picture: None,
        time_outs: TimeOuts::default(),
    }
}

pub fn open(config: &RenderConfig, models: &[Model]) -> (Renderer, Completions) {
    match Renderer::new(config, models) {
        Ok(pair) => pair,
        Err(error) => {
            panic!("the renderer's tests need the software driver and the validation layer: {error}")
        }
    }
}

/// Draws one frame and returns its pixels. Any word of the validation layer fails the test.
pub fn draw(scene: &Scene, picture: &Picture, models: &[Model]) -> Vec<u8> {
    let mut config = config(scene);
    config.picture = Some(PictureShape::of(picture));
    let (mut renderer, mut completions) = open(&config, models);
    let pixels = submit(&mut renderer, &mut completions, scene, picture);
    assert_clean(&renderer);
    pixels
}

pub fn submit(
    renderer: &mut Renderer,
    completions: &mut Completions,
    scene: &Scene,
    picture: &Picture,
) -> Vec<u8> {
    renderer.submit(DrawRequest::new(scene, picture, true)).unwrap();
    let frame = completions.wait_next(Duration::from_secs(20)).unwrap().expect("a frame within 20 s");
    assert_eq!(frame.frame, scene.frame);
    frame.rgba().to_vec()
}

pub fn assert_clean(renderer: &Renderer) {
    let messages = renderer.validation_messages();
    assert!(messages.is_empty(), "the validation layer says:\n{}", messages.join("\n"));
}

/// A made sea in RGB: a bright sky, and water with ripples that get finer towards the horizon.
pub fn sea(width: u32, height: u32) -> Picture {
    let horizon = height as f32 * 0.45;
    let mut bytes = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let below = y as f32 + 0.5 - horizon;
            let rgb = if below < 0.0 {
                [150.0 - below * 0.1, 185.0 - below * 0.05, 215.0]
            } else {
                let depth = 400.0 / (below + 3.0);
                let wave = (depth * 2.3 + (x as f32 * 0.07).sin()).sin()
                    + 0.6 * (depth * 5.1 + x as f32 * 0.05).sin();
                [60.0 + 12.0 * wave, 95.0 + 16.0 * wave, 120.0 + 18.0 * wave]
            };
            bytes.extend(rgb.map(|c| c.clamp(0.0, 255.0) as u8));
        }
    }
    Picture::new(PixelFormat::Rgb, width, height, Arc::from(bytes)).unwrap()
}

/// One grey everywhere.
pub fn grey(width: u32, height: u32, code: u8) -> Picture {
    let bytes = vec![code; (width * height * 3) as usize];
    Picture::new(PixelFormat::Rgb, width, height, Arc::from(bytes)).unwrap()
}

/// R, G, B of a pixel.
pub fn at(pixels: &[u8], width: u32, x: u32, y: u32) -> [u8; 3] {
    let i = ((y * width + x) * 4) as usize;
    [pixels[i], pixels[i + 1], pixels[i + 2]]
}
