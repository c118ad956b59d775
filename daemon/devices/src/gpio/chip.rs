//! GPIO chips and their lines: which are there, and whether one can be used.

use std::{
    fs::File,
    io,
    path::{Path, PathBuf},
};

use gpio_cdev::{Chip, Line, LineDirection, LineRequestFlags};

use crate::nodes;

/// One line of a chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LineInfo {
    /// Its number on the chip.
    pub offset: u32,
    /// Its name, where the board gives one.
    pub name: Option<String>,
    /// Who uses it now.
    pub consumer: Option<String>,
    /// Somebody uses it now.
    pub used: bool,
    /// It is an output now.
    pub output: bool,
    /// Whether it is high now; only where it was looked at ([`check`]).
    pub high: Option<bool>,
}

/// One chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChipInfo {
    /// Its node, such as `/dev/gpiochip0`.
    pub node: PathBuf,
    /// The kernel's name for it.
    pub name: String,
    /// Its name by the maker.
    pub label: String,
    /// Its lines.
    pub lines: Vec<LineInfo>,
}

/// Reasons why a line cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum GpioError {
    /// No such chip.
    #[error("no GPIO chip {}: chips here: {present}; name one that is there", node.display())]
    NotFound {
        /// The name asked for.
        node: PathBuf,
        /// Chips that are there.
        present: String,
    },
    /// The daemon's user may not open it.
    #[error("may not open {}: add the user to group gpio (usermod -aG gpio USER), then log in again", node.display())]
    Permission {
        /// The name asked for.
        node: PathBuf,
    },
    /// It does not answer as a GPIO chip.
    #[error("{} is no GPIO chip ({source}): name one such as /dev/gpiochip0 (bowwave doctor lists them)", node.display())]
    NotAChip {
        /// The name asked for.
        node: PathBuf,
        /// The GPIO layer's answer.
        source: gpio_cdev::Error,
    },
    /// The chip has no such line.
    #[error("{} has no line {line}: it has lines 0 to {last}, named {present}; give a number or a name", node.display())]
    NoLine {
        /// The chip.
        node: PathBuf,
        /// The line asked for.
        line: String,
        /// The chip's last line.
        last: u32,
        /// The names that are there.
        present: String,
    },
    /// Somebody else uses the line.
    #[error("line {line} of {} is in use by {consumer}: free it there, or wire to another line", node.display())]
    LineInUse {
        /// The chip.
        node: PathBuf,
        /// The line asked for.
        line: String,
        /// Who uses it.
        consumer: String,
    },
    /// A line does not tell what it is.
    #[error("cannot read line {offset} of {}: {source}; look at the kernel's log (dmesg)", node.display())]
    Line {
        /// The chip.
        node: PathBuf,
        /// The line's number.
        offset: u32,
        /// The GPIO layer's answer.
        source: gpio_cdev::Error,
    },
    /// No chip is called that.
    #[error("no GPIO chip is called {chip}: chips here: {present}; give a node, a label or a name")]
    NoChip {
        /// The name asked for.
        chip: String,
        /// Chips that are there.
        present: String,
    },
    /// Several chips are called that.
    #[error("several GPIO chips are called {chip}: {present}; name one by its node")]
    ChipsAlike {
        /// The name asked for.
        chip: String,
        /// The chips.
        present: String,
    },
    /// Another chip is called as the one that was lost.
    #[error(
        "{chip} now is another chip: it was {known}, which is not there, and is {found}; plug that one in again, or start the \
         trainer anew where the other is meant"
    )]
    OtherChip {
        /// The name asked for.
        chip: String,
        /// Label of the chip that it was.
        known: String,
        /// Label of the one that it is.
        found: String,
    },
    /// The line cannot be had.
    #[error("cannot use line {offset} of {}: {source}; does its chip know interrupts and the bias asked for?", node.display())]
    Request {
        /// The chip.
        node: PathBuf,
        /// The line's number.
        offset: u32,
        /// The GPIO layer's answer.
        source: gpio_cdev::Error,
    },
    /// Edges carry no monotonic time.
    #[error("Linux {release} dates GPIO edges by the wall clock: Linux 5.7 or newer is needed")]
    Clock {
        /// The kernel's release.
        release: String,
    },
    /// The kernel reports something else.
    #[error("cannot open {}: {source}; look at the kernel's log (dmesg)", node.display())]
    Io {
        /// The name asked for.
        node: PathBuf,
        /// The kernel's answer.
        source: io::Error,
    },
}

/// Every GPIO chip of this computer: its lines, or why it cannot be opened.
pub fn list() -> Vec<Result<ChipInfo, GpioError>> {
    let dev = Path::new("/dev");
    match nodes::numbered(dev, "gpiochip") {
        Ok(nodes) => nodes.iter().map(|node| describe(dev, node)).collect(),
        Err(source) => vec![Err(GpioError::Io { node: dev.to_owned(), source })],
    }
}

/// Whether `line` (a name or a number) of the chip at `node` is there and free, and its level. The line is neither turned
/// round nor changed.
pub fn check(node: &Path, line: &str) -> Result<LineInfo, GpioError> {
    check_in(Path::new("/dev"), node, line)
}

fn check_in(dev: &Path, node: &Path, line: &str) -> Result<LineInfo, GpioError> {
    let info = find_line(&describe(dev, node)?, line)?;
    let placed = PlacedLine { node: node.to_owned(), offset: info.offset, chip: open(dev, node)? };
    // Asked for neither as an input nor as an output, a line stays what it is.
    let handle = placed.line().and_then(|l| l.request(LineRequestFlags::empty(), 0, super::line::CONSUMER));
    let value = handle.and_then(|handle| handle.get_value()).map_err(|e| request_error(&placed, e))?;
    Ok(LineInfo { high: Some(value != 0), ..info })
}

/// Whether the kernel dates edges by `CLOCK_MONOTONIC`, as it does since Linux 5.7.
pub fn clock_is_monotonic() -> Result<(), GpioError> {
    let uname = rustix::system::uname();
    let release = uname.release().to_string_lossy();
    if monotonic_since(&release) { Ok(()) } else { Err(GpioError::Clock { release: release.into_owned() }) }
}

fn monotonic_since(release: &str) -> bool {
    let mut numbers = release.split(|c: char| !c.is_ascii_digit()).map(|n| n.parse::<u32>().ok());
    let version = (numbers.next().flatten(), numbers.next().flatten());
    matches!(version, (Some(major), Some(minor)) if (major, minor) >= (5, 7))
}

/// A line that was found.
#[derive(Debug)]
pub(crate) struct PlacedLine {
    /// Its chip's node.
    pub node: PathBuf,
    /// Its number there.
    pub offset: u32,
    /// Its chip.
    pub chip: Chip,
}

impl PlacedLine {
    pub(crate) fn line(&self) -> Result<Line, gpio_cdev::Error> {
        let mut chips = self.chip.lines();
        usize::try_from(self.offset)
            .ok()
            .and_then(|offset| chips.nth(offset))
            .ok_or_else(|| io::Error::from(io::ErrorKind::NotFound).into())
    }
}

/// Finds `line` (a name or a number) on `chip` (a node, a label or a name), whoever uses it.
pub(crate) fn place(dev: &Path, chip: &str, line: &str) -> Result<PlacedLine, GpioError> {
    let (node, chip) = find_chip(dev, chip)?;
    let offset = match line.parse::<u32>().ok().filter(|offset| *offset < chip.num_lines()) {
        // A number may also be a name; names come first.
        Some(offset) => find_name(&chip, line).unwrap_or(offset),
        None => match find_name(&chip, line) {
            Some(offset) => offset,
            // With the names that are there.
            None => find_line(&describe(dev, &node)?, line)?.offset,
        },
    };
    Ok(PlacedLine { node, offset, chip })
}

/// Like [`place`], for a chip whose label is `known` because it was used before: its node may be another chip's by now, and it
/// may have come back as another node. A line of another chip is not found.
pub(crate) fn place_again(
    dev: &Path,
    chip: &str,
    line: &str,
    known: Option<&str>,
) -> Result<PlacedLine, GpioError> {
    match known {
        None => place(dev, chip, line),
        Some(known) => on_known(chip, known, |chip| {
            let placed = place(dev, chip, line)?;
            let label = placed.chip.label().to_owned();
            Ok((placed, label))
        }),
    }
}

/// The finding of `find` for `chip` where that is the one with the label `known`, or else for the one that has it.
/// `find` also tells the label of the chip that it found.
fn on_known<T>(
    chip: &str,
    known: &str,
    find: impl Fn(&str) -> Result<(T, String), GpioError>,
) -> Result<T, GpioError> {
    let why = match find(chip) {
        Ok((found, label)) if label == known => return Ok(found),
        Ok((_, found)) => GpioError::OtherChip { chip: chip.to_owned(), known: known.to_owned(), found },
        Err(e) => e,
    };
    if chip == known {
        return Err(why);
    }
    match find(known) {
        // A chip's name may be another's label.
        Ok((found, label)) if label == known => Ok(found),
        Ok(_) | Err(_) => Err(why),
    }
}

fn find_name(chip: &Chip, name: &str) -> Option<u32> {
    chip.lines().find(|l| l.info().is_ok_and(|info| info.name() == Some(name))).map(|l| l.offset())
}

fn find_chip(dev: &Path, wanted: &str) -> Result<(PathBuf, Chip), GpioError> {
    if wanted.starts_with('/') {
        let node = PathBuf::from(wanted);
        let chip = open(dev, &node)?;
        return Ok((node, chip));
    }
    let nodes =
        nodes::numbered(dev, "gpiochip").map_err(|source| GpioError::Io { node: dev.to_owned(), source })?;
    let mut present = Vec::new();
    let mut found = Vec::new();
    for node in nodes {
        match open(dev, &node) {
            Ok(chip) if chip.label() == wanted || chip.name() == wanted => found.push((node, chip)),
            Ok(chip) => present.push(format!("{} ({})", node.display(), chip.label())),
            Err(_) => present.push(format!("{} (cannot be opened)", node.display())),
        }
    }
    // The wrong chip's line read as an interlock would arm a gun that is not inert.
    if found.len() > 1 {
        let present = nodes::listed(found.iter().map(|(node, _)| node.display().to_string()));
        return Err(GpioError::ChipsAlike { chip: wanted.to_owned(), present });
    }
    found.pop().ok_or_else(|| GpioError::NoChip { chip: wanted.to_owned(), present: nodes::listed(present) })
}

/// Why a line that is there cannot be had.
pub(crate) fn request_error(placed: &PlacedLine, source: gpio_cdev::Error) -> GpioError {
    let info = placed.line().and_then(|line| line.info());
    match info {
        Ok(info) if info.is_kernel() => GpioError::LineInUse {
            node: placed.node.clone(),
            line: placed.offset.to_string(),
            consumer: info.consumer().unwrap_or("the kernel").to_owned(),
        },
        _ => GpioError::Request { node: placed.node.clone(), offset: placed.offset, source },
    }
}

/// The free line of `chip` that is called `line` or has that number.
fn find_line(chip: &ChipInfo, line: &str) -> Result<LineInfo, GpioError> {
    let number = line.parse::<u32>().ok();
    let found = chip
        .lines
        .iter()
        .find(|l| l.name.as_deref() == Some(line))
        .or_else(|| chip.lines.iter().find(|l| Some(l.offset) == number));
    match found {
        None => Err(GpioError::NoLine {
            node: chip.node.clone(),
            line: line.to_owned(),
            last: chip.lines.last().map_or(0, |l| l.offset),
            present: nodes::listed(chip.lines.iter().filter_map(|l| l.name.clone())),
        }),
        Some(found) if found.used => Err(GpioError::LineInUse {
            node: chip.node.clone(),
            line: line.to_owned(),
            consumer: found.consumer.clone().unwrap_or_else(|| "the kernel".to_owned()),
        }),
        Some(found) => Ok(found.clone()),
    }
}

fn describe(dev: &Path, node: &Path) -> Result<ChipInfo, GpioError> {
    let chip = open(dev, node)?;
    let lines = chip
        .lines()
        .map(|line| {
            let info = line.info().map_err(|source| GpioError::Line {
                node: node.to_owned(),
                offset: line.offset(),
                source,
            })?;
            Ok(LineInfo {
                offset: line.offset(),
                name: info.name().map(str::to_owned),
                consumer: info.consumer().map(str::to_owned),
                used: info.is_used() || info.is_kernel(),
                output: info.direction() == LineDirection::Out,
                high: None,
            })
        })
        .collect::<Result<_, _>>()?;
    Ok(ChipInfo {
        node: node.to_owned(),
        name: chip.name().to_owned(),
        label: chip.label().to_owned(),
        lines,
    })
}

/// Opens the chip. The file is opened by itself first, because the GPIO crate does not tell what went wrong.
fn open(dev: &Path, node: &Path) -> Result<Chip, GpioError> {
    File::open(node).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => {
            let present = nodes::numbered(dev, "gpiochip").unwrap_or_default();
            GpioError::NotFound {
                node: node.to_owned(),
                present: nodes::listed(present.iter().map(|p| p.display().to_string())),
            }
        }
        io::ErrorKind::PermissionDenied => GpioError::Permission { node: node.to_owned() },
        _ => GpioError::Io { node: node.to_owned(), source },
    })?;
    Chip::new(node).map_err(|source| GpioError::NotAChip { node: node.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chip() -> ChipInfo {
        let line = |offset, name: Option<&str>, consumer: Option<&str>| LineInfo {
            offset,
            name: name.map(str::to_owned),
            consumer: consumer.map(str::to_owned),
            used: consumer.is_some(),
            output: false,
            high: None,
        };
        ChipInfo {
            node: "/dev/gpiochip0".into(),
            name: "gpiochip0".into(),
            label: "pinctrl".into(),
            lines: vec![
                line(0, Some("ID_SDA"), Some("i2c")),
                line(1, Some("TRIGGER"), None),
                line(2, None, None),
            ],
        }
    }

    #[test]
    fn a_line_is_found_by_name_or_number() {
        assert_eq!(find_line(&chip(), "TRIGGER").expect("there").offset, 1);
        assert_eq!(find_line(&chip(), "2").expect("there").offset, 2);
    }

    #[test]
    fn a_line_that_is_not_there_or_not_free_is_refused_in_words() {
        let message = find_line(&chip(), "FIRE").expect_err("not there").to_string();
        assert!(message.contains("no line FIRE") && message.contains("ID_SDA, TRIGGER"), "{message}");
        assert!(matches!(find_line(&chip(), "3"), Err(GpioError::NoLine { last: 2, .. })));
        let message = find_line(&chip(), "ID_SDA").expect_err("in use").to_string();
        assert!(message.contains("in use by i2c"), "{message}");
    }

    #[test]
    fn a_chip_that_is_not_there_or_none_is_refused_in_words() {
        let dev = tempfile::tempdir().expect("temporary folder");
        let node = dev.path().join("gpiochip3");
        let message = check_in(dev.path(), &node, "1").expect_err("not there").to_string();
        assert!(message.contains("no GPIO chip") && message.contains("chips here: none"), "{message}");
        std::fs::write(&node, []).expect("file");
        assert!(matches!(check_in(dev.path(), &node, "1"), Err(GpioError::NotAChip { .. })));
        assert!(matches!(check(Path::new("/dev/null"), "1"), Err(GpioError::NotAChip { .. })));
    }

    #[test]
    fn a_chip_that_is_called_otherwise_is_refused_in_words() {
        let dev = tempfile::tempdir().expect("temporary folder");
        std::fs::write(dev.path().join("gpiochip0"), []).expect("file");
        let message = place(dev.path(), "pinctrl-rp1", "17").expect_err("not there").to_string();
        assert!(message.starts_with("no GPIO chip is called pinctrl-rp1: chips here: "), "{message}");
        assert!(message.contains("gpiochip0 (cannot be opened)"), "{message}");
    }

    /// Chips by what they are called: each as its label, or why it cannot be used.
    fn again(chips: &[(&str, Result<&str, &str>)]) -> Result<String, GpioError> {
        on_known("/dev/gpiochip0", "pinctrl", |wanted| {
            let present = String::new();
            match chips.iter().find(|(name, _)| *name == wanted) {
                Some((name, Ok(label))) => Ok(((*name).to_owned(), (*label).to_owned())),
                Some((name, Err(line))) => {
                    Err(GpioError::NoLine { node: name.into(), line: (*line).to_owned(), last: 7, present })
                }
                None => Err(GpioError::NoChip { chip: wanted.to_owned(), present }),
            }
        })
    }

    #[test]
    fn a_chip_that_is_known_is_taken_under_any_name_and_no_other_in_its_place() {
        let (node, label) = ("/dev/gpiochip0", "pinctrl");
        assert_eq!(again(&[(node, Ok(label))]).expect("as before"), node);
        // Its node is gone, another chip's, without such a line: it is looked for by its label.
        for at_node in [&[][..], &[(node, Ok("expander"))], &[(node, Err("17"))]] {
            let chips: Vec<_> = at_node.iter().copied().chain([(label, Ok(label))]).collect();
            assert_eq!(again(&chips).expect("by its label"), label);
        }
        let message = again(&[(node, Ok("expander"))]).expect_err("another chip").to_string();
        assert!(message.contains("it was pinctrl") && message.contains("is expander"), "{message}");
        assert!(matches!(again(&[(node, Err("17"))]), Err(GpioError::NoLine { .. })));
        assert!(matches!(again(&[]), Err(GpioError::NoChip { chip, .. }) if chip == node));
        assert!(again(&[(label, Ok("another"))]).is_err(), "a name that is another's label");
    }

    #[test]
    fn old_kernels_date_edges_by_the_wall_clock() {
        for good in ["5.7.0", "5.10.103-v7+", "6.1.0-56-amd64", "10.0"] {
            assert!(monotonic_since(good), "{good}");
        }
        for bad in ["4.19.0", "5.6.19", "5", "", "x.y"] {
            assert!(!monotonic_since(bad), "{bad}");
        }
        clock_is_monotonic().expect("this machine's kernel");
    }

    /// Whatever chips the machine under test has, each must be described or refused in words.
    #[test]
    fn the_chips_of_this_machine_are_listed() {
        for found in list() {
            match found {
                Ok(chip) => assert!(chip.name.starts_with("gpiochip"), "{chip:?}"),
                Err(e) => assert!(e.to_string().contains("/dev"), "{e}"),
            }
        }
    }
}
