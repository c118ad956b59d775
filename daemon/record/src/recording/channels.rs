//! Declarations of a file: channels, schemas, metadata, attachments.

use std::{collections::BTreeMap, path::Path};

use mcap::records::Record;

use super::{
    RecordError,
    properties::{CALIBRATION, METADATA, SCENARIO},
    schema::{ARRIVAL, MESSAGE_ENCODING, SCHEMA_ENCODING, Topic},
};

/// A channel of a topic of ours.
#[derive(Clone, Copy)]
pub(crate) struct OurChannel {
    pub(crate) topic: Topic,
    /// Arrival is the publish time of its messages; else it is the log time.
    pub(crate) publishes_arrival: bool,
}

/// Meaning of channels and schemas.
#[derive(Clone, Default)]
pub(crate) struct Channels {
    schemas: BTreeMap<u16, (String, String)>,
    channels: BTreeMap<u16, Option<OurChannel>>,
    /// All topics, ours or not.
    pub(crate) names: Vec<String>,
}

impl Channels {
    pub(crate) fn ours(&self, channel: u16) -> Option<OurChannel> {
        self.channels.get(&channel).copied().flatten()
    }

    /// Whether the channel has been declared, be it ours or not.
    pub(crate) fn is_declared(&self, channel: u16) -> bool {
        self.channels.contains_key(&channel)
    }

    /// Notes a schema or channel record; other records are no concern of it.
    pub(crate) fn note(&mut self, path: &Path, record: &Record<'_>) -> Result<(), RecordError> {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, (header.name.clone(), header.encoding.clone()));
            }
            Record::Channel(channel) => {
                if self.names.len() < 16 && !self.names.contains(&channel.topic) {
                    self.names.push(channel.topic.clone());
                }
                // Known from here on, if only as none of ours.
                self.channels.insert(channel.id, None);
                if let Some(topic) = Topic::from_name(&channel.topic) {
                    self.check(path, topic, channel)?;
                    let (name, place) = ARRIVAL;
                    let publishes_arrival = channel.metadata.get(name).is_some_and(|found| found == place);
                    self.channels.insert(channel.id, Some(OurChannel { topic, publishes_arrival }));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn check(&self, path: &Path, topic: Topic, channel: &mcap::records::Channel) -> Result<(), RecordError> {
        let (name, encoding) =
            self.schemas.get(&channel.schema_id).map_or(("no schema", ""), |(n, e)| (n.as_str(), e.as_str()));
        if name == topic.schema_name()
            && encoding == SCHEMA_ENCODING
            && channel.message_encoding == MESSAGE_ENCODING
        {
            return Ok(());
        }
        Err(RecordError::ForeignTopic {
            path: path.into(),
            topic: channel.topic.clone(),
            found: format!("{name} ({encoding}, {})", channel.message_encoding),
            expected: format!("{} ({SCHEMA_ENCODING}, {MESSAGE_ENCODING})", topic.schema_name()),
        })
    }
}

/// Metadata and attachments of ours, as they are in the file.
#[derive(Default)]
pub(crate) struct FileNotes {
    pub(crate) metadata: Option<BTreeMap<String, String>>,
    pub(crate) attachments: BTreeMap<String, Vec<u8>>,
}

impl FileNotes {
    pub(crate) fn note(&mut self, record: &Record<'_>) {
        match record {
            Record::Metadata(metadata) if metadata.name == METADATA => {
                self.metadata = Some(metadata.metadata.clone());
            }
            Record::Attachment { header, data, .. }
                if [CALIBRATION, SCENARIO].contains(&header.name.as_str()) =>
            {
                self.attachments.insert(header.name.clone(), data.to_vec());
            }
            _ => {}
        }
    }
}
