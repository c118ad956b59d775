//! Which of the cameras that are there is the one to use: a pure function of what the system lists.

use std::path::{Path, PathBuf};

use bowwave_core::time::NS_PER_S;

use super::CameraSettings;

/// A video node that the system has.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct FoundCamera {
    /// Its node, such as `/dev/video0`.
    pub node: PathBuf,
    /// Names that survive replugging, where udev gives any.
    pub links: Vec<PathBuf>,
    /// Whether the configured name leads to it.
    pub named: bool,
    /// USB serial number, where it has one.
    pub serial: Option<String>,
    /// Its name by the driver.
    pub name: String,
    /// The USB device's node for a reset, where it is one.
    pub usb: Option<PathBuf>,
}

impl FoundCamera {
    /// The identity compared with the calibration's serial number: the USB serial number, or the card's name where there is none.
    pub fn identity(&self) -> &str {
        self.serial.as_deref().unwrap_or(&self.name)
    }

    /// Its lasting name, else its node.
    pub fn best_name(&self) -> &Path {
        self.links.first().unwrap_or(&self.node)
    }

    /// Whether it is surely the same camera as `other`, whatever its node.
    fn is_surely(&self, other: &Self) -> bool {
        let same_serial = self.serial.is_some() && self.serial == other.serial && self.name == other.name;
        same_serial || self.links.iter().any(|link| other.links.contains(link))
    }

    /// Whether nothing distinguishes it from `other` but perhaps its node.
    fn looks_like(&self, other: &Self) -> bool {
        self.serial == other.serial && self.name == other.name && self.usb.is_some() == other.usb.is_some()
    }
}

/// How long another camera has to wait for the one that was in use.
const OTHER_CAMERA_NS: i64 = 5 * NS_PER_S;

/// Choice among the cameras that are there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum CameraChoice {
    /// No camera that is meant.
    Absent,
    /// One is there, but not the calibrated one.
    Mismatch(FoundCamera),
    /// These may be it, best first: a camera has nodes that deliver no pictures beside the one that does.
    Try(Vec<FoundCamera>),
}

/// Chooses among `found` (by node number). `known` is the camera that was in use, `lost_ns` for how long it has been away.
pub(super) fn choose(
    found: &[FoundCamera],
    settings: &CameraSettings,
    known: Option<&FoundCamera>,
    lost_ns: i64,
) -> CameraChoice {
    let those = |wanted: &dyn Fn(&FoundCamera) -> bool| -> Vec<FoundCamera> {
        found.iter().filter(|f| wanted(f)).cloned().collect()
    };
    let surely = known.map(|known| those(&|f| f.is_surely(known))).unwrap_or_default();
    let meant = if !surely.is_empty() {
        surely
    } else if settings.device.is_some() {
        those(&|f| f.named)
    } else if let Some(serial) = &settings.serial {
        let right = those(&|f| f.identity() == serial);
        // Nodes of codecs and the like are no camera that somebody fitted by mistake.
        if right.is_empty() { those(&|f| f.usb.is_some() || !f.links.is_empty()) } else { right }
    } else if let Some(known) = known {
        let alike = those(&|f| f.looks_like(known));
        if alike.is_empty() && lost_ns > OTHER_CAMERA_NS { found.to_vec() } else { alike }
    } else {
        found.to_vec()
    };
    if let Some(serial) = &settings.serial
        && let Some(other) = meant.iter().find(|f| f.identity() != serial)
    {
        let right: Vec<_> = meant.iter().filter(|f| f.identity() == serial).cloned().collect();
        return if right.is_empty() {
            CameraChoice::Mismatch(other.clone())
        } else {
            CameraChoice::Try(right)
        };
    }
    if meant.is_empty() { CameraChoice::Absent } else { CameraChoice::Try(meant) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn usb(node: &str, serial: &str) -> FoundCamera {
        FoundCamera {
            node: node.into(),
            links: vec![format!("/dev/v4l/by-id/usb-Cam_{serial}").into()],
            serial: Some(serial.to_owned()),
            name: "Sea Cam".to_owned(),
            usb: Some("/dev/bus/usb/001/004".into()),
            ..FoundCamera::default()
        }
    }

    fn platform(node: &str, name: &str) -> FoundCamera {
        FoundCamera { node: node.into(), name: name.to_owned(), ..FoundCamera::default() }
    }

    fn nodes(choice: &CameraChoice) -> Vec<&str> {
        match choice {
            CameraChoice::Try(list) => list.iter().map(|f| f.node.to_str().unwrap()).collect(),
            _ => Vec::new(),
        }
    }

    #[test]
    fn without_configuration_the_first_comes_first() {
        let found = [platform("/dev/video0", "codec"), usb("/dev/video1", "A")];
        let choice = choose(&found, &CameraSettings::default(), None, 0);
        assert_eq!(nodes(&choice), ["/dev/video0", "/dev/video1"]);
        assert_eq!(choose(&[], &CameraSettings::default(), None, 0), CameraChoice::Absent);
    }

    #[test]
    fn the_calibrated_camera_is_found_and_another_is_refused() {
        let settings = CameraSettings { serial: Some("B".to_owned()), ..CameraSettings::default() };
        let found = [usb("/dev/video0", "A"), usb("/dev/video2", "B"), usb("/dev/video3", "B")];
        assert_eq!(nodes(&choose(&found, &settings, None, 0)), ["/dev/video2", "/dev/video3"]);
        assert_eq!(choose(&found[..1], &settings, None, 0), CameraChoice::Mismatch(found[0].clone()));
        assert_eq!(choose(&[platform("/dev/video9", "codec")], &settings, None, 0), CameraChoice::Absent);
        // A camera without a serial number goes by its name.
        let settings = CameraSettings {
            serial: Some("B".to_owned()),
            device: Some("/dev/video0".into()),
            ..CameraSettings::default()
        };
        let named = |name| FoundCamera { named: true, ..platform("/dev/video0", name) };
        assert_eq!(nodes(&choose(&[named("B")], &settings, None, 0)), ["/dev/video0"]);
        assert!(matches!(choose(&[named("C")], &settings, None, 0), CameraChoice::Mismatch(_)));
    }

    #[test]
    fn a_lost_camera_is_found_under_another_node_even_if_its_old_one_is_taken() {
        let known = usb("/dev/video0", "A");
        let settings = CameraSettings { device: Some("/dev/video0".into()), ..CameraSettings::default() };
        let taken = FoundCamera { named: true, ..usb("/dev/video0", "Z") };
        let found = [taken.clone(), usb("/dev/video4", "A")];
        assert_eq!(nodes(&choose(&found, &settings, Some(&known), 0)), ["/dev/video4"]);
        assert_eq!(nodes(&choose(&[taken], &settings, Some(&known), 0)), ["/dev/video0"]);
    }

    #[test]
    fn the_next_best_camera_has_to_wait_for_the_one_in_use() {
        let (known, other) = (usb("/dev/video0", "A"), [usb("/dev/video1", "Z")]);
        let settings = CameraSettings::default();
        assert_eq!(choose(&other, &settings, Some(&known), NS_PER_S), CameraChoice::Absent);
        assert_eq!(nodes(&choose(&other, &settings, Some(&known), 6 * NS_PER_S)), ["/dev/video1"]);
        // Nothing tells two virtual cameras of one name apart.
        let again = [platform("/dev/video7", "vivid")];
        let vivid = platform("/dev/video0", "vivid");
        assert_eq!(nodes(&choose(&again, &settings, Some(&vivid), 0)), ["/dev/video7"]);
    }
}
