//! Survey of a file before its entries are read: from its index, or by reading all of it once.

use std::{
    io::{Read, Seek, SeekFrom},
    path::Path,
    sync::Arc,
};

use bowwave_core::time::Time;
use bowwave_files::plain_file;
use mcap::records::{Record, Statistics, op};

use super::{
    CameraInfo, Counts, Properties, RecordError,
    channels::{Channels, FileNotes},
    messages::{FoundMessage, Messages},
    properties::{CALIBRATION, SCENARIO},
    records::{Records, parse},
    ros,
    schema::Topic,
};

/// Survey of a file before its entries are read.
pub(crate) struct Survey {
    pub(crate) channels: Channels,
    pub(crate) notes: FileNotes,
    pub(crate) camera_info: Option<CameraInfo>,
    pub(crate) counts: Counts,
    pub(crate) span: Option<(Time, Time)>,
    /// Where the file was cut short, if it was.
    pub(crate) cut_at: Option<u64>,
    /// The first thing found wrong with the data, where all of it was read.
    pub(crate) fault: Option<RecordError>,
}

impl Survey {
    /// From the file's index where it has one, else by reading all of it.
    pub(crate) fn of(path: &Arc<Path>) -> Result<Self, RecordError> {
        match Self::from_index(path) {
            Some(survey) => Ok(survey),
            None => Self::from_data(path),
        }
    }

    /// Any doubt about the index gives `None`: the data itself then tells, and names what is wrong.
    fn from_index(path: &Arc<Path>) -> Option<Self> {
        let mut survey = Self::empty();
        let mut statistics = None;
        let mut places = Vec::new();
        let mut data = Vec::new();
        let mut records = Records::open_at(path, summary_start(path)?).ok()?;
        while let Some((opcode, offset)) = records.next(&mut data).ok()? {
            let record = parse(path, opcode, offset, &data).ok()?;
            survey.channels.note(path, &record).ok()?;
            match record {
                Record::Statistics(found) => statistics = Some(found),
                Record::MetadataIndex(index) => places.push(index.offset),
                Record::AttachmentIndex(index) => places.push(index.offset),
                _ => {}
            }
            if places.len() > 1000 {
                return None;
            }
        }
        for place in places {
            let (opcode, offset) = Records::open_at(path, place).ok()?.next(&mut data).ok()??;
            if opcode == op::METADATA || opcode == op::ATTACHMENT {
                survey.notes.note(&parse(path, opcode, offset, &data).ok()?);
            }
        }
        survey.camera_info = first_camera_info(path);
        survey.take_statistics(&statistics?)?;
        survey.notes.metadata.is_some().then_some(survey)
    }

    fn take_statistics(&mut self, statistics: &Statistics) -> Option<()> {
        for (channel, count) in &statistics.channel_message_counts {
            let Some(slot) = self.channels.ours(*channel).and_then(|ours| self.counts.of(ours.topic)) else {
                continue;
            };
            *slot = slot.checked_add(*count)?;
        }
        let start = i64::try_from(statistics.message_start_time).ok()?;
        let end = i64::try_from(statistics.message_end_time).ok()?;
        self.span = Some((Time::from_ns(start), Time::from_ns(end.max(start))));
        Some(())
    }

    /// Reads the whole file once. A file that was cut short, or damaged further on, is surveyed up to there.
    fn from_data(path: &Arc<Path>) -> Result<Self, RecordError> {
        let mut survey = Self::empty();
        let mut messages = Messages::new(Records::open(path)?, Channels::default());
        loop {
            match messages.next() {
                Ok(Some(found)) => survey.take_message(&found),
                Ok(None) => break,
                Err(RecordError::Truncated { offset, .. }) => survey.cut_at = Some(offset),
                // Entries meet it again in its place.
                Err(error) => survey.fault = survey.fault.or(Some(error)),
            }
        }
        survey.channels = std::mem::take(&mut messages.channels);
        survey.notes = std::mem::take(&mut messages.notes);
        Ok(survey)
    }

    fn take_message(&mut self, found: &FoundMessage<'_>) {
        if let Some(count) = self.counts.of(found.topic) {
            *count += 1;
        } else if self.camera_info.is_none() {
            self.camera_info = ros::decode_camera_info(found.data).ok();
        }
        let (first, last) = self.span.unwrap_or((found.logged, found.logged));
        self.span = Some((first.min(found.logged), last.max(found.logged)));
    }

    fn empty() -> Self {
        Self {
            channels: Channels::default(),
            notes: FileNotes::default(),
            camera_info: None,
            counts: Counts::default(),
            span: None,
            cut_at: None,
            fault: None,
        }
    }

    /// Why there are no pictures.
    pub(crate) fn nothing_to_see(self, path: &Path) -> RecordError {
        let ours = self.notes.metadata.is_some();
        match (self.fault, self.cut_at) {
            (Some(RecordError::Compressed { .. } | RecordError::ForeignTopic { .. }) | None, None)
                if !ours =>
            {
                RecordError::Foreign { path: path.into(), topics: self.channels.names }
            }
            (Some(fault), _) => fault,
            (None, cut_at) => RecordError::NoFrames { path: path.into(), cut_at },
        }
    }

    /// The properties, checked.
    pub(crate) fn properties(&self, path: &Path) -> Result<Properties, RecordError> {
        let metadata = self
            .notes
            .metadata
            .as_ref()
            .ok_or_else(|| RecordError::Foreign { path: path.into(), topics: self.channels.names.clone() })?;
        let text = |name: &str| -> Result<Option<String>, RecordError> {
            let Some(bytes) = self.notes.attachments.get(name) else { return Ok(None) };
            String::from_utf8(bytes.clone()).map(Some).map_err(|_| RecordError::Property {
                path: path.into(),
                name: name.into(),
                what: "is not UTF-8".to_owned(),
            })
        };
        let calibration_toml = text(CALIBRATION)?.ok_or_else(|| RecordError::Property {
            path: path.into(),
            name: CALIBRATION.into(),
            what: "is missing".to_owned(),
        })?;
        Ok(Properties {
            calibration_toml,
            scenario_toml: text(SCENARIO)?,
            camera_info: self.camera_info.clone(),
            ..Properties::from_metadata(path, metadata)?
        })
    }
}

/// Where the index begins; `None` where the file does not end as a whole file does.
fn summary_start(path: &Path) -> Option<u64> {
    const TAIL: usize = 9 + 20 + 8;
    let mut file = plain_file(path).ok()?;
    let end = file.seek(SeekFrom::End(-(TAIL as i64))).ok()?;
    let mut tail = [0; TAIL];
    file.read_exact(&mut tail).ok()?;
    let start = u64::from_le_bytes(tail.get(9..17)?.try_into().ok()?);
    let whole = tail[0] == op::FOOTER && tail.ends_with(mcap::MAGIC);
    (whole && (mcap::MAGIC.len() as u64..=end).contains(&start)).then_some(start)
}

/// The camera's numbers where they are the first message, as our writer leaves them.
fn first_camera_info(path: &Arc<Path>) -> Option<CameraInfo> {
    let mut messages = Messages::new(Records::open(path).ok()?, Channels::default());
    let found = messages.next().ok()??;
    (found.topic == Topic::CameraInfo).then(|| ros::decode_camera_info(found.data).ok()).flatten()
}
