//! `bowwave compose`: boats composed into photographs.

use std::{
    path::{Path, PathBuf},
    sync::atomic::Ordering,
};

use anyhow::{Context, Result, bail};
use bowwave::{ending, loading::warn_of_former_names, outcome::Outcome, stdout};
use bowwave_core::water::ReflectionMethod;
use bowwave_models::BoatModels;

use crate::{
    cli::ComposeArgs,
    offscreen::OffscreenRenderer,
    photo::Photo,
    still::{self, Still},
};

/// Composes what the arguments name.
pub fn run(arguments: &ComposeArgs) -> Result<Outcome> {
    if arguments.example {
        stdout::print(still::EXAMPLE)?;
        return Ok(Outcome::Done);
    }
    let Some(path) = &arguments.scene else {
        bail!("no scene named; `bowwave compose --example > scene.toml` makes one to begin with");
    };
    let still = Still::read(path, "`bowwave compose --example > scene.toml` makes one to begin with")?;
    let base = path.parent().unwrap_or(Path::new(""));
    let models = BoatModels::load(still.boats.iter().map(|b| (b.name.as_str(), b.model.as_str())), base)?;
    let pictures = pictures(&base.join(&still.picture))?;
    if let Some(methods) = &arguments.method {
        warn_of_former_names(&methods.warnings);
    }
    let methods = arguments.method.as_ref().map_or_else(|| vec![still.water.method], |m| m.list.clone());
    let mut renderer = OffscreenRenderer::new(models, arguments.gpu.clone(), arguments.validation);
    std::fs::create_dir_all(&arguments.out).with_context(|| {
        format!("cannot make the folder {}; name another with --out", arguments.out.display())
    })?;
    let end = ending::watch()?;
    let mut whole = true;
    // The method is part of what a renderer is built for; decoding a picture again costs far less than building one.
    for &method in &methods {
        let mut still = still.clone();
        still.water.method = method;
        for (index, picture) in pictures.iter().enumerate() {
            if end.load(Ordering::Relaxed) {
                whole = false;
                break;
            }
            let target = target(&arguments.out, picture, (methods.len() > 1).then_some(method));
            compose_one(&mut renderer, &still, (index, picture), &target)?;
        }
    }
    let messages = renderer.validation_messages();
    for message in &messages {
        log::error!("{message}");
    }
    if !whole {
        log::warn!("ended before all pictures were composed");
    }
    Ok(match (messages.is_empty(), whole) {
        (false, _) => Outcome::Failed,
        (true, false) => Outcome::Partly,
        (true, true) => Outcome::Done,
    })
}

/// Composes one picture of a series, counted from 0.
fn compose_one(
    renderer: &mut OffscreenRenderer,
    still: &Still,
    (index, picture): (usize, &Path),
    target: &Path,
) -> Result<()> {
    refuse_to_replace_source(target, picture)?;
    let drawn = renderer.compose(still, &Photo::read(picture)?, u32::try_from(index).unwrap_or(u32::MAX))?;
    drawn
        .picture
        .save_with_format(target, image::ImageFormat::Png)
        .with_context(|| format!("cannot write {}; check the disk", target.display()))?;
    stdout::print(format!("{}\n", target.display()))?;
    if drawn.boats_seen < still.boats.len() {
        log::warn!(
            "{}: {} of {} boats lie outside the picture; check bearing_deg and azimuth_deg",
            picture.display(),
            still.boats.len() - drawn.boats_seen,
            still.boats.len()
        );
    }
    Ok(())
}

/// The picture, or the pictures of the folder in the order of their names.
pub(crate) fn pictures(path: &Path) -> Result<Vec<PathBuf>> {
    /// Most pictures of a folder.
    const PICTURES_MAX: usize = 10_000;
    if !path.is_dir() {
        if !path.exists() {
            bail!(
                "no picture {}; correct picture in the scene, it counts from the scene's folder",
                path.display()
            );
        }
        return Ok(vec![path.to_path_buf()]);
    }
    let found = bowwave_import::picture_names(path)?;
    if found.is_empty() {
        bail!("no JPEG or PNG picture in the folder {}", path.display());
    }
    if found.len() > PICTURES_MAX {
        bail!("{} pictures in {}; at most {PICTURES_MAX} at once", found.len(), path.display());
    }
    Ok(found)
}

fn target(folder: &Path, picture: &Path, method: Option<ReflectionMethod>) -> PathBuf {
    let stem = picture.file_stem().map_or_else(|| "picture".into(), |s| s.to_string_lossy());
    folder.join(match method {
        Some(method) => format!("{stem}.{}.png", method.name()),
        None => format!("{stem}.png"),
    })
}

/// The photograph is somebody's only one.
fn refuse_to_replace_source(target: &Path, source: &Path) -> Result<()> {
    let same = |a: &Path, b: &Path| match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    };
    if same(target, source) {
        bail!("{} would be replaced by its own composite; name another folder with --out", source.display());
    }
    Ok(())
}
