//! `bowwave study`: the user study of Nelson 2009, chapter IV, made and scored.
//!
//! People see pictures of reflections alone for three seconds each, some real, most generated, and say which are real. Four
//! factors of two levels (method, shadow, background, textured or shaped boat) make 16 conditions of four pictures each.

mod backgrounds;
mod design;
mod key;
mod page;
mod pictures;
mod score;
mod statistics;

use std::{fs, path::Path, sync::atomic::Ordering};

use anyhow::{Context, Result, bail};
use bowwave::{ending, loading::warn_of_former_names, outcome::Outcome, stdout};
use bowwave_core::water::ReflectionMethod;
use image::RgbImage;

use crate::cli::{StudyArgs, StudyTask};
use design::{CONDITIONS, Design, StudyItem};

/// The page that shows the pictures.
const PAGE: &str = "study.html";
/// File name of the key: kind and factors of each picture.
const KEY: &str = "key.csv";

/// Makes a study, or scores one.
pub fn run(arguments: &StudyArgs) -> Result<Outcome> {
    match &arguments.task {
        Some(StudyTask::Score(arguments)) => score::run(arguments),
        None => make(arguments),
    }
}

fn make(arguments: &StudyArgs) -> Result<Outcome> {
    if let Some(methods) = &arguments.methods {
        warn_of_former_names(&methods.warnings);
    }
    let [first, second] = arguments.methods.as_ref().map_or(Ok(default_methods()), |m| match m.list[..] {
        [a, b] => Ok([a, b]),
        ref other => {
            bail!("{} methods given; a study compares two: --methods full,mirror", other.len())
        }
    })?;
    let backgrounds = backgrounds::gather(&arguments.background)?;
    let names = backgrounds.each_ref().map(|b| b.name.clone());
    if names[0] == names[1] {
        bail!("both backgrounds are called {}; name the two scene files differently", names[0]);
    }
    let real = match &arguments.real {
        Some(folder) => pictures::real(folder)?,
        None => Vec::new(),
    };
    let design = Design::new(real.len(), arguments.participants, arguments.seed);
    make_folder(&arguments.out, arguments.force)?;
    let mut drawer =
        pictures::Drawer::new(backgrounds, [first, second], arguments.gpu.clone(), arguments.seed)?;
    let bar = indicatif::ProgressBar::new(design.items.len() as u64);
    let mut images: Vec<(usize, RgbImage)> = Vec::with_capacity(design.items.len());
    let end = ending::watch()?;
    // One condition after the other: the renderer is made anew only where the water changes.
    for index in design.by_condition() {
        if end.load(Ordering::Relaxed) {
            bail!("ended before all pictures were drawn; {} holds no study", arguments.out.display());
        }
        let image = match design.items[index] {
            StudyItem::Real(number) => real[number].1.clone(),
            StudyItem::Generated { condition, replicate } => drawer.draw(CONDITIONS[condition], replicate)?,
        };
        images.push((index, image));
        bar.inc(1);
    }
    bar.finish_and_clear();
    images.sort_by_key(|(index, _)| *index);
    let files = write_pictures(&arguments.out, &design, images)?;
    let study = key::study_of(&files);
    let rows = key::rows(&study, &design, &names, [first, second], &real);
    key::write(&arguments.out.join(KEY), &rows)?;
    write_sheets(&arguments.out, &study, &design)?;
    let page = arguments.out.join(PAGE);
    fs::write(&page, page::page(&study, &design, &files))
        .with_context(|| format!("cannot write {}; check the disk", page.display()))?;
    stdout::print(format!("{}\n", page.display()))?;
    eprintln!(
        "{} pictures, {} real; open the page in a browser, keep key.csv to yourself, then: bowwave study score ANSWERS... --key {}",
        design.items.len(),
        real.len(),
        arguments.out.join(KEY).display()
    );
    if real.is_empty() {
        log::warn!("no real pictures: rates can be had, d' cannot; give some with --real DIR");
    }
    Ok(Outcome::Done)
}

/// The thesis's pair where both are built, else the two forms of the one.
fn default_methods() -> [ReflectionMethod; 2] {
    let other = ReflectionMethod::of_name("physics").unwrap_or(ReflectionMethod::FullAsPublished);
    [ReflectionMethod::Full, other]
}

/// Answers that people gave to other pictures must not be scored with a new key.
fn make_folder(out: &Path, force: bool) -> Result<()> {
    if out.join(KEY).exists() && !force {
        bail!(
            "{} holds a study already; name another folder with --out, or replace it with --force",
            out.display()
        );
    }
    let pictures = out.join("pictures");
    fs::create_dir_all(&pictures)
        .with_context(|| format!("cannot make the folder {}; name another with --out", pictures.display()))
}

fn write_pictures(out: &Path, design: &Design, images: Vec<(usize, RgbImage)>) -> Result<Vec<Vec<u8>>> {
    let mut files = Vec::with_capacity(images.len());
    for (index, image) in images {
        let path = out.join("pictures").join(format!("{}.png", design.name(index)));
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).context("cannot encode a picture")?;
        fs::write(&path, bytes.get_ref())
            .with_context(|| format!("cannot write {}; check the disk", path.display()))?;
        files.push(bytes.into_inner());
    }
    Ok(files)
}

/// The order for each participant, as a sheet that answers can be written into by hand.
fn write_sheets(out: &Path, study: &str, design: &Design) -> Result<()> {
    let path = out.join("answer-sheet.csv");
    let mut text = String::from("participant,position,picture,answer,study\n");
    for (participant, order) in design.orders.iter().enumerate() {
        for (position, &index) in order.iter().enumerate() {
            text += &format!("{},{},{},,{study}\n", participant + 1, position + 1, design.name(index));
        }
    }
    fs::write(&path, text).with_context(|| format!("cannot write {}; check the disk", path.display()))
}
