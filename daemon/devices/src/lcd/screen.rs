//! A display that shows something: setting its mode, flipping pictures, putting back what was there before.

use std::io;

use drm::{
    Device as _, VblankWaitFlags, VblankWaitTarget,
    control::{
        AtomicCommitFlags, Device as _, PageFlipFlags, PlaneType, RawResourceHandle, ResourceHandle,
        atomic::AtomicModeReq, connector, crtc, framebuffer, plane, property,
    },
};
use rustix::io::Errno;

use super::{
    LcdError, Vblanks,
    canvas::{Buffers, ScanoutBuffer},
    card::{Card, LcdTarget},
};

/// On the screen, handed over, and drawn in.
const BUFFERS: usize = 3;
/// `XR24`: the format of the buffers.
const XRGB8888: u32 = drm::buffer::DrmFourcc::Xrgb8888 as u32;

/// Former picture of a CRTC: the console, as a rule.
#[derive(Debug)]
pub(super) struct Saved {
    crtc: crtc::Info,
    connectors: Vec<connector::Handle>,
}

impl Saved {
    /// Takes down what `crtc` shows.
    pub(super) fn of(card: &Card, crtc: crtc::Handle) -> Result<Self, LcdError> {
        let info = card.tried("ask what is shown", card.get_crtc(crtc))?;
        Ok(Self { crtc: info, connectors: card.served_by(crtc) })
    }

    pub(super) fn crtc(&self) -> crtc::Handle {
        self.crtc.handle()
    }

    /// Puts it back, or switches the display off where nothing was shown or its owner has gone.
    pub(super) fn restore(&self, card: &Card) -> Result<(), LcdError> {
        let crtc = self.crtc.handle();
        let before = match (self.crtc.mode(), self.crtc.framebuffer()) {
            (Some(mode), Some(framebuffer)) if !self.connectors.is_empty() => {
                card.set_crtc(crtc, Some(framebuffer), self.crtc.position(), &self.connectors, Some(mode))
            }
            _ => Err(Errno::NOENT.into()),
        };
        // The kernel puts its console back by itself once the card is closed.
        before.or_else(|_| card.set_crtc(crtc, None, (0, 0), &[], None)).or_else(|source| {
            card.tried("put the console back (switch it with chvt 2, then chvt 1)", Err(source))
        })
    }
}

/// How the kernel is told what to show.
#[derive(Debug)]
enum KmsInterface {
    /// All at once, tested before, without waiting.
    Atomic { plane: plane::Handle, ids: Box<Ids>, mode_blob: u64 },
    /// Drivers without the above.
    Legacy,
}

/// Names of the properties that are set.
#[derive(Debug)]
struct Ids {
    connector_crtc: property::Handle,
    crtc_mode: property::Handle,
    crtc_active: property::Handle,
    plane_framebuffer: property::Handle,
    plane_crtc: property::Handle,
    /// Source x, y, width, height.
    plane_from: [property::Handle; 4],
    /// Place on the screen: x, y, width, height.
    plane_to: [property::Handle; 4],
}

/// Outcome of setting a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Started {
    /// A flip will tell when it shows.
    Pending,
    /// It shows already.
    Shown,
}

/// A display in use.
#[derive(Debug)]
pub(super) struct LcdScreen {
    target: LcdTarget,
    path: KmsInterface,
    buffers: Buffers,
}

impl LcdScreen {
    /// Makes the buffers and finds the path. Shows nothing yet.
    pub(super) fn make(
        card: &Card,
        target: LcdTarget,
        use_atomic: bool,
    ) -> Result<(Self, Vec<ScanoutBuffer>), LcdError> {
        let path = if use_atomic && card.enable_atomic() {
            KmsInterface::atomic(card, &target)?
        } else {
            KmsInterface::Legacy
        };
        let mut screen = Self { target, path, buffers: Buffers::default() };
        let mode = screen.target.choice.mode;
        match screen.buffers.make(card, (mode.width, mode.height), BUFFERS) {
            Ok(canvases) => Ok((screen, canvases)),
            Err(e) => {
                screen.free(card);
                Err(e)
            }
        }
    }

    pub(super) const fn target(&self) -> &LcdTarget {
        &self.target
    }

    pub(super) const fn is_atomic(&self) -> bool {
        matches!(self.path, KmsInterface::Atomic { .. })
    }

    /// Sets the mode with a first picture.
    pub(super) fn start(&self, card: &Card, first: framebuffer::Handle) -> Result<Started, LcdError> {
        let what = "set the mode";
        let KmsInterface::Atomic { plane, ids, mode_blob } = &self.path else {
            let LcdTarget { connector, crtc, kernel_mode, .. } = self.target;
            let set = card.set_crtc(crtc, Some(first), (0, 0), &[connector], Some(kernel_mode));
            card.tried(what, set)?;
            return Ok(Started::Shown);
        };
        let request = || self.mode_request(*plane, ids, *mode_blob, first);
        let modeset = AtomicCommitFlags::ALLOW_MODESET;
        card.tried("use this mode", card.atomic_commit(modeset | AtomicCommitFlags::TEST_ONLY, request()))?;
        let event = modeset | AtomicCommitFlags::PAGE_FLIP_EVENT;
        // Not every driver sets a mode without waiting, and none does while an earlier change is under way.
        let set = card
            .atomic_commit(event | AtomicCommitFlags::NONBLOCK, request())
            .or_else(|e| if is_final(&e) { Err(e) } else { card.atomic_commit(event, request()) });
        card.tried(what, set)?;
        Ok(Started::Pending)
    }

    /// Shows a picture from the next vblank on. `false` where the kernel is busy with an earlier change.
    pub(super) fn flip(&self, card: &Card, next: framebuffer::Handle) -> Result<bool, LcdError> {
        let flipped = match &self.path {
            KmsInterface::Atomic { plane, ids, .. } => {
                let mut request = AtomicModeReq::new();
                set(&mut request, *plane, ids.plane_framebuffer, u32::from(next));
                card.atomic_commit(AtomicCommitFlags::NONBLOCK | AtomicCommitFlags::PAGE_FLIP_EVENT, request)
            }
            KmsInterface::Legacy => card.page_flip(self.target.crtc, next, PageFlipFlags::EVENT, None),
        };
        match flipped {
            Err(e) if Errno::from_io_error(&e) == Some(Errno::BUSY) => Ok(false),
            other => card.tried("show a picture", other).map(|()| true),
        }
    }

    /// Whether the driver counts vblanks; `None` where that cannot be told yet: some drivers report the first flip of a mode
    /// before they start to count.
    pub(super) fn vblanks(&self, card: &Card) -> Option<Vblanks> {
        let now = VblankWaitTarget::Relative(0);
        match card.wait_vblank(now, VblankWaitFlags::empty(), self.target.crtc_index, 0) {
            Ok(_) => Some(Vblanks::Counted),
            Err(e) if Errno::from_io_error(&e) == Some(Errno::OPNOTSUPP) => Some(Vblanks::Absent),
            Err(_) => None,
        }
    }

    /// Switches the display off, so that the mode is set anew when it comes back.
    pub(super) fn switch_off(&self, card: &Card) {
        let off = match &self.path {
            KmsInterface::Atomic { plane, ids, .. } => {
                let mut request = AtomicModeReq::new();
                set(&mut request, self.target.connector, ids.connector_crtc, 0u32);
                set(&mut request, self.target.crtc, ids.crtc_active, false);
                set(&mut request, self.target.crtc, ids.crtc_mode, 0u32);
                set(&mut request, *plane, ids.plane_framebuffer, 0u32);
                set(&mut request, *plane, ids.plane_crtc, 0u32);
                card.atomic_commit(AtomicCommitFlags::ALLOW_MODESET, request)
            }
            KmsInterface::Legacy => card.set_crtc(self.target.crtc, None, (0, 0), &[], None),
        };
        if let Err(e) = off {
            log::debug!("{}: the display was not switched off: {e}", card.node().display());
        }
    }

    /// Frees what the screen holds. Something else must be shown, or nothing.
    pub(super) fn free(mut self, card: &Card) {
        self.buffers.destroy(card);
        if let KmsInterface::Atomic { mode_blob, .. } = self.path
            && let Err(e) = card.destroy_property_blob(mode_blob)
        {
            log::debug!("{}: a mode was not freed: {e}", card.node().display());
        }
    }

    fn mode_request(
        &self,
        plane: plane::Handle,
        ids: &Ids,
        mode_blob: u64,
        framebuffer: framebuffer::Handle,
    ) -> AtomicModeReq {
        let LcdTarget { connector, crtc, ref choice, .. } = self.target;
        let (width, height) = (choice.mode.width, choice.mode.height);
        let mut request = AtomicModeReq::new();
        set(&mut request, connector, ids.connector_crtc, u32::from(crtc));
        set(&mut request, crtc, ids.crtc_mode, mode_blob);
        set(&mut request, crtc, ids.crtc_active, true);
        set(&mut request, plane, ids.plane_framebuffer, u32::from(framebuffer));
        set(&mut request, plane, ids.plane_crtc, u32::from(crtc));
        // The source is in sixteenths of bits: 16.16 fixed point.
        for (id, value) in ids.plane_from.into_iter().zip([0, 0, width, height]) {
            set(&mut request, plane, id, u64::from(value) << 16);
        }
        for (id, value) in ids.plane_to.into_iter().zip([0, 0, width, height]) {
            set(&mut request, plane, id, value);
        }
        request
    }
}

impl KmsInterface {
    fn atomic(card: &Card, target: &LcdTarget) -> Result<Self, LcdError> {
        let plane = primary_plane(card, target)?;
        let of_connector = KmsProperties::of(card, target.connector)?;
        let of_crtc = KmsProperties::of(card, target.crtc)?;
        let of_plane = KmsProperties::of(card, plane)?;
        let ids = Ids {
            connector_crtc: of_connector.id("CRTC_ID")?,
            crtc_mode: of_crtc.id("MODE_ID")?,
            crtc_active: of_crtc.id("ACTIVE")?,
            plane_framebuffer: of_plane.id("FB_ID")?,
            plane_crtc: of_plane.id("CRTC_ID")?,
            plane_from: of_plane.ids(["SRC_X", "SRC_Y", "SRC_W", "SRC_H"])?,
            plane_to: of_plane.ids(["CRTC_X", "CRTC_Y", "CRTC_W", "CRTC_H"])?,
        };
        let blob = card.tried("hand over a mode", card.create_property_blob(&target.kernel_mode))?;
        Ok(Self::Atomic { plane, ids: Box::new(ids), mode_blob: blob.into() })
    }
}

/// The plane that fills the screen: the one in use there, otherwise the first that can be.
fn primary_plane(card: &Card, target: &LcdTarget) -> Result<plane::Handle, LcdError> {
    let resources = card.tried("list the connectors", card.resource_handles())?;
    let mut found = None;
    for handle in card.tried("list the planes", card.plane_handles())? {
        let info = card.tried("ask a plane", card.get_plane(handle))?;
        let serves = resources.filter_crtcs(info.possible_crtcs()).contains(&target.crtc);
        let is_free = info.crtc().is_none_or(|crtc| crtc == target.crtc);
        if !serves || !is_free || !info.formats().contains(&XRGB8888) {
            continue;
        }
        let properties = KmsProperties::of(card, handle)?;
        if properties.value("type") != Some(u64::from(PlaneType::Primary as u32)) {
            continue;
        }
        if info.crtc() == Some(target.crtc) {
            return Ok(handle);
        }
        found.get_or_insert(handle);
    }
    found.ok_or_else(|| LcdError::NoPath {
        node: card.node().to_owned(),
        name: target.choice.connector.clone(),
        what: "plane for plain pixels",
    })
}

/// The properties of one object of a card.
struct KmsProperties<'a> {
    card: &'a Card,
    found: Vec<(String, property::Handle, u64)>,
}

impl<'a> KmsProperties<'a> {
    fn of(card: &'a Card, object: impl ResourceHandle) -> Result<Self, LcdError> {
        let what = "list properties";
        let mut found = Vec::new();
        for (id, value) in card.tried(what, card.get_properties(object))? {
            let info = card.tried(what, card.get_property(id))?;
            found.push((info.name().to_string_lossy().into_owned(), id, value));
        }
        Ok(Self { card, found })
    }

    fn value(&self, name: &str) -> Option<u64> {
        self.found.iter().find(|(n, ..)| n == name).map(|(.., value)| *value)
    }

    fn id(&self, name: &'static str) -> Result<property::Handle, LcdError> {
        self.found
            .iter()
            .find(|(n, ..)| n == name)
            .map(|(_, id, _)| *id)
            .ok_or(LcdError::Unsupported { node: self.card.node().to_owned(), what: name })
    }

    fn ids(&self, names: [&'static str; 4]) -> Result<[property::Handle; 4], LcdError> {
        let [a, b, c, d] = names;
        Ok([self.id(a)?, self.id(b)?, self.id(c)?, self.id(d)?])
    }
}

fn set(
    request: &mut AtomicModeReq,
    object: impl Into<RawResourceHandle>,
    id: property::Handle,
    value: impl Into<u64>,
) {
    request.add_raw_property(object.into(), id, value.into());
}

/// Whether trying in another way is of no use.
fn is_final(error: &io::Error) -> bool {
    matches!(Errno::from_io_error(error), Some(Errno::NODEV | Errno::ACCESS | Errno::PERM))
}
