//! What the simulated camera sends: pixels, or JPEG as most cameras do.

use std::sync::Arc;

use bowwave_core::{
    event::{CameraFrame, Picture, PixelFormat},
    time::Time,
};
use bowwave_devices::camera::jpeg::Decoder;
use glam::DQuat;
use image::{ExtendedColorType, codecs::jpeg::JpegEncoder};

use super::{bench::DueFrame, camera::CutCamera};
use crate::{
    panorama::{Panorama, PanoramaError},
    replay::ReplayError,
};

/// JPEG quality of the pictures: that of recordings.
const QUALITY: u8 = 86;

/// A camera before its sea.
pub(super) struct Sensor {
    camera: CutCamera,
    panorama: Panorama,
    /// Where pictures come as JPEG: what they are decoded with.
    decoder: Option<Decoder>,
}

impl Sensor {
    /// A camera that sends JPEG where `is_coded`, else pixels.
    pub fn new(camera: CutCamera, panorama: Panorama, is_coded: bool) -> Self {
        Self { camera, panorama, decoder: is_coded.then(Decoder::for_recordings) }
    }

    /// When the rows of the mesh that it turns are exposed, seconds after the mid-exposure.
    pub fn rows_s(&self) -> impl Iterator<Item = f64> + use<> {
        self.camera.rows_s()
    }

    /// Decodes the sea of a picture between two azimuths ahead of its exposure, radians.
    pub fn prepare(&mut self, frame: &DueFrame, azimuths: [f64; 2]) -> Result<(), ReplayError> {
        Ok(self.panorama.show(frame.number as usize, azimuths)?)
    }

    /// Exposes a picture; `turned` is how the camera is turned as each row of the mesh is exposed. It arrives at `arrival`.
    pub fn expose(
        &mut self,
        frame: &DueFrame,
        turned: impl IntoIterator<Item = DQuat>,
        arrival: Time,
    ) -> Result<CameraFrame, ReplayError> {
        let azimuths = self.camera.aim(&self.panorama.view(), turned);
        self.prepare(frame, azimuths)?;
        let mut rgb = vec![0; self.camera.bytes()];
        self.camera.cut(&self.panorama.view(), frame.number, &mut rgb);
        let (picture, jpeg) = match &mut self.decoder {
            None => {
                let (width, height) = self.camera.size();
                let picture = Picture::new(PixelFormat::Rgb, width, height, rgb.into());
                (picture.map_err(PanoramaError::Picture)?, None)
            }
            Some(decoder) => {
                let (picture, jpeg) = through_jpeg(decoder, &rgb, self.camera.size())?;
                (picture, Some(jpeg))
            }
        };
        Ok(CameraFrame { arrival, mid_exposure: frame.stamp, sequence: frame.number, picture, jpeg })
    }
}

/// A picture as a camera that sends JPEG delivers it, and that JPEG.
fn through_jpeg(
    decoder: &mut Decoder,
    rgb: &[u8],
    (width, height): (u32, u32),
) -> Result<(Picture, Arc<[u8]>), PanoramaError> {
    let mut jpeg = Vec::with_capacity(rgb.len() / 8);
    JpegEncoder::new_with_quality(&mut jpeg, QUALITY)
        .encode(rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(PanoramaError::Encode)?;
    let picture = decoder.decode(&jpeg, Some((width, height))).map_err(PanoramaError::Decode)?;
    Ok((picture, jpeg.into()))
}
