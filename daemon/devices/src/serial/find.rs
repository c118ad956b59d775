//! Which port a device is on, also after it came back under another name.

use std::{
    fs,
    path::{Path, PathBuf},
};

use super::{PortInfo, SerialError, UsbIdentity, list};
use crate::nodes;

/// Looks for the unit's port.
#[derive(Debug)]
pub(super) struct Finder {
    wanted: Option<PathBuf>,
    /// The adapter that the unit was found on.
    known: Option<UsbIdentity>,
    last_node: Option<PathBuf>,
}

impl Finder {
    pub(super) const fn new(wanted: Option<PathBuf>) -> Self {
        Self { wanted, known: None, last_node: None }
    }

    /// Names to be tried, best first; never empty.
    pub(super) fn candidates(&self) -> Result<Vec<PathBuf>, SerialError> {
        if let Some(pattern) = self.wanted.as_deref().filter(|wanted| is_pattern(wanted)) {
            return matching(pattern);
        }
        // A link that is there needs no look at every port: udev keeps it by the adapter's identity.
        if let Some(wanted) = &self.wanted
            && fs::symlink_metadata(wanted).is_ok_and(|m| m.file_type().is_symlink())
        {
            return Ok(vec![wanted.clone()]);
        }
        let ports = match (&self.wanted, &self.known) {
            (Some(wanted), None) => return Ok(vec![wanted.clone()]),
            _ => list()?,
        };
        let found = choose(self.wanted.as_deref(), self.known.as_ref(), &ports);
        if found.is_empty() {
            let present = nodes::listed(ports.iter().map(|p| p.node.display().to_string()));
            return Err(match &self.known {
                Some(known) => SerialError::Gone { adapter: known.to_string(), present },
                None => SerialError::NoAdapter { present },
            });
        }
        Ok(found)
    }

    /// The unit answers on the port at `node`. Tells its former node where that was another.
    pub(super) fn found(&mut self, node: &Path) -> Option<PathBuf> {
        if self.last_node.as_deref() == Some(node) {
            return None;
        }
        let usb = list().unwrap_or_default().into_iter().find(|p| p.node == node).and_then(|p| p.usb);
        if usb.is_some() {
            self.known = usb;
        }
        self.last_node.replace(node.to_owned())
    }
}

/// Whether a name stands for several.
fn is_pattern(wanted: &Path) -> bool {
    wanted.to_string_lossy().contains(['*', '?', '['])
}

/// The ports there now that fit a pattern.
fn matching(pattern: &Path) -> Result<Vec<PathBuf>, SerialError> {
    let pattern = pattern.to_string_lossy();
    // A pattern that is none was refused with the configuration; here it fits nothing.
    let found: Vec<_> =
        glob::glob(&pattern).map(|paths| paths.filter_map(Result::ok).collect()).unwrap_or_default();
    if found.is_empty() {
        let present = nodes::listed(list()?.iter().map(|p| p.node.display().to_string()));
        return Err(SerialError::NoMatch { pattern: pattern.into_owned(), present });
    }
    Ok(found)
}

/// The ports among `ports` that may carry the unit: the one that was `wanted`, the adapter that is `known`, or, where
/// nothing was said and nothing is known, every USB adapter. Built-in ports must be named: one may be the console.
fn choose(wanted: Option<&Path>, known: Option<&UsbIdentity>, ports: &[PortInfo]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    if let Some(known) = known {
        let same: Vec<_> = ports.iter().filter(|p| p.usb.as_ref() == Some(known)).collect();
        match (same.as_slice(), known.serial.is_some()) {
            (all, true) => found.extend(all.iter().map(|p| p.node.clone())),
            // Without a serial number two of a kind cannot be told apart.
            ([one], false) => found.push(one.node.clone()),
            _ => {}
        }
    }
    match wanted {
        Some(wanted) if !found.iter().any(|f| f == wanted) => {
            // A node that now belongs to another adapter is another device.
            let other = ports.iter().any(|p| p.node == wanted && p.usb.is_some() && p.usb.as_ref() != known);
            if known.is_none() || !other {
                found.push(wanted.to_owned());
            }
        }
        Some(_) => {}
        None if known.is_none() => {
            found.extend(ports.iter().filter(|p| p.usb.is_some()).map(|p| p.node.clone()));
        }
        None => {}
    }
    found
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn usb(node: &str, serial: Option<&str>) -> PortInfo {
        PortInfo {
            node: node.into(),
            by_id: None,
            kind: String::new(),
            usb: Some(UsbIdentity { vendor: 0x0403, product: 0x6001, serial: serial.map(str::to_owned) }),
        }
    }

    fn built_in(node: &str) -> PortInfo {
        PortInfo { node: node.into(), by_id: None, kind: String::new(), usb: None }
    }

    fn chosen(wanted: Option<&str>, known: Option<&PortInfo>, ports: &[PortInfo]) -> Vec<String> {
        let known = known.and_then(|p| p.usb.as_ref());
        choose(wanted.map(Path::new), known, ports).iter().map(|p| p.display().to_string()).collect()
    }

    #[test]
    fn nothing_said_means_any_adapter_until_one_is_known() {
        let (a, b) = (usb("/dev/ttyUSB0", Some("A")), usb("/dev/ttyUSB1", Some("B")));
        let ports = [built_in("/dev/ttyS0"), a.clone(), b.clone()];
        assert_eq!(chosen(None, None, &ports), ["/dev/ttyUSB0", "/dev/ttyUSB1"]);
        assert_eq!(chosen(None, Some(&b), &ports), ["/dev/ttyUSB1"]);
        assert!(chosen(None, Some(&b), &ports[..2]).is_empty());
    }

    #[test]
    fn a_known_adapter_is_followed_to_its_new_name() {
        let known = usb("/dev/ttyUSB0", Some("A"));
        let moved = [usb("/dev/ttyUSB3", Some("A"))];
        assert_eq!(chosen(Some("/dev/ttyUSB0"), Some(&known), &moved), ["/dev/ttyUSB3", "/dev/ttyUSB0"]);
        // Its old name went to another adapter.
        let swapped = [usb("/dev/ttyUSB0", Some("B")), usb("/dev/ttyUSB1", Some("A"))];
        assert_eq!(chosen(Some("/dev/ttyUSB0"), Some(&known), &swapped), ["/dev/ttyUSB1"]);
    }

    #[test]
    fn twins_without_serial_numbers_are_not_guessed_at() {
        let known = usb("/dev/ttyUSB0", None);
        let one = [usb("/dev/ttyUSB2", None)];
        assert_eq!(chosen(None, Some(&known), &one), ["/dev/ttyUSB2"]);
        let twins = [usb("/dev/ttyUSB2", None), usb("/dev/ttyUSB3", None)];
        assert!(chosen(None, Some(&known), &twins).is_empty());
        assert_eq!(chosen(Some("/dev/ttyUSB2"), Some(&known), &twins), ["/dev/ttyUSB2"]);
    }

    #[test]
    fn a_link_is_believed_and_another_node_behind_it_is_noticed() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let link = folder.path().join("imu");
        symlink("/dev/ttyUSB0", &link).expect("link");
        let mut finder = Finder::new(Some(link.clone()));
        assert_eq!(finder.candidates().expect("the link"), [link]);
        assert_eq!(finder.found(Path::new("/dev/ttyUSB0")), None);
        assert_eq!(finder.found(Path::new("/dev/ttyUSB0")), None);
        assert_eq!(finder.found(Path::new("/dev/ttyUSB4")), Some("/dev/ttyUSB0".into()));
    }
}
