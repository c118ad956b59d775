//! Single frames of a made recording as PNG, for looking at:
//!
//! `cargo run --release -p hw-sim --example stills -- DIR FRAME... [beaufort=N] [sun=AZIMUTH,ELEVATION] [size=WxH] [seed=N]`
//!
//! Writes DIR/frame_NNNN.png as decoded from the JPEG that a recording would hold. Angles in degrees.

use std::{env, error::Error, fs, path::PathBuf, time::Instant};

use bowwave_core::sea::BeaufortForce;
use hw_sim::make::{Recipe, Studio};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let folder = PathBuf::from(arguments.next().ok_or("say where to: stills DIR FRAME...")?);
    let (mut recipe, mut frames) = (Recipe::default(), Vec::new());
    for argument in arguments {
        match argument.split_once('=') {
            Some((key, value)) => set(&mut recipe, key, value)?,
            None => frames.push(argument.parse::<u32>()?),
        }
    }
    fs::create_dir_all(&folder)?;
    let begun = Instant::now();
    let studio = Studio::new(&recipe)?;
    eprintln!("prepared in {:.2} s", begun.elapsed().as_secs_f64());
    for frame in frames {
        let begun = Instant::now();
        let shot = studio.shoot(frame)?;
        eprintln!("frame {frame}: {:.0} ms, {} bytes", begun.elapsed().as_secs_f64() * 1e3, shot.jpeg.len());
        image::load_from_memory(&shot.jpeg)?.save(folder.join(format!("frame_{frame:04}.png")))?;
    }
    Ok(())
}

fn set(recipe: &mut Recipe, key: &str, value: &str) -> Result<(), Box<dyn Error>> {
    match key {
        "beaufort" => {
            recipe.beaufort = BeaufortForce::new(value.parse()?).ok_or("Beaufort goes from 0 to 12")?
        }
        "sun" => {
            let (azimuth, elevation) = value.split_once(',').ok_or("sun=AZIMUTH,ELEVATION")?;
            recipe.sky.sun_azimuth = azimuth.parse::<f64>()?.to_radians();
            recipe.sky.sun_elevation = elevation.parse::<f64>()?.to_radians();
        }
        "size" => {
            let (width, height) = value.split_once('x').ok_or("size=WxH")?;
            (recipe.width, recipe.height) = (width.parse()?, height.parse()?);
        }
        "clouds" => recipe.sky.cloud_cover = value.parse()?,
        "seed" => recipe.seed = value.parse()?,
        _ => return Err(format!("unknown setting {key}").into()),
    }
    Ok(())
}
