//! Making a whole file of one that was cut short or damaged.

use std::{path::Path, sync::Arc};

use super::{
    Counts, RecordError, RecordingWriter, messages::Messages, read::entry, records::Records, survey::Survey,
};

/// Result of recovering a damaged recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RecoverReport {
    /// Counts of what was saved.
    pub saved: Counts,
    /// From the first saved entry to the last, nanoseconds.
    pub saved_ns: i64,
    /// Bytes of the damaged file.
    pub bytes: u64,
    /// Each fault met and what was left out, one line each, at most [`RecoverReport::MAX_FAULTS`].
    pub faults: Vec<String>,
    /// How many faults there were altogether; 0 for a file that was whole.
    pub fault_count: u64,
}

impl RecoverReport {
    /// How many faults are described; more are only counted.
    pub const MAX_FAULTS: usize = 100;
}

/// Writes everything that can be read of the recording at `path` to a new, whole recording at `out`. Chunks and messages that
/// are damaged are left out and reported. Fails where not even the properties can be read.
pub fn recover(path: &Path, out: &Path) -> Result<RecoverReport, RecordError> {
    let path: Arc<Path> = Arc::from(path);
    let survey = Survey::of(&path)?;
    let properties = survey.properties(&path)?;
    let records = Records::open(&path)?;
    let bytes = records.file_bytes();
    let mut messages = Messages::new(records, survey.channels);
    let mut writer = RecordingWriter::create(out, &properties)?;
    let mut faults = RecoveryFaults::default();
    loop {
        let result = match messages.next() {
            Ok(None) => break,
            Ok(Some(found)) => entry(&path, &found),
            Err(error) => Err(error),
        };
        match result {
            Ok(Some(entry)) => match writer.write(&entry) {
                Ok(()) => {}
                Err(fault @ RecordError::Entry { .. }) => faults.add(&fault),
                Err(error) => return Err(error),
            },
            Ok(None) => {}
            Err(fault) => faults.add(&fault),
        }
    }
    let written = writer.finish()?;
    Ok(RecoverReport {
        saved: written.counts,
        saved_ns: written.duration_ns,
        bytes,
        faults: faults.lines,
        fault_count: faults.count,
    })
}

#[derive(Default)]
struct RecoveryFaults {
    lines: Vec<String>,
    count: u64,
}

impl RecoveryFaults {
    fn add(&mut self, fault: &RecordError) {
        self.count += 1;
        if self.lines.len() < RecoverReport::MAX_FAULTS {
            self.lines.push(fault.to_string());
        }
    }
}
