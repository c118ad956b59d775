//! The driver that asks the kernel.

use std::{
    fs, io,
    os::fd::{AsFd, BorrowedFd, OwnedFd},
    path::{Path, PathBuf},
    sync::Arc,
};

use bowwave_core::{event::Lent, time::Time};
use rustix::{
    event::PollFlags,
    fs::{Mode as Permissions, OFlags},
    io::Errno,
};
use v4l::v4l_sys::{
    V4L2_CID_AUTO_WHITE_BALANCE, V4L2_CID_AUTOGAIN, V4L2_CID_EXPOSURE_ABSOLUTE, V4L2_CID_EXPOSURE_AUTO,
    V4L2_CID_EXPOSURE_AUTO_PRIORITY, V4L2_CID_FOCUS_ABSOLUTE, V4L2_CID_FOCUS_AUTO, V4L2_CID_GAIN,
    V4L2_CID_WHITE_BALANCE_TEMPERATURE,
};

use super::{
    Coding, Rate, Size,
    driver::{CameraDriver, FilledBuffer, OpenedCamera, Ready, SetFormat},
    identity::FoundCamera,
    ioctl,
    mapping::{LentBuffer, Mapping, Returns},
    negotiate::{ModeCandidate, Offer, Rates},
    settings::{CameraSettings, Controls, Exposure, Focus, WhiteBalance},
};
use crate::{clock, nodes, worker::WakeEvent};

/// Opens a node for streaming: never waits, and no child inherits it.
pub(super) fn open_node(node: &Path) -> io::Result<OwnedFd> {
    let flags = OFlags::RDWR | OFlags::NONBLOCK | OFlags::CLOEXEC;
    Ok(rustix::fs::open(node, flags, Permissions::empty())?)
}

/// Where a buffer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum BufferPlace {
    Driver,
    Here,
    Lent,
}

#[derive(Debug)]
struct DriverBuffer {
    mapping: Arc<Mapping>,
    place: BufferPlace,
}

/// An open camera.
#[derive(Debug)]
struct OpenCamera {
    fd: OwnedFd,
    buffers: Vec<DriverBuffer>,
    returns: Arc<Returns>,
    streaming: bool,
}

/// V4L2 on this computer.
pub(super) struct V4l2 {
    wake: Arc<WakeEvent>,
    camera: Option<OpenCamera>,
}

impl V4l2 {
    /// Nothing is open; `wake` ends [`V4l2::wait`] early.
    pub const fn new(wake: Arc<WakeEvent>) -> Self {
        Self { wake, camera: None }
    }

    /// Waits for the camera or for a signal, until `due` at the latest.
    pub fn wait(&self, due: Time) -> Ready {
        let streaming: Vec<_> = self.camera.iter().filter(|c| c.streaming).map(|c| c.fd.as_fd()).collect();
        let wanted = PollFlags::IN | PollFlags::PRI;
        // A wait that fails is a short one.
        let ready = self.wake.wait(&streaming, wanted, due.ns_since(clock::now())).unwrap_or_default();
        self.wake.clear();
        let events = ready.first().copied().unwrap_or(PollFlags::empty());
        Ready {
            filled: events.contains(PollFlags::IN),
            event: events.contains(PollFlags::PRI),
            failed: events.intersects(PollFlags::ERR | PollFlags::HUP | PollFlags::NVAL),
        }
    }

    fn camera(&mut self) -> io::Result<&mut OpenCamera> {
        self.camera.as_mut().ok_or_else(|| Errno::NODEV.into())
    }

    fn fd(&self) -> io::Result<BorrowedFd<'_>> {
        self.camera.as_ref().map(|c| c.fd.as_fd()).ok_or_else(|| Errno::NODEV.into())
    }
}

impl OpenCamera {
    /// Gives the driver every buffer that is here, then starts.
    fn stream_on(&mut self) -> io::Result<()> {
        for index in 0..self.buffers.len() {
            if self.buffers[index].place == BufferPlace::Here {
                self.queue(index as u32)?;
            }
        }
        ioctl::stream(self.fd.as_fd(), true)?;
        self.streaming = true;
        Ok(())
    }

    /// Stops; every buffer that nobody holds is here afterwards.
    fn stream_off(&mut self) -> io::Result<()> {
        self.streaming = false;
        for buffer in self.buffers.iter_mut().filter(|b| b.place == BufferPlace::Driver) {
            buffer.place = BufferPlace::Here;
        }
        ioctl::stream(self.fd.as_fd(), false)
    }

    fn queue(&mut self, index: u32) -> io::Result<()> {
        let buffer = self.buffers.get_mut(index as usize).filter(|b| b.place == BufferPlace::Here);
        let buffer = buffer.ok_or_else(|| io::Error::other("a buffer that is not here to be given back"))?;
        ioctl::queue_buffer(self.fd.as_fd(), index)?;
        buffer.place = BufferPlace::Driver;
        Ok(())
    }

    /// Gives up the buffers. Memory that is lent stays mapped; the kernel frees it with the last mapping.
    fn release(&mut self) {
        let off = self.stream_off();
        self.buffers.clear();
        // Without this the closed device would stay in use as long as a picture is lent: a mapping keeps its file open.
        let released = ioctl::request_buffers(self.fd.as_fd(), 0);
        if let Err(e) = off.and(released) {
            log::debug!("the camera's buffers cannot be given up: {e}");
        }
    }
}

impl CameraDriver for V4l2 {
    fn find(&mut self, settings: &CameraSettings) -> Vec<FoundCamera> {
        let system = CameraSystem { dev: Path::new("/dev"), sys: Path::new("/sys") };
        system.find(settings.device.as_deref())
    }

    fn open(&mut self, node: &Path, settings: &CameraSettings) -> io::Result<OpenedCamera> {
        self.close();
        let fd = open_node(node)?;
        let capability = ioctl::query_capability(fd.as_fd())?;
        let mut opened =
            OpenedCamera { card: capability.card, captures: capability.captures, offers: Vec::new() };
        if opened.captures {
            opened.offers = offers(fd.as_fd(), settings)?;
            // Most cameras have no such event, and need none.
            let _ = ioctl::subscribe_source_change(fd.as_fd());
        }
        let returns = Returns::new(Arc::clone(&self.wake));
        self.camera = Some(OpenCamera { fd, buffers: Vec::new(), returns, streaming: false });
        Ok(opened)
    }

    fn set_mode(&mut self, wanted: &ModeCandidate) -> io::Result<(SetFormat, Option<Rate>)> {
        let fd = self.fd()?;
        let format = ioctl::set_format(fd, wanted)?;
        // ENOTTY: the driver has no rate to set; then it is as it is.
        let rate = match ioctl::set_rate(fd, wanted.mode.rate) {
            Err(e) if matches!(Errno::from_io_error(&e), Some(Errno::NOTTY | Errno::INVAL)) => None,
            rate => rate?,
        };
        // Some drivers change the size with the rate.
        Ok((ioctl::format(fd).unwrap_or(format), rate))
    }

    fn format(&mut self) -> io::Result<SetFormat> {
        ioctl::format(self.fd()?)
    }

    fn set_controls(&mut self, controls: &Controls) -> Vec<&'static str> {
        let Ok(fd) = self.fd() else { return Vec::new() };
        let settings = control_settings(controls);
        // A camera without a switch for what is automatic is not automatic.
        let needed = |id: u32| {
            !matches!(id, V4L2_CID_FOCUS_AUTO | V4L2_CID_AUTOGAIN | V4L2_CID_EXPOSURE_AUTO_PRIORITY)
        };
        settings
            .into_iter()
            .filter(|(id, value, _)| ioctl::set_control(fd, *id, *value).is_err() && needed(*id))
            .map(|(_, _, name)| name)
            .collect()
    }

    fn exposure_ns(&mut self) -> Option<i64> {
        let steps = ioctl::control(self.fd().ok()?, V4L2_CID_EXPOSURE_ABSOLUTE).ok()?;
        (steps > 0).then(|| i64::from(steps) * 100_000)
    }

    fn start(&mut self, buffers: u32) -> io::Result<u32> {
        let camera = self.camera()?;
        let fd = camera.fd.as_fd();
        let granted = ioctl::request_buffers(fd, buffers)?;
        for index in 0..granted.min(32) {
            let (offset, len) = ioctl::query_buffer(fd, index)?;
            let mapping = Arc::new(Mapping::new(fd, offset, len)?);
            camera.buffers.push(DriverBuffer { mapping, place: BufferPlace::Here });
        }
        if camera.buffers.is_empty() {
            return Err(Errno::NOMEM.into());
        }
        camera.stream_on()?;
        Ok(granted)
    }

    fn restart(&mut self) -> io::Result<()> {
        let camera = self.camera()?;
        camera.stream_off()?;
        camera.stream_on()
    }

    fn stop(&mut self) {
        if let Some(camera) = &mut self.camera {
            camera.release();
            // Handles of the old stream must not come back into the next one.
            camera.returns = Returns::new(Arc::clone(&self.wake));
        }
    }

    fn dequeue(&mut self) -> io::Result<Option<FilledBuffer>> {
        let camera = self.camera()?;
        let Some(filled) = ioctl::dequeue_buffer(camera.fd.as_fd())? else { return Ok(None) };
        let buffer = camera.buffers.get_mut(filled.index as usize).filter(|b| b.place == BufferPlace::Driver);
        let buffer =
            buffer.ok_or_else(|| io::Error::other("the driver gave a buffer that it did not have"))?;
        buffer.place = BufferPlace::Here;
        Ok(Some(filled))
    }

    fn bytes(&self, index: u32) -> &[u8] {
        let buffer = self.camera.as_ref().and_then(|c| c.buffers.get(index as usize));
        // SAFETY: a buffer that is here was dequeued; only `queue`, which excludes this borrow, gives it back to the driver.
        buffer.filter(|b| b.place == BufferPlace::Here).map_or(&[], |b| unsafe { b.mapping.bytes() })
    }

    fn queue(&mut self, index: u32) -> io::Result<()> {
        self.camera()?.queue(index)
    }

    fn lend(&mut self, index: u32) -> Option<Arc<dyn Lent>> {
        let camera = self.camera.as_mut()?;
        let buffer = camera.buffers.get_mut(index as usize).filter(|b| b.place == BufferPlace::Here)?;
        buffer.place = BufferPlace::Lent;
        let (mapping, returns) = (Arc::clone(&buffer.mapping), Arc::clone(&camera.returns));
        Some(Arc::new(LentBuffer { mapping, index, returns }))
    }

    fn reclaim(&mut self) -> io::Result<()> {
        let camera = self.camera()?;
        for index in camera.returns.take() {
            let buffer = camera.buffers.get_mut(index as usize).filter(|b| b.place == BufferPlace::Lent);
            if let Some(buffer) = buffer {
                buffer.place = BufferPlace::Here;
                camera.queue(index)?;
            }
        }
        Ok(())
    }

    fn queued(&self) -> usize {
        let buffers = self.camera.as_ref().map_or(&[][..], |c| &c.buffers);
        buffers.iter().filter(|b| b.place == BufferPlace::Driver).count()
    }

    fn source_changed(&mut self) -> bool {
        self.fd().is_ok_and(ioctl::source_changed)
    }

    fn close(&mut self) {
        if let Some(mut camera) = self.camera.take()
            && !camera.buffers.is_empty()
        {
            camera.release();
        }
    }

    fn reset(&mut self, camera: &FoundCamera) -> io::Result<()> {
        let node = camera.usb.as_ref().ok_or(Errno::NOTTY)?;
        let fd = rustix::fs::open(node, OFlags::WRONLY | OFlags::CLOEXEC, Permissions::empty())?;
        ioctl::reset_usb(fd.as_fd())
    }
}

/// The modes that the device offers; where it gives a range of sizes, also the wanted ones in it with their rates.
fn offers(fd: BorrowedFd<'_>, settings: &CameraSettings) -> io::Result<Vec<Offer>> {
    let mut asked: Vec<(u32, u32)> = settings.wanted().iter().map(|m| (m.width, m.height)).collect();
    asked.extend(settings.calibrated_size);
    asked.sort_unstable();
    asked.dedup();
    let mut offers = Vec::new();
    for fourcc in ioctl::capture_formats(fd)? {
        if !Coding::from_fourcc(fourcc).usable() {
            continue;
        }
        let mut sizes = Vec::new();
        for size in ioctl::frame_sizes(fd, fourcc).unwrap_or_default() {
            match size {
                Size::Fixed { width, height } => {
                    sizes.push((size, ioctl::frame_rates(fd, fourcc, width, height)));
                }
                Size::Range { least, most } => {
                    let inside = |(w, h): &(u32, u32)| {
                        (least.0..=most.0).contains(w) && (least.1..=most.1).contains(h)
                    };
                    sizes.extend(asked.iter().copied().filter(inside).map(|(width, height)| {
                        (Size::Fixed { width, height }, ioctl::frame_rates(fd, fourcc, width, height))
                    }));
                    sizes.push((size, Rates::Unknown));
                }
            }
        }
        offers.push(Offer { fourcc, sizes });
    }
    Ok(offers)
}

/// Controls with their values, in the order in which a camera takes them: what is automatic first.
fn control_settings(controls: &Controls) -> Vec<(u32, i32, &'static str)> {
    const MANUAL: i32 = 1;
    const APERTURE_PRIORITY: i32 = 3;
    let int = |value: u32| i32::try_from(value).unwrap_or(i32::MAX);
    let mut list = vec![(V4L2_CID_FOCUS_AUTO, 0, "automatic focus")];
    match controls.exposure {
        Exposure::Leave => {}
        Exposure::Auto => {
            // The automatic mode that cameras with a fixed iris have.
            list.push((V4L2_CID_EXPOSURE_AUTO, APERTURE_PRIORITY, "automatic exposure"));
            list.push((V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0, "constant frame rate"));
        }
        Exposure::Locked { time_us } => {
            list.push((V4L2_CID_EXPOSURE_AUTO, MANUAL, "automatic exposure"));
            list.push((V4L2_CID_EXPOSURE_ABSOLUTE, int(time_us.div_ceil(100)), "exposure time"));
        }
    }
    match controls.white_balance {
        WhiteBalance::Leave => {}
        WhiteBalance::Auto => list.push((V4L2_CID_AUTO_WHITE_BALANCE, 1, "automatic white balance")),
        WhiteBalance::Locked { kelvin } => {
            list.push((V4L2_CID_AUTO_WHITE_BALANCE, 0, "automatic white balance"));
            list.push((V4L2_CID_WHITE_BALANCE_TEMPERATURE, int(kelvin), "white balance"));
        }
    }
    if let Focus::Locked { position } = controls.focus {
        list.push((V4L2_CID_FOCUS_ABSOLUTE, int(position), "focus"));
    }
    if let Some(gain) = controls.gain {
        list.push((V4L2_CID_AUTOGAIN, 0, "automatic gain"));
        list.push((V4L2_CID_GAIN, int(gain), "gain"));
    }
    list
}

/// The folders of the kernel.
struct CameraSystem<'a> {
    dev: &'a Path,
    sys: &'a Path,
}

impl CameraSystem<'_> {
    /// The video nodes; those that `device` leads to are marked.
    fn find(&self, device: Option<&Path>) -> Vec<FoundCamera> {
        let named = device.and_then(|device| fs::canonicalize(device).ok());
        let links = links(&self.dev.join("v4l/by-id"));
        let nodes = nodes::numbered(self.dev, "video").unwrap_or_default();
        let describe = |node: PathBuf| {
            let entry = node.file_name().map(|name| self.sys.join("class/video4linux").join(name));
            let usb = entry.as_ref().and_then(|e| usb_device(&fs::canonicalize(e.join("device")).ok()?));
            let resolved = fs::canonicalize(&node).unwrap_or_else(|_| node.clone());
            FoundCamera {
                links: links.iter().filter(|(_, to)| *to == resolved).map(|(from, _)| from.clone()).collect(),
                named: named.as_ref() == Some(&resolved),
                serial: usb.as_ref().and_then(|usb| line(&usb.join("serial"))),
                name: entry.and_then(|e| line(&e.join("name"))).unwrap_or_default(),
                usb: usb.and_then(|usb| self.usb_node(&usb)),
                node,
            }
        };
        nodes.into_iter().map(describe).collect()
    }

    fn usb_node(&self, usb: &Path) -> Option<PathBuf> {
        let number = |name| line(&usb.join(name))?.parse::<u32>().ok();
        Some(self.dev.join(format!("bus/usb/{:03}/{:03}", number("busnum")?, number("devnum")?)))
    }
}

/// Links in `folder` and where they lead.
fn links(folder: &Path) -> Vec<(PathBuf, PathBuf)> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut links: Vec<_> = entries
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter_map(|link| fs::canonicalize(&link).ok().map(|to| (link, to)))
        .collect();
    links.sort();
    links
}

/// The USB device that `device` (in `/sys/devices`) is a part of.
fn usb_device(device: &Path) -> Option<PathBuf> {
    device.ancestors().take(8).find(|folder| folder.join("idVendor").is_file()).map(Path::to_owned)
}

/// A line of `/sys`, without the blanks around it; `None` where there is nothing on it.
fn line(file: &Path) -> Option<String> {
    let bytes = fs::read(file).ok()?;
    let text = String::from_utf8_lossy(&bytes).trim().to_owned();
    (!text.is_empty()).then_some(text)
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_usb_camera_is_described_from_the_kernels_folders() {
        let root = tempfile::tempdir().unwrap();
        let (dev, sys) = (root.path().join("dev"), root.path().join("sys"));
        let usb = sys.join("devices/usb1/1-2");
        let interface = usb.join("1-2:1.0");
        let entry = sys.join("class/video4linux/video3");
        for folder in [&interface, &entry, &dev.join("v4l/by-id")] {
            fs::create_dir_all(folder).unwrap();
        }
        for (file, text) in
            [("idVendor", "046d\n"), ("serial", "5A3C \n"), ("busnum", "1\n"), ("devnum", "14\n")]
        {
            fs::write(usb.join(file), text).unwrap();
        }
        fs::write(entry.join("name"), "Sea Cam\n").unwrap();
        symlink(&interface, entry.join("device")).unwrap();
        for node in ["video3", "video4"] {
            fs::write(dev.join(node), []).unwrap();
        }
        let link = dev.join("v4l/by-id/usb-Sea_Cam_5A3C-index0");
        symlink("../../video3", &link).unwrap();
        let found = CameraSystem { dev: &dev, sys: &sys }.find(Some(&link));
        let camera = FoundCamera {
            node: dev.join("video3"),
            links: vec![link],
            named: true,
            serial: Some("5A3C".to_owned()),
            name: "Sea Cam".to_owned(),
            usb: Some(dev.join("bus/usb/001/014")),
        };
        let other = FoundCamera { node: dev.join("video4"), ..FoundCamera::default() };
        assert_eq!(found, [camera, other]);
    }

    #[test]
    fn locks_come_after_what_would_undo_them() {
        let controls = Controls {
            exposure: Exposure::Locked { time_us: 4010 },
            white_balance: WhiteBalance::Locked { kelvin: 5500 },
            focus: Focus::Locked { position: 10 },
            gain: Some(3),
        };
        let list = control_settings(&controls);
        let at = |id| list.iter().position(|(i, ..)| *i == id).unwrap();
        assert!(at(V4L2_CID_EXPOSURE_AUTO) < at(V4L2_CID_EXPOSURE_ABSOLUTE));
        assert!(at(V4L2_CID_AUTO_WHITE_BALANCE) < at(V4L2_CID_WHITE_BALANCE_TEMPERATURE));
        assert!(
            at(V4L2_CID_FOCUS_AUTO) < at(V4L2_CID_FOCUS_ABSOLUTE)
                && at(V4L2_CID_AUTOGAIN) < at(V4L2_CID_GAIN)
        );
        assert_eq!(list[at(V4L2_CID_EXPOSURE_ABSOLUTE)].1, 41, "steps of 100 us");
    }

    #[test]
    fn nothing_open_is_a_device_that_is_gone() {
        let mut driver = V4l2::new(Arc::new(WakeEvent::new().unwrap()));
        let gone = |e: io::Error| e.raw_os_error() == Some(Errno::NODEV.raw_os_error());
        assert!(driver.dequeue().is_err_and(gone));
        assert!(driver.start(4).is_err_and(gone));
        assert!(driver.bytes(0).is_empty() && driver.lend(0).is_none() && driver.queued() == 0);
        let before = clock::now();
        assert_eq!(driver.wait(before.plus_ns(2_000_000)), Ready::default());
        assert!(clock::now() >= before.plus_ns(2_000_000));
    }
}
