//! Shows a test picture with a moving bar on the LCD and prints how its flips fare: for looking at a new display or driver.
//!
//! `cargo run --release -p bowwave-devices --example lcd -- --list`
//!
//! `cargo run --release -p bowwave-devices --example lcd -- [--card NODE] [--connector NAME] [--size WxH] [--hz RATE]
//! [--legacy] [--picture WxH] [--fps RATE] [--seconds N] [--hold SECONDS] [--ppm FILE]`
//!
//! `--ppm` writes the last picture, which `--hold` keeps on the display, for comparison with what a screen grabber sees.

use std::{collections::BTreeMap, error::Error, fs, path::PathBuf, time::Duration};

use bowwave_devices::{
    clock,
    lcd::{self, Flip, LcdPort, LcdSettings, LcdState},
    report::{self, Reports},
};

/// Time in which a display is to be found before the example says that it waits.
const PATIENCE: Duration = Duration::from_secs(2);

/// What the command line asks for.
struct Wanted {
    settings: LcdSettings,
    picture: Option<(u32, u32)>,
    fps: f64,
    seconds: f64,
    hold_s: f64,
    ppm: Option<PathBuf>,
    list: bool,
}

fn main() -> Result<(), Box<dyn Error>> {
    let wanted = wanted(std::env::args().skip(1))?;
    if wanted.list {
        return list();
    }
    let (reporter, reports) = report::reporting();
    let port = LcdPort::start(wanted.settings.clone(), reporter)?;
    while port.await_mode(PATIENCE).is_none() {
        tell_faults(&reports);
        println!("waiting: {}", port.status().trouble.unwrap_or_default());
    }
    println!("{:#?}", port.status());
    let last = run(&port, &reports, &wanted);
    if let (Some(file), Some((rgba, (width, height)))) = (&wanted.ppm, &last) {
        let mut bytes = format!("P6\n{width} {height}\n255\n").into_bytes();
        bytes.extend(rgba.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]));
        fs::write(file, bytes)?;
    }
    println!("holding");
    clock::sleep_until(clock::now().plus_secs(wanted.hold_s));
    let begun = clock::now();
    let counters = port.stop()?;
    println!("{counters:#?}\nstopped within {:.1} ms", clock::now().secs_since(begun) * 1e3);
    Ok(())
}

/// Shows pictures for the wanted time and prints a line a second. Gives the last one.
fn run(port: &LcdPort, reports: &Reports, wanted: &Wanted) -> Option<(Vec<u8>, (u32, u32))> {
    let begun = clock::now();
    let (mut statistics, mut line, mut last) = (Statistics::default(), 1.0, None);
    let mut state = port.status().state;
    let mut size = wanted.picture.unwrap_or((800, 480));
    let mut behind = (size, ground(size));
    for frame in 0.. {
        let due_s = frame as f64 / wanted.fps;
        if due_s >= wanted.seconds {
            break;
        }
        clock::sleep_until(begun.plus_secs(due_s));
        if let (LcdState::Showing(mode), None) = (port.status().state, wanted.picture) {
            size = (mode.width, mode.height);
        }
        if behind.0 != size {
            behind = (size, ground(size));
        }
        let rgba = picture(&behind.1, size.0, frame);
        port.show(&rgba, size, frame);
        last = Some((rgba, size));
        statistics.take(port.flips().try_iter());
        tell_faults(reports);
        let now = port.status();
        if now.state != state {
            println!("{:9.3} s {:?}", clock::now().secs_since(begun), now.state);
            state = now.state;
        }
        if due_s >= line {
            println!("{:9.3} s {statistics}", clock::now().secs_since(begun));
            (statistics, line) = (Statistics { last: statistics.last, ..Statistics::default() }, line + 1.0);
        }
    }
    last
}

fn tell_faults(reports: &Reports) {
    reports.changes().for_each(|c| println!("          {} {:?} at {}", c.fault.code(), c.change, c.time));
}

fn list() -> Result<(), Box<dyn Error>> {
    for card in lcd::list() {
        match card {
            Ok(card) => println!("{card:#?}"),
            Err(e) => println!("{e}"),
        }
    }
    println!("{}", lcd::check(&LcdSettings::default()).map_or_else(|e| e.to_string(), |c| format!("{c:#?}")));
    Ok(())
}

/// Colours that show a swapped channel and a lost line.
fn ground((width, height): (u32, u32)) -> Vec<u8> {
    let pixel =
        |x: u32, y: u32| [(x * 255 / width) as u8, (y * 255 / height) as u8, (x ^ y) as u8 & 0x7f, 255];
    (0..height).flat_map(|y| (0..width).flat_map(move |x| pixel(x, y))).collect()
}

/// `ground` with a white bar that moves with `frame`: it shows a tear or a picture missed.
fn picture(ground: &[u8], width: u32, frame: u64) -> Vec<u8> {
    let (width, mut rgba) = (width as usize, ground.to_vec());
    let from = (frame * 8 % width.max(1) as u64) as usize;
    let to = (from + 16).min(width);
    rgba.chunks_exact_mut(width * 4).for_each(|line| line[from * 4..to * 4].fill(255));
    rgba
}

/// What a second's flips were like.
#[derive(Default)]
struct Statistics {
    last: Option<Flip>,
    flips: u32,
    waits: BTreeMap<u32, u32>,
    latency_ms_max: f64,
    gap_ms_min: Option<f64>,
    gap_ms_max: Option<f64>,
}

impl Statistics {
    fn take(&mut self, flips: impl Iterator<Item = Flip>) {
        for flip in flips {
            self.flips += 1;
            if let Some(waited) = flip.waited_vblanks {
                *self.waits.entry(waited).or_default() += 1;
            }
            self.latency_ms_max = self.latency_ms_max.max(flip.time.secs_since(flip.given) * 1e3);
            if let Some(last) = self.last {
                let gap = flip.time.secs_since(last.time) * 1e3;
                self.gap_ms_min = Some(self.gap_ms_min.map_or(gap, |g| g.min(gap)));
                self.gap_ms_max = Some(self.gap_ms_max.map_or(gap, |g| g.max(gap)));
            }
            self.last = Some(flip);
        }
    }
}

impl std::fmt::Display for Statistics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (min, max) = (self.gap_ms_min.unwrap_or(f64::NAN), self.gap_ms_max.unwrap_or(f64::NAN));
        write!(
            f,
            "{} flips, {min:.2} to {max:.2} ms apart, at most {:.2} ms after they were given, vblanks: {:?}",
            self.flips, self.latency_ms_max, self.waits
        )
    }
}

fn wanted(mut arguments: impl Iterator<Item = String>) -> Result<Wanted, Box<dyn Error>> {
    let mut wanted = Wanted {
        settings: LcdSettings::default(),
        picture: None,
        fps: 30.0,
        seconds: 10.0,
        hold_s: 0.0,
        ppm: None,
        list: false,
    };
    while let Some(name) = arguments.next() {
        match name.as_str() {
            "--list" => wanted.list = true,
            "--legacy" => wanted.settings.legacy = true,
            _ => {
                let value = arguments.next().ok_or_else(|| format!("{name} needs a value"))?;
                match name.as_str() {
                    "--card" => wanted.settings.card = Some(value.into()),
                    "--connector" => wanted.settings.connector = Some(value),
                    "--size" => wanted.settings.mode.size = Some(size(&value)?),
                    "--hz" => wanted.settings.mode.refresh_hz = Some(value.parse()?),
                    "--picture" => wanted.picture = Some(size(&value)?),
                    "--fps" => wanted.fps = value.parse()?,
                    "--seconds" => wanted.seconds = value.parse()?,
                    "--hold" => wanted.hold_s = value.parse()?,
                    "--ppm" => wanted.ppm = Some(value.into()),
                    _ => return Err(format!("there is no {name}: see the top of this example").into()),
                }
            }
        }
    }
    Ok(wanted)
}

fn size(text: &str) -> Result<(u32, u32), Box<dyn Error>> {
    let (width, height) = text.split_once('x').ok_or_else(|| format!("{text} is no size such as 800x480"))?;
    Ok((width.parse()?, height.parse()?))
}
