//! Whole and damaged files: all that can be read is read, and what cannot is said.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeSet, fs, path::Path, process::Command};

use mcap::Compression;
use pmp::{
    atomic::sha256_of_file,
    error::{Error, Result},
    log::reader::{Log, Place, SegmentReader},
};

use crate::fixtures::{Cdr, DriveLog, Layout, Recorded, mcap_bytes, shared};

/// Byte of the opcode and length of a record.
const HEADER_BYTES: usize = 9;
const CHUNK: u8 = 0x06;

/// A message as a scan hands it on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Read {
    topic: String,
    log_time_ns: i64,
    data: Vec<u8>,
}

struct Scanned {
    log: Log,
    messages: Vec<Read>,
    places: Vec<Place>,
}

impl Scanned {
    fn damage(&self) -> Vec<(u64, &str)> {
        self.log.damage.iter().map(|damage| (damage.offset, damage.what.as_str())).collect()
    }
}

fn scan(path: &Path) -> Result<Scanned> {
    let (mut messages, mut places) = (Vec::new(), Vec::new());
    let log = Log::scan(path, &mut |message| {
        messages.push(Read {
            topic: message.channel.topic.clone(),
            log_time_ns: message.log_time_ns,
            data: message.data.to_vec(),
        });
        places.push(message.place);
        Ok(())
    })?;
    Ok(Scanned { log, messages, places })
}

fn scan_bytes(bytes: &[u8]) -> Result<Scanned> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    fs::write(&path, bytes).unwrap();
    scan(&path)
}

fn as_read(messages: &[Recorded]) -> Vec<Read> {
    let read = |message: &Recorded| Read {
        topic: message.topic.to_string(),
        log_time_ns: message.log_time_ns,
        data: message.data.clone(),
    };
    messages.iter().map(read).collect()
}

/// Offsets of the records of a file with that opcode.
fn records(bytes: &[u8], opcode: u8) -> Vec<usize> {
    let (mut at, mut found) = (8, Vec::new());
    while at + HEADER_BYTES <= bytes.len() - 8 {
        if bytes[at] == opcode {
            found.push(at);
        }
        at += HEADER_BYTES + u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
    }
    found
}

fn drive() -> DriveLog {
    DriveLog { seconds: 1.0, ..DriveLog::default() }
}

/// Messages that lie in each chunk, by log time and topic, as an undamaged scan finds them.
fn of_chunk(bytes: &[u8], chunk: usize) -> Vec<Read> {
    let whole = scan_bytes(bytes).unwrap();
    let inside = whole.messages.iter().zip(&whole.places);
    inside.filter(|(_, place)| place.segment == chunk as u32).map(|(m, _)| m.clone()).collect()
}

/// The messages of `bytes` but for those of some chunks.
fn without_chunks(bytes: &[u8], lost: &[usize]) -> Vec<Read> {
    let lost: BTreeSet<Read> = lost.iter().flat_map(|chunk| of_chunk(bytes, *chunk)).collect();
    let whole = scan_bytes(bytes).unwrap();
    whole.messages.into_iter().filter(|message| !lost.contains(message)).collect()
}

#[test]
fn every_layout_gives_every_message_back_and_finds_it_again_by_its_place() {
    let messages = drive().messages();
    let some = Layout::default();
    for layout in [
        some.clone(),
        Layout { compression: Some(Compression::Zstd), ..some.clone() },
        Layout { compression: Some(Compression::Lz4), ..some.clone() },
        Layout { is_chunked: false, ..some.clone() },
        Layout { has_summary: false, ..some.clone() },
        Layout { chunk_bytes: 1 << 20, ..some.clone() },
    ] {
        let scanned = scan_bytes(&mcap_bytes(&messages, &layout)).unwrap();
        assert_eq!(scanned.messages, as_read(&messages), "{layout:?}");
        assert_eq!(scanned.damage(), []);
        assert_eq!(scanned.log.message_count(), messages.len() as u64);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        fs::write(&path, mcap_bytes(&messages, &layout)).unwrap();
        let scanned = scan(&path).unwrap();
        let mut reader = SegmentReader::new(&scanned.log);
        for (message, place) in scanned.messages.iter().zip(&scanned.places) {
            assert_eq!(reader.message(place).unwrap(), message.data);
        }
        assert_eq!(scanned.log.sha256, sha256_of_file(&path).unwrap());
    }
}

#[test]
fn a_file_cut_in_a_chunk_keeps_what_precedes_that_chunk() {
    let bytes = drive().bytes();
    let chunks = records(&bytes, CHUNK);
    let cut = scan_bytes(&bytes[..chunks[2] + 1000]).unwrap();
    assert_eq!(cut.messages, [of_chunk(&bytes, 0), of_chunk(&bytes, 1)].concat());
    let what = "the file is cut off in this chunk, which is left out";
    assert_eq!(cut.damage(), [(chunks[2] as u64, what)]);
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_there_and_says_so() {
    let bytes = drive().bytes();
    let messages = scan_bytes(&bytes).unwrap().messages;
    let end_of_data = records(&bytes, 0x0f)[0];
    for len in (8..bytes.len()).step_by(101) {
        let cut = scan_bytes(&bytes[..len]).unwrap();
        assert_eq!(cut.messages, messages[..cut.messages.len()], "cut at {len}");
        assert!(len > end_of_data || cut.damage().len() == 1, "cut at {len}: {:?}", cut.damage());
    }
}

#[test]
fn an_unchunked_file_cut_in_a_message_keeps_the_messages_before_it() {
    let log = DriveLog { layout: Layout { is_chunked: false, ..Layout::default() }, ..drive() };
    let bytes = log.bytes();
    let at = records(&bytes, 0x05)[7];
    let cut = scan_bytes(&bytes[..at + 40]).unwrap();
    assert_eq!(cut.messages, as_read(&log.messages())[..7]);
    assert_eq!(cut.damage(), [(at as u64, "the file is cut off in this record")]);
}

#[test]
fn a_flipped_byte_in_a_chunk_costs_that_chunk_and_is_reported() {
    for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
        let layout = Layout { compression, ..Layout::default() };
        let whole = DriveLog { seconds: 4.0, layout, ..drive() }.bytes();
        let chunks = records(&whole, CHUNK);
        assert!(chunks.len() >= 3, "{} chunks", chunks.len());
        let mut bytes = whole.clone();
        bytes[chunks[1] + 500] ^= 0x10;
        let scanned = scan_bytes(&bytes).unwrap();
        assert_eq!(scanned.messages, without_chunks(&whole, &[1]), "{compression:?}");
        let [(offset, what)] = scanned.damage()[..] else { panic!("{:?}", scanned.damage()) };
        assert_eq!(offset, chunks[1] as u64);
        assert!(what.ends_with("left out"), "{what}");
    }
}

#[test]
fn a_zeroed_record_header_costs_its_chunk_and_reading_goes_on_at_the_next_indexed_one() {
    let whole = drive().bytes();
    let chunks = records(&whole, CHUNK);
    let mut bytes = whole.clone();
    bytes[chunks[1]..chunks[1] + HEADER_BYTES].fill(0);
    let scanned = scan_bytes(&bytes).unwrap();
    assert_eq!(scanned.messages, without_chunks(&whole, &[1]));
    let what = format!("unreadable record; reading goes on at byte {}", chunks[2]);
    assert_eq!(scanned.damage(), [(chunks[1] as u64, what.as_str())]);
}

#[test]
fn without_an_index_nothing_is_read_behind_an_unreadable_record() {
    let log = DriveLog { layout: Layout { has_summary: false, ..Layout::default() }, ..drive() };
    let mut bytes = log.bytes();
    let chunks = records(&bytes, CHUNK);
    bytes[chunks[1]..chunks[1] + HEADER_BYTES].fill(0);
    let scanned = scan_bytes(&bytes).unwrap();
    assert_eq!(scanned.messages, of_chunk(&log.bytes(), 0));
    let what = "unreadable record; nothing after it was read";
    assert_eq!(scanned.damage(), [(chunks[1] as u64, what)]);
}

#[test]
fn a_chunk_taken_for_another_record_is_missed_by_the_index() {
    let whole = drive().bytes();
    let chunks = records(&whole, CHUNK);
    for (opcode, offset) in [(0x07, chunks[1]), (0x80, chunks[1]), (0x02, chunks[1])] {
        let mut bytes = whole.clone();
        bytes[chunks[1]] = opcode;
        let scanned = scan_bytes(&bytes).unwrap();
        assert_eq!(scanned.messages, without_chunks(&whole, &[1]), "{opcode:#x}");
        assert!(scanned.damage().iter().any(|(at, _)| *at == offset as u64), "{opcode:#x}");
    }
}

#[test]
fn an_unknown_compression_is_named() {
    let layout = Layout { compression: Some(Compression::Zstd), ..Layout::default() };
    let mut bytes = DriveLog { layout, ..drive() }.bytes();
    let chunks = records(&bytes, CHUNK);
    for chunk in &chunks {
        let name = chunk + HEADER_BYTES + 32;
        assert_eq!(&bytes[name..name + 4], b"zstd");
        bytes[name..name + 4].copy_from_slice(b"zpaq");
    }
    let scanned = scan_bytes(&bytes).unwrap();
    assert_eq!(scanned.messages, []);
    let what = "chunk that does not decompress (unknown compression `zpaq`), left out";
    assert_eq!(scanned.damage()[0], (chunks[0] as u64, what));
    assert_eq!(scanned.damage().len(), chunks.len());
}

/// Files whose sizes lie: name and bytes.
fn hostile() -> Vec<(&'static str, Vec<u8>)> {
    let layout = Layout { compression: Some(Compression::Zstd), ..Layout::default() };
    let whole = DriveLog { layout, ..drive() }.bytes();
    let chunk = records(&whole, CHUNK)[0];
    let footer = whole.len() - 8 - HEADER_BYTES - 20;
    let with = |at: usize, value: u64| {
        let mut bytes = whole.clone();
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    vec![
        ("chunk of 16 EiB", with(chunk + HEADER_BYTES + 16, u64::MAX)),
        ("chunk of 500 MB", with(chunk + HEADER_BYTES + 16, 500_000_000)),
        ("stored bytes of 16 EiB", with(chunk + HEADER_BYTES + 36, u64::MAX)),
        ("name of 4 GB", {
            let mut bytes = whole.clone();
            bytes[chunk + HEADER_BYTES + 28..chunk + HEADER_BYTES + 32].fill(0xff);
            bytes
        }),
        ("record of 16 EiB", with(chunk + 1, u64::MAX)),
        ("summary before the file", with(footer + HEADER_BYTES, u64::MAX)),
        ("summary of all of the file", with(footer + HEADER_BYTES, 1)),
    ]
}

#[test]
fn sizes_that_lie_are_damage_and_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in hostile() {
        let path = folder.path().join("log.mcap");
        fs::write(&path, bytes).unwrap();
        // 400 MB of address space, of which the program itself takes a part.
        let script = "ulimit -v 400000; exec \"$0\" inspect --json \"$1\"";
        let program = env!("CARGO_BIN_EXE_pmp-ingest");
        let output = Command::new("sh").args(["-c", script, program]).arg(&path).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{name}: {said}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let is_about_data = !name.starts_with("summary");
        assert_eq!(report["damage"].as_array().unwrap().is_empty(), !is_about_data, "{name}");
    }
}

#[test]
fn an_empty_file_is_an_error_with_a_hint() {
    let error = scan_bytes(b"").err().unwrap();
    assert!(error.to_string().starts_with("the file is empty (byte 0) in "), "{error}");
    assert!(error.hint().unwrap().starts_with("was the recorder stopped"));
}

#[test]
fn a_file_that_is_no_mcap_is_an_error_with_a_hint() {
    for bytes in [b"#ROSBAG V2.0\n".as_slice(), b"\x89MCAP0", b"x"] {
        let error = scan_bytes(bytes).err().unwrap();
        assert!(matches!(error, Error::Log { offset: 0, .. }), "{error:?}");
        assert!(error.to_string().starts_with("this is not an MCAP file"), "{error}");
        assert!(error.hint().unwrap().contains("mcap convert"));
    }
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = scan(Path::new("no/such/log.mcap")).err().unwrap();
    assert!(error.to_string().starts_with("cannot open no/such/log.mcap: "), "{error}");
}

/// A log that is small enough to be damaged in every place.
fn tiny(layout: &Layout) -> (Vec<Recorded>, Vec<u8>) {
    let message = |i: i64| Recorded {
        topic: "/a",
        type_name: "std_msgs/Header",
        log_time_ns: i,
        data: Cdr::new(false).header(i, "a frame").finish(),
    };
    let messages: Vec<Recorded> = (0..6).map(message).collect();
    let bytes = mcap_bytes(&messages, layout);
    (messages, bytes)
}

#[test]
fn no_flipped_byte_makes_a_panic_or_loses_a_message_in_silence() {
    let compression = Some(Compression::Lz4);
    let (messages, whole) = tiny(&Layout { chunk_bytes: 100, compression, ..Layout::default() });
    let messages: BTreeSet<Read> = as_read(&messages).into_iter().collect();
    assert!(records(&whole, CHUNK).len() >= 3);
    let summary = records(&whole, 0x0f)[0];
    for at in 0..whole.len() {
        for flip in [0x01, 0x04, 0x80] {
            let mut bytes = whole.clone();
            bytes[at] ^= flip;
            let Ok(scanned) = scan_bytes(&bytes) else {
                assert!(at < 8, "byte {at} is an error");
                continue;
            };
            let read: BTreeSet<Read> = scanned.messages.iter().cloned().collect();
            assert!(read.is_subset(&messages), "byte {at} flipped by {flip:#x} made a message up");
            let is_told = !scanned.log.damage.is_empty();
            assert!(read == messages || is_told, "byte {at} flipped by {flip:#x} cost in silence");
            assert!(at < summary || read == messages, "byte {at} of the summary cost a message");
        }
    }
}

#[test]
fn no_flipped_byte_of_an_unchunked_file_makes_a_panic() {
    let (_, whole) = tiny(&Layout { is_chunked: false, ..Layout::default() });
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xff;
        assert!(scan_bytes(&bytes).is_ok() || at < 8, "byte {at} is an error");
    }
}

#[test]
fn a_recorded_drive_without_its_middle_is_read_around_the_hole() {
    let Some(path) = shared("logs/comma2k19-ros2.mcap") else { return };
    let whole = scan(&path).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 4096].fill(0);
    let scanned = scan_bytes(&bytes).unwrap();
    let (had, has) = (whole.messages.len(), scanned.messages.len());
    assert!(has < had && has > had * 9 / 10, "{has} of {had} messages");
    assert!(!scanned.log.damage.is_empty());
}
