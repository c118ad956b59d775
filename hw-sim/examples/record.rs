//! Makes a recording, with settings as for the `stills` example's defaults:
//!
//! `cargo run --release -p hw-sim --example record -- FILE.mcap [seconds=N]`

use std::{env, error::Error, path::PathBuf, time::Instant};

use hw_sim::make::{Recipe, make};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = env::args().skip(1);
    let path = PathBuf::from(arguments.next().ok_or("say where to: record FILE.mcap [seconds=N]")?);
    let mut recipe = Recipe::default();
    for argument in arguments {
        match argument.split_once('=') {
            Some(("seconds", value)) => {
                recipe.duration_s = value.parse()?;
                recipe.trigger.retain(|burst| burst.start_s + burst.length_s < recipe.duration_s);
            }
            _ => return Err(format!("unknown setting {argument}").into()),
        }
    }
    let begun = Instant::now();
    let made = make(&recipe, &path, &mut |done, total| eprint!("\r{done} of {total} frames"))?;
    eprintln!("\n{made:?} in {:.1} s", begun.elapsed().as_secs_f64());
    Ok(())
}
