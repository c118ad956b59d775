//! The pictures that the simulated camera sends: pixels, or JPEG as most cameras do.

use std::sync::Arc;

use bowwave_core::{
    event::{CameraFrame, Picture, PixelFormat},
    time::Time,
};
use bowwave_devices::camera::jpeg::Decoder;
use glam::DQuat;

use super::{bench::DueFrame, camera::CutCamera};
use crate::{
    jpeg,
    panorama::{Panorama, PanoramaError},
    replay::ReplayError,
};

/// A camera before its sea.
pub(super) struct Sensor {
    camera: CutCamera,
    panorama: Panorama,
    /// Quality and decoder of pictures that come as JPEG.
    coder: Option<(u8, Decoder)>,
}

impl Sensor {
    /// A camera that sends JPEG of that quality, else pixels.
    pub fn new(camera: CutCamera, panorama: Panorama, quality: Option<u8>) -> Self {
        Self { camera, panorama, coder: quality.map(|quality| (quality, Decoder::for_recordings())) }
    }

    /// Times at which the rows of the mesh that it turns are exposed, seconds after the mid-exposure.
    pub fn rows_s(&self) -> impl Iterator<Item = f64> + use<> {
        self.camera.rows_s()
    }

    /// Decodes the sea of a picture between two azimuths ahead of its exposure, radians.
    pub fn prepare(&mut self, frame: &DueFrame, azimuths: [f64; 2]) -> Result<(), ReplayError> {
        Ok(self.panorama.show(frame.number as usize, azimuths)?)
    }

    /// Exposes a picture; `turned` is how the camera is turned as each row of the mesh is exposed, `recoil` the muzzle's factor. It arrives at
    /// `arrival`.
    pub fn expose(
        &mut self,
        frame: &DueFrame,
        turned: impl IntoIterator<Item = DQuat>,
        recoil: f64,
        arrival: Time,
    ) -> Result<CameraFrame, ReplayError> {
        let azimuths = self.camera.aim(&self.panorama.view(), turned);
        self.prepare(frame, azimuths)?;
        let mut rgb = vec![0; self.camera.bytes()];
        self.camera.cut(&self.panorama.view(), frame.number, &mut rgb);
        self.camera.draw_sight(recoil, &mut rgb);
        let size = self.camera.size();
        let (picture, jpeg) = match &mut self.coder {
            None => {
                let picture = Picture::new(PixelFormat::Rgb, size.0, size.1, rgb.into());
                (picture.map_err(PanoramaError::Picture)?, None)
            }
            Some((quality, decoder)) => {
                let jpeg = jpeg::encode(&rgb, size, *quality).map_err(PanoramaError::Encode)?;
                let picture = decoder.decode(&jpeg, Some(size)).map_err(PanoramaError::Decode)?;
                (picture, Some(Arc::from(jpeg)))
            }
        };
        Ok(CameraFrame { arrival, mid_exposure: frame.stamp, sequence: frame.number, picture, jpeg })
    }
}
