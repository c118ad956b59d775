//! Display cards: what is plugged into them, and the path from picture to connector that is taken.

use std::{
    fs::{File, OpenOptions},
    io,
    os::{
        fd::{AsFd, BorrowedFd},
        unix::fs::OpenOptionsExt,
    },
    path::{Path, PathBuf},
};

use drm::{
    ClientCapability, Device, DriverCapability,
    control::{self, Device as _, ResourceHandles, connector, crtc},
};
use rustix::fs::OFlags;

use super::{CardInfo, Connection, ConnectorInfo, LcdChoice, LcdError, LcdMode, LcdSettings};
use crate::nodes;

const DRI: &str = "/dev/dri";

/// An open card. The first to open it is its master, root or not, until it is closed.
#[derive(Debug)]
pub(super) struct Card {
    file: File,
    node: PathBuf,
}

impl AsFd for Card {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

impl Device for Card {}
impl control::Device for Card {}

/// The path from picture to display: what the kernel calls its parts.
#[derive(Clone, Debug)]
pub(super) struct LcdTarget {
    pub(super) connector: connector::Handle,
    pub(super) crtc: crtc::Handle,
    /// The place of `crtc` among the card's, by which vblanks are asked for.
    pub(super) crtc_index: u32,
    pub(super) kernel_mode: control::Mode,
    pub(super) choice: LcdChoice,
}

impl Card {
    /// Opens a card that can show pictures.
    pub(super) fn open(node: &Path) -> Result<Self, LcdError> {
        let flags = i32::try_from(OFlags::NONBLOCK.bits()).unwrap_or_default();
        let file =
            OpenOptions::new().read(true).write(true).custom_flags(flags).open(node).map_err(|source| {
                match source.kind() {
                    io::ErrorKind::NotFound => LcdError::NotFound {
                        node: node.to_owned(),
                        present: nodes::listed(cards().iter().map(|n| n.display().to_string())),
                    },
                    io::ErrorKind::PermissionDenied => LcdError::Permission { node: node.to_owned() },
                    _ => LcdError::of(node, "open the display", source),
                }
            })?;
        let card = Self { file, node: node.to_owned() };
        let has = |what| card.get_driver_capability(what).is_ok_and(|v| v != 0);
        card.resource_handles().map_err(|source| LcdError::NoDisplays { node: node.to_owned(), source })?;
        if !has(DriverCapability::DumbBuffer) {
            return Err(LcdError::Unsupported { node: node.to_owned(), what: "buffers for plain pixels" });
        }
        // Without it a flip does not tell which display it was of, and without the other not when.
        if !has(DriverCapability::CRTCInVBlankEvent) || !has(DriverCapability::MonotonicTimestamp) {
            return Err(LcdError::Unsupported { node: node.to_owned(), what: "times of flips" });
        }
        Ok(card)
    }

    pub(super) fn node(&self) -> &Path {
        &self.node
    }

    /// Asks for atomic mode setting. `false` where the driver has none.
    pub(super) fn enable_atomic(&self) -> bool {
        self.set_client_capability(ClientCapability::UniversalPlanes, true).is_ok()
            && self.set_client_capability(ClientCapability::Atomic, true).is_ok()
    }

    /// Puts the kernel's answer in words.
    pub(super) fn tried<T>(&self, what: &'static str, result: io::Result<T>) -> Result<T, LcdError> {
        result.map_err(|source| LcdError::of(&self.node, what, source))
    }

    /// The driver's name.
    fn driver(&self) -> String {
        self.get_driver().map_or_else(|_| "unknown".to_owned(), |d| d.name().to_string_lossy().into_owned())
    }

    fn resources(&self) -> Result<ResourceHandles, LcdError> {
        self.tried("list the connectors", self.resource_handles())
    }

    /// The displays that are plugged in. Asks the displays anew where this file is the card's master (which takes some milliseconds and
    /// may make a display that shows something flicker), otherwise tells what the kernel knows.
    fn connectors(&self) -> Result<Vec<connector::Info>, LcdError> {
        let handles = self.resources()?;
        handles
            .connectors()
            .iter()
            .map(|handle| self.tried("ask a connector", self.get_connector(*handle, true)))
            .collect()
    }

    /// Whether a display is still plugged into `connector`, as far as the kernel knows: cheap.
    pub(super) fn is_connected(&self, connector: connector::Handle) -> Result<bool, LcdError> {
        let info = self.tried("ask the connector", self.get_connector(connector, false))?;
        Ok(info.state() != connector::State::Disconnected)
    }

    /// The path to the display that the settings mean.
    pub(super) fn target(&self, settings: &LcdSettings) -> Result<LcdTarget, LcdError> {
        let connectors = self.connectors()?;
        let infos: Vec<_> = connectors.iter().map(ConnectorInfo::from_kernel).collect();
        let place = pick(&self.node, &infos, settings.connector.as_deref())?;
        let (Some(info), Some(connector)) = (infos.get(place), connectors.get(place)) else {
            return Err(LcdError::NoCard);
        };
        let no_mode = || LcdError::NoMode { node: self.node.clone(), name: info.name.clone() };
        let usable: Vec<_> =
            connector.modes().iter().filter_map(|m| Some((*m, LcdMode::from_kernel(m)?))).collect();
        let modes: Vec<_> = usable.iter().map(|(_, mode)| *mode).collect();
        let place = settings.mode.choose(&modes).ok_or_else(no_mode)?;
        let (kernel_mode, mode) = *usable.get(place).ok_or_else(no_mode)?;
        let (crtc, crtc_index) = self.crtc_for(connector, &connectors)?;
        let choice = LcdChoice {
            card: self.node.clone(),
            driver: self.driver(),
            connector: info.name.clone(),
            mode,
            remark: settings.mode.shortfall(&mode),
        };
        Ok(LcdTarget { connector: connector.handle(), crtc, crtc_index, kernel_mode, choice })
    }

    /// The scan-out engine for `wanted`: the one it has, otherwise one that serves no other display.
    fn crtc_for(
        &self,
        wanted: &connector::Info,
        all: &[connector::Info],
    ) -> Result<(crtc::Handle, u32), LcdError> {
        let resources = self.resources()?;
        let now = |c: &connector::Info| c.current_encoder().and_then(|e| self.get_encoder(e).ok()?.crtc());
        let taken: Vec<_> = all.iter().filter(|c| c.handle() != wanted.handle()).filter_map(now).collect();
        let mut able: Vec<_> = now(wanted).into_iter().collect();
        for encoder in wanted.encoders() {
            let encoder = self.tried("ask an encoder", self.get_encoder(*encoder))?;
            able.extend(resources.filter_crtcs(encoder.possible_crtcs()));
        }
        able.iter()
            .filter(|c| !taken.contains(c))
            .find_map(|c| {
                let index = resources.crtcs().iter().position(|other| other == c)?;
                Some((*c, u32::try_from(index).ok()?))
            })
            .ok_or_else(|| LcdError::NoPath {
                node: self.node.clone(),
                name: wanted.to_string(),
                what: "scan-out engine (CRTC)",
            })
    }

    /// The connectors that `crtc` serves now.
    pub(super) fn served_by(&self, crtc: crtc::Handle) -> Vec<connector::Handle> {
        let Ok(resources) = self.resource_handles() else { return Vec::new() };
        let serves = |handle: &connector::Handle| {
            let info = self.get_connector(*handle, false).ok()?;
            self.get_encoder(info.current_encoder()?).ok()?.crtc()
        };
        resources.connectors().iter().copied().filter(|c| serves(c) == Some(crtc)).collect()
    }
}

impl ConnectorInfo {
    fn from_kernel(info: &connector::Info) -> Self {
        Self {
            name: info.to_string(),
            connection: match info.state() {
                connector::State::Connected => Connection::Connected,
                connector::State::Disconnected => Connection::Disconnected,
                connector::State::Unknown => Connection::Unknown,
            },
            modes: info.modes().iter().filter_map(LcdMode::from_kernel).collect(),
        }
    }
}

/// The place of the connector that is meant: the named one, otherwise the first with a display.
fn pick(node: &Path, connectors: &[ConnectorInfo], name: Option<&str>) -> Result<usize, LcdError> {
    let names = || nodes::listed(connectors.iter().map(|c| c.name.clone()));
    let Some(name) = name else {
        return connectors
            .iter()
            .position(|c| c.connection == Connection::Connected)
            .ok_or_else(|| LcdError::NotConnected { node: node.to_owned(), names: names() });
    };
    let (place, found) = connectors.iter().enumerate().find(|(_, c)| c.name == name).ok_or_else(|| {
        LcdError::NoConnector { node: node.to_owned(), name: name.to_owned(), present: names() }
    })?;
    // A panel without a plug may not know whether it is there; naming it is knowledge enough where it has modes.
    let usable = match found.connection {
        Connection::Connected => true,
        Connection::Unknown => !found.modes.is_empty(),
        Connection::Disconnected => false,
    };
    if usable {
        Ok(place)
    } else {
        Err(LcdError::NotConnected { node: node.to_owned(), names: name.to_owned() })
    }
}

fn cards() -> Vec<PathBuf> {
    nodes::numbered(Path::new(DRI), "card").unwrap_or_default()
}

/// The first card with a display that the settings mean. `held` is looked at first, and given back open as long as it is
/// there, so that nobody else becomes its master meanwhile.
pub(super) fn search(
    settings: &LcdSettings,
    held: Option<Card>,
) -> (Option<Card>, Result<LcdTarget, LcdError>) {
    let mut why = None;
    let mut held = held;
    if let Some(card) = &held {
        match card.target(settings) {
            Ok(target) => return (held, Ok(target)),
            Err(LcdError::Gone { .. }) => held = None,
            Err(e) => why = Some(e),
        }
    }
    let others = match &settings.card {
        Some(node) if held.is_none() => vec![node.clone()],
        Some(_) => Vec::new(),
        None => cards().into_iter().filter(|n| held.as_ref().is_none_or(|h| h.node() != n)).collect(),
    };
    for node in others {
        match Card::open(&node).and_then(|card| card.target(settings).map(|target| (card, target))) {
            Ok((card, target)) => return (Some(card), Ok(target)),
            // A card that could show something tells more than one that cannot.
            Err(e @ (LcdError::NoDisplays { .. } | LcdError::Unsupported { .. })) => {
                why.get_or_insert(e);
            }
            Err(e) if why.as_ref().is_none_or(|w| matches!(w, LcdError::NoDisplays { .. })) => why = Some(e),
            Err(_) => {}
        }
    }
    (held, Err(why.unwrap_or(LcdError::NoCard)))
}

/// Every display card of this computer, or why it cannot be used.
pub(super) fn list() -> Vec<Result<CardInfo, LcdError>> {
    cards()
        .iter()
        .map(|node| {
            let card = Card::open(node)?;
            let connectors = card.connectors()?.iter().map(ConnectorInfo::from_kernel).collect();
            Ok(CardInfo {
                node: node.clone(),
                driver: card.driver(),
                is_atomic: card.enable_atomic(),
                connectors,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn connector(name: &str, connection: Connection, modes: usize) -> ConnectorInfo {
        let mode = LcdMode::PANEL;
        ConnectorInfo { name: name.to_owned(), connection, modes: vec![mode; modes] }
    }

    fn picked(name: Option<&str>) -> Result<usize, LcdError> {
        let connectors = [
            connector("HDMI-A-1", Connection::Disconnected, 0),
            connector("DPI-1", Connection::Unknown, 1),
            connector("DSI-1", Connection::Connected, 1),
            connector("VGA-1", Connection::Unknown, 0),
        ];
        pick(Path::new("/dev/dri/card1"), &connectors, name)
    }

    #[test]
    fn the_named_connector_or_the_first_with_a_display_is_taken() {
        assert_eq!(picked(None).expect("one is connected"), 2);
        assert_eq!(picked(Some("DSI-1")).expect("connected"), 2);
        assert_eq!(picked(Some("DPI-1")).expect("it has a mode"), 1);
    }

    #[test]
    fn a_connector_that_cannot_serve_is_refused_in_words() {
        let message = picked(Some("HDMI-A-1")).expect_err("unplugged").to_string();
        assert_eq!(message, "no display on HDMI-A-1 of /dev/dri/card1: check its cable and its power");
        let message = picked(Some("HDMI-A-2")).expect_err("no such").to_string();
        assert!(message.contains("it has HDMI-A-1, DPI-1, DSI-1, VGA-1"), "{message}");
        assert!(matches!(picked(Some("VGA-1")), Err(LcdError::NotConnected { .. })));
        let none = pick(Path::new("/dev/dri/card1"), &[], None).expect_err("no connector").to_string();
        assert!(none.contains("no display on none"), "{none}");
    }

    #[test]
    fn what_is_no_card_is_refused_in_words() {
        assert!(matches!(Card::open(Path::new("/dev/null")), Err(LcdError::NoDisplays { .. })));
        let folder = tempfile::tempdir().expect("temporary folder");
        let message = Card::open(&folder.path().join("card7")).expect_err("not there").to_string();
        assert!(message.contains("card7: cards here:"), "{message}");
    }

    /// Whatever cards the machine under test has, each must be described or refused in words.
    #[test]
    fn the_cards_of_this_machine_are_listed() {
        for found in list() {
            match found {
                Ok(card) => assert!(!card.driver.is_empty(), "{card:?}"),
                Err(e) => assert!(e.to_string().contains("/dev/dri"), "{e}"),
            }
        }
    }
}
