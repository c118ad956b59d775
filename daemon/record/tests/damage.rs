//! Recordings that are cut short, damaged, hostile or not ours: a clear error, what can be read is read, nothing panics.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

mod support;

use std::{fs, io::Cursor, path::Path};

use bowwave_record::{Entry, RecordError, RecordingReader, recover};
use mcap::records::MessageHeader;
use proptest::prelude::*;
use support::{frame, imu, properties, read, session, sorted, truth, write};

/// A small recording: its bytes and its entries in order.
fn small(folder: &Path) -> (Vec<u8>, Vec<Entry>) {
    let path = folder.join("small.mcap");
    let entries = session(40, 60);
    write(&path, &properties(), &entries);
    (fs::read(path).unwrap(), sorted(&entries))
}

/// One of few bytes in three chunks, written a little out of order.
fn tiny(folder: &Path) -> (Vec<u8>, Vec<Entry>) {
    let path = folder.join("tiny.mcap");
    let entries: Vec<Entry> = (0..12)
        .flat_map(|i| {
            let ms = 1000 + i64::from(i) * 100;
            [imu(ms), frame(ms + 20, i, 10), Entry::Truth(truth(ms + 8))]
        })
        .collect();
    write(&path, &properties(), &entries);
    (fs::read(path).unwrap(), entries)
}

fn opened(path: &Path, bytes: &[u8]) -> Result<RecordingReader, RecordError> {
    fs::write(path, bytes).unwrap();
    RecordingReader::open(path)
}

#[test]
fn cut_at_any_byte_everything_before_the_cut_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, entries) = tiny(folder.path());
    let path = folder.path().join("cut.mcap");
    fs::write(&path, &bytes).unwrap();
    let file = fs::File::options().write(true).open(&path).unwrap();
    let mut most = entries.len();
    for length in (0..bytes.len()).rev() {
        file.set_len(length as u64).unwrap();
        let reader = match RecordingReader::open(&path) {
            Ok(reader) => reader,
            Err(error) => {
                assert!(most <= 2, "{length} bytes: {error}");
                let expected = match length {
                    0 => matches!(error, RecordError::Empty { .. }),
                    _ => matches!(error, RecordError::NoFrames { cut_at: Some(_), .. }),
                };
                assert!(expected, "{length} bytes: {error}");
                continue;
            }
        };
        assert!(reader.cut_at().is_some_and(|at| at <= length as u64), "{length} bytes");
        let (found, error) = read(&reader);
        assert!(matches!(error, Some(RecordError::Truncated { .. })), "{length} bytes: {error:?}");
        // Entries are in the file as they were written: each byte less takes at most the last one.
        assert!(found == sorted(&entries[..found.len()]), "{length} bytes");
        assert!(found.len() == most || found.len() + 1 == most, "{length} bytes");
        assert_eq!(reader.counts().total(), found.len() as u64);
        most = found.len();
    }
    assert_eq!(most, 2, "the first picture was the last to go");
}

#[test]
fn a_cut_file_is_recovered_to_a_whole_one() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, entries) = small(folder.path());
    let (path, out) = (folder.path().join("cut.mcap"), folder.path().join("whole.mcap"));
    fs::write(&path, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let (found, _) = read(&RecordingReader::open(&path).unwrap());
    let report = recover(&path, &out).unwrap();
    assert_eq!(report.saved.total(), found.len() as u64);
    assert!(found.len() > entries.len() / 3);
    assert_eq!(report.fault_count, 1);
    assert!(report.faults[0].contains("cut short"), "{:?}", report.faults);
    let whole = RecordingReader::open(&out).unwrap();
    assert_eq!(*whole.properties(), properties());
    assert_eq!(whole.cut_at(), None);
    let (saved, error) = read(&whole);
    assert!(error.is_none() && saved == found);
    let again = recover(&path, &out).unwrap_err();
    assert!(matches!(again, RecordError::Exists { .. }), "{again}");
}

#[test]
fn a_damaged_chunk_is_reported_and_recovery_keeps_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let (mut bytes, entries) = small(folder.path());
    let (path, out) = (folder.path().join("bad.mcap"), folder.path().join("whole.mcap"));
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    let reader = opened(&path, &bytes).unwrap();
    let (found, error) = read(&reader);
    assert!(error.as_ref().is_some_and(|e| e.to_string().contains("checksum is wrong")), "{error:?}");
    assert!(found == entries[..found.len()]);
    let report = recover(&path, &out).unwrap();
    assert_eq!(report.fault_count, 1, "{:?}", report.faults);
    let (saved, error) = read(&RecordingReader::open(&out).unwrap());
    assert!(error.is_none());
    assert!(saved.len() > found.len() && saved.len() < entries.len());
    assert!(saved.iter().all(|entry| entries.contains(entry)));
}

#[test]
fn a_file_without_index_is_read_all_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, entries) = small(folder.path());
    let path = folder.path().join("plain.mcap");
    // Another writer, no summary, no chunks: the same messages.
    let mut out = Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new()
        .compression(None)
        .use_chunks(false)
        .emit_summary_records(false)
        .emit_summary_offsets(false);
    let mut writer = options.create(&mut out).unwrap();
    copy_messages(&bytes, &mut writer);
    writer.finish().unwrap();
    drop(writer);
    let reader = opened(&path, out.get_ref()).unwrap();
    assert_eq!(*reader.properties(), properties());
    assert_eq!(reader.cut_at(), None);
    let (found, error) = read(&reader);
    assert!(error.is_none() && found == entries, "{error:?}");
}

/// Everything of the file in `bytes`, into `writer`.
fn copy_messages(bytes: &[u8], writer: &mut mcap::Writer<&mut Cursor<Vec<u8>>>) {
    let summary = mcap::Summary::read(bytes).unwrap().unwrap();
    for index in &summary.metadata_indexes {
        writer.write_metadata(&mcap::read::metadata(bytes, index).unwrap()).unwrap();
    }
    for index in &summary.attachment_indexes {
        writer.attach(&mcap::read::attachment(bytes, index).unwrap()).unwrap();
    }
    for message in mcap::MessageStream::new(bytes).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
}

#[test]
fn foreign_files_are_named_as_such() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.mcap");
    for (bytes, expected) in [
        (&b"RIFF....WEBP"[..], "first bytes are not those of an MCAP file"),
        (b"\x89MCAP1\r\n and more", "first bytes are not those of an MCAP file"),
        (b"\x89P", "first bytes are not those of an MCAP file"),
        (b"", "is empty"),
    ] {
        let error = opened(&path, bytes).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("foreign.mcap"), "{error}");
    }
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut out).unwrap();
    let channel = writer.add_channel(0, "/lidar/points", "protobuf", &Default::default()).unwrap();
    let header = MessageHeader { channel_id: channel, sequence: 0, log_time: 5, publish_time: 5 };
    writer.write_to_known_channel(&header, b"points").unwrap();
    writer.finish().unwrap();
    drop(writer);
    let error = opened(&path, out.get_ref()).unwrap_err();
    assert!(matches!(error, RecordError::Foreign { .. }), "{error}");
    assert!(error.to_string().contains("/lidar/points"), "{error}");
    let error = recover(&path, &folder.path().join("out.mcap")).unwrap_err();
    assert!(matches!(error, RecordError::Foreign { .. }), "{error}");
}

#[test]
fn a_topic_of_ours_with_another_schema_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("foreign.mcap");
    let mut out = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut out).unwrap();
    let schema = writer.add_schema("foxglove.CompressedImage", "jsonschema", b"{}").unwrap();
    writer.add_channel(schema, "/camera/image", "json", &Default::default()).unwrap();
    let metadata = properties_metadata(folder.path());
    writer.write_metadata(&metadata).unwrap();
    writer.finish().unwrap();
    drop(writer);
    let error = opened(&path, out.get_ref()).unwrap_err().to_string();
    assert!(error.contains("foxglove.CompressedImage (jsonschema, json)"), "{error}");
}

fn properties_metadata(folder: &Path) -> mcap::records::Metadata {
    let (bytes, _) = small(folder);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap()
}

#[test]
fn a_recording_without_pictures_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dark.mcap");
    write(&path, &properties(), &[imu(1000), imu(1010)]);
    let error = RecordingReader::open(&path).unwrap_err();
    assert!(matches!(error, RecordError::NoFrames { cut_at: None, .. }), "{error}");
}

#[test]
fn properties_that_make_no_sense_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let (bytes, _) = small(folder.path());
    let path = folder.path().join("changed.mcap");
    for (from, to, expected) in [
        (&b"1000000000"[..], &b"100000000x"[..], "start_ns"),
        (b"20000000000", b"-0000000001", "loop_ns"),
        (b"\x04\x00\x00\x001280", b"\x04\x00\x00\x0099x9", "width"),
        (
            b"\x06\x00\x00\x00format\x01\x00\x00\x001",
            b"\x06\x00\x00\x00format\x01\x00\x00\x002",
            "update Bowwave",
        ),
        (b"\x06\x00\x00\x00source", b"\x06\x00\x00\x00Source", "source: is missing"),
    ] {
        let mut changed = bytes.clone();
        let at = changed.windows(from.len()).position(|window| window == from).unwrap();
        changed[at..at + to.len()].copy_from_slice(to);
        let error = opened(&path, &changed).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn claimed_sizes_are_refused_before_anything_is_allocated() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.mcap");
    for (opcode, length) in [(6_u8, u64::MAX), (6, 65 << 20), (9, 1 << 40), (1, 1 << 33)] {
        let mut bytes = mcap::MAGIC.to_vec();
        bytes.push(opcode);
        bytes.extend(length.to_le_bytes());
        bytes.extend([0; 100]);
        let error = opened(&path, &bytes).unwrap_err();
        assert!(matches!(error, RecordError::TooLarge { .. }), "{error}");
    }
    // Within the limit, but more than the file has.
    let mut bytes = mcap::MAGIC.to_vec();
    bytes.push(6);
    bytes.extend((60_u64 << 20).to_le_bytes());
    let error = opened(&path, &bytes).unwrap_err();
    assert!(matches!(error, RecordError::NoFrames { cut_at: Some(8), .. }), "{error}");
}

#[test]
fn a_compressed_chunk_is_named_with_its_method() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, _) = small(folder.path());
    let first_data =
        mcap::Summary::read(&whole).unwrap().unwrap().chunk_indexes[1].chunk_start_offset as usize;
    let mut chunk = vec![0; 16];
    chunk.extend(500_u64.to_le_bytes());
    chunk.extend(0_u32.to_le_bytes());
    chunk.extend(4_u32.to_le_bytes());
    chunk.extend(b"zstd");
    chunk.extend(100_u64.to_le_bytes());
    chunk.extend([0x28; 100]);
    let mut bytes = whole[..first_data].to_vec();
    bytes.push(6);
    bytes.extend((chunk.len() as u64).to_le_bytes());
    bytes.extend(chunk);
    let error = opened(&folder.path().join("zstd.mcap"), &bytes).unwrap_err();
    assert!(matches!(error, RecordError::Compressed { .. }), "{error}");
    assert!(
        error.to_string().contains("\"zstd\"") && error.to_string().contains("without compression"),
        "{error}"
    );
}

#[test]
fn zeros_that_a_power_cut_left_at_the_end_are_no_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("zeros.mcap");
    write(&path, &properties(), &session(40, 4000));
    let whole = fs::read(&path).unwrap();
    let entries = sorted(&session(40, 4000));
    for length in (whole.len() / 2..whole.len() * 3 / 4).step_by(997) {
        let mut bytes = whole[..length].to_vec();
        bytes[length - 3000..].fill(0);
        let (found, error) = read(&opened(&path, &bytes).unwrap());
        assert!(
            matches!(error, Some(RecordError::Truncated { .. } | RecordError::Damaged { .. })),
            "{error:?}"
        );
        assert!(found.iter().all(|entry| entries.contains(entry)), "{length} bytes");
    }
}

#[test]
fn an_attachment_shorter_than_its_header_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("short.mcap");
    for length in 0..48_u64 {
        let mut bytes = mcap::MAGIC.to_vec();
        bytes.push(9);
        bytes.extend(length.to_le_bytes());
        bytes.extend(vec![0; length as usize]);
        assert!(opened(&path, &bytes).is_err());
    }
}

/// Reads as far as it goes.
fn exhaust(path: &Path, bytes: &[u8]) {
    if let Ok(reader) = opened(path, bytes) {
        let count = reader.entries().unwrap().count();
        assert!(count <= bytes.len());
    }
    let out = path.with_extension("out");
    let _ = fs::remove_file(&out);
    if recover(path, &out).is_ok() {
        // What recovery makes is whole, if perhaps without pictures.
        match RecordingReader::open(&out) {
            Ok(reader) => assert!(read(&reader).1.is_none()),
            Err(error) => assert!(matches!(error, RecordError::NoFrames { cut_at: None, .. }), "{error}"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_never_panic(mut bytes in prop::collection::vec(any::<u8>(), 0..600), magic in any::<bool>()) {
        let folder = tempfile::tempdir().unwrap();
        if magic {
            bytes.splice(0..0, mcap::MAGIC.iter().copied());
        }
        exhaust(&folder.path().join("random.mcap"), &bytes);
    }

    #[test]
    fn changed_bytes_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12)) {
        let folder = tempfile::tempdir().unwrap();
        let bytes = changed(SMALL.with(Clone::clone), changes);
        exhaust(&folder.path().join("changed.mcap"), &bytes);
    }

    /// As before, with the checksums left out so that the damage gets past them.
    #[test]
    fn changed_bytes_without_checksums_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12)
    ) {
        let folder = tempfile::tempdir().unwrap();
        let bytes = changed(UNCHECKED.with(Clone::clone), changes);
        exhaust(&folder.path().join("changed.mcap"), &bytes);
    }
}

fn changed(mut bytes: Vec<u8>, changes: Vec<(prop::sample::Index, u8)>) -> Vec<u8> {
    for (index, value) in changes {
        let at = index.index(bytes.len());
        bytes[at] = value;
    }
    bytes
}

thread_local! {
    static SMALL: Vec<u8> = {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("small.mcap");
        write(&path, &properties(), &session(4, 20));
        fs::read(path).unwrap()
    };
    static UNCHECKED: Vec<u8> = {
        let mut out = Cursor::new(Vec::new());
        let options = mcap::WriteOptions::new()
            .compression(None)
            .calculate_chunk_crcs(false)
            .calculate_attachment_crcs(false)
            .calculate_summary_section_crc(false)
            .calculate_data_section_crc(false);
        let mut writer = options.create(&mut out).unwrap();
        copy_messages(&SMALL.with(Clone::clone), &mut writer);
        writer.finish().unwrap();
        drop(writer);
        out.into_inner()
    };
}
