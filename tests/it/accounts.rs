//! What became of every message: accounts against counts of the messages themselves, and damage.
#![allow(clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    io::Cursor,
    path::{Path, PathBuf},
};

use arrow::array::{AsArray, ListArray, StructArray};
use mcap::{Writer, records::MessageHeader};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use pmp::{
    dataset::{
        account::{LeftOut, TopicAccount},
        manifest::{LogRecord, Manifest},
    },
    log::reader::Log,
};

use crate::{
    fixtures::{DriveLog, Layout, Recorded, jpeg, mcap_bytes, ns, shared},
    ingest::{Said, frames, ingest, into, text},
};

const CAMERA: &str = "/camera/front/image/compressed";

fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(format!("{name}.mcap"));
    fs::write(&path, bytes).unwrap();
    path
}

/// Ingest a log; what was said, and its record.
fn made(folder: &Path, name: &str, bytes: &[u8]) -> (Said, LogRecord) {
    let log = write(folder, name, bytes);
    let said = into(&folder.join(name), &[&log]);
    assert!([0, 3].contains(&said.code), "{name}: {}", said.err);
    (said, Manifest::read(&folder.join(name)).unwrap().logs.remove(0))
}

fn account<'r>(record: &'r LogRecord, topic: &str) -> &'r TopicAccount {
    record.topics.iter().find(|account| account.topic == topic).unwrap()
}

/// Messages by topic, counted by a scan.
fn counted(log: &Path) -> BTreeMap<String, u64> {
    let mut counts = BTreeMap::new();
    Log::scan(log, &mut |message| {
        *counts.entry(message.channel.topic.clone()).or_default() += 1;
        Ok(())
    })
    .unwrap();
    counts
}

/// Messages by topic, as `episodes.parquet` has them: read, used, left out.
fn of_table(dataset: &Path) -> BTreeMap<String, (u64, u64, u64)> {
    let file = fs::File::open(dataset.join("episodes.parquet")).unwrap();
    let reader = ParquetRecordBatchReaderBuilder::try_new(file).unwrap().build().unwrap();
    let mut sums: BTreeMap<String, (u64, u64, u64)> = BTreeMap::new();
    for batch in reader.map(Result::unwrap) {
        let topics: &ListArray = batch.column_by_name("topics").unwrap().as_list();
        let structs: &StructArray = topics.values().as_struct();
        let column = |name: &str| structs.column_by_name(name).unwrap().clone();
        let number = |name: &str| {
            column(name).as_primitive::<arrow::datatypes::UInt64Type>().values().to_vec()
        };
        let (read, used, left_out) = (number("read"), number("used"), column("left_out"));
        let left_out: &ListArray = left_out.as_list();
        for (index, topic) in column("topic").as_string::<i32>().iter().enumerate() {
            let reasons = left_out.value(index);
            let counts = reasons.as_struct().column_by_name("count").unwrap().clone();
            let counts = counts.as_primitive::<arrow::datatypes::UInt64Type>();
            let sum = sums.entry(topic.unwrap().to_string()).or_default();
            sum.0 += read[index];
            sum.1 += used[index];
            sum.2 += counts.values().iter().sum::<u64>();
        }
    }
    sums
}

/// Whether the account of a log, ingested alone, is that of its messages and of its frames.
fn adds_up(log: &Path, dataset: &Path) {
    let manifest = Manifest::read(dataset).unwrap();
    let record = &manifest.logs[0];
    let read: BTreeMap<String, u64> =
        record.topics.iter().map(|account| (account.topic.clone(), account.read)).collect();
    assert_eq!(read, counted(log), "{}", log.display());
    for account in &record.topics {
        let left_out: u64 = account.left_out.values().sum();
        assert_eq!(account.read, account.used + left_out, "{account:?}");
    }
    if record.left_out.is_empty() {
        for (topic, (read, used, left_out)) in of_table(dataset) {
            let account = account(record, &topic);
            assert_eq!((read, used, left_out), (account.read, account.used, read - used));
        }
    }
    // A picture is used where a frame has it.
    let frames = frames(dataset);
    let pictures: BTreeSet<(String, i64)> = frames
        .iter()
        .map(|(id, frame)| (id.clone(), frame.stamp_ns + i64::from(frame.skew.image_ns)))
        .collect();
    let camera = record.mapping.camera.as_ref().unwrap();
    assert_eq!(account(record, camera).used, pictures.len() as u64);
    if let Some(lidar) = &record.mapping.lidar {
        let clouds: BTreeSet<i64> = frames
            .iter()
            .filter_map(|(_, frame)| Some(frame.stamp_ns + i64::from(frame.skew.lidar_ns?)))
            .collect();
        assert_eq!(account(record, lidar).used, clouds.len() as u64);
    }
    let skew = record.skews.image.unwrap();
    let mut ms: Vec<f64> =
        frames.iter().map(|(_, f)| f64::from(f.skew.image_ns).abs() * 1e-6).collect();
    ms.sort_by(f64::total_cmp);
    assert!((skew.largest_ms - ms[ms.len() - 1]).abs() < 1e-9);
    assert!(skew.median_ms >= ms[(ms.len() - 1) / 2] && skew.median_ms <= ms[ms.len() / 2]);
    assert_eq!(skew.frames, frames.len() as u64);
}

fn short() -> DriveLog {
    DriveLog { seconds: 2.0, ..DriveLog::default() }
}

#[test]
fn accounts_add_up_for_made_and_for_recorded_logs() {
    let folder = tempfile::tempdir().unwrap();
    let drives = [
        short(),
        DriveLog { bad_pictures: vec![3, 4], ..short() },
        DriveLog { camera_gap_s: Some((0.5, 1.0)), ego_gap_s: Some((1.22, 1.58)), ..short() },
        DriveLog { has_lidar: false, has_control: false, ..short() },
        DriveLog { is_out_of_order: true, ..short() },
    ];
    let mut logs: Vec<PathBuf> = Vec::new();
    for (index, drive) in drives.iter().enumerate() {
        logs.push(drive.write(folder.path(), &format!("{index}.mcap")));
    }
    for name in
        ["comma2k19-ros2", "broken/truncated-midchunk", "broken/camera-gap-2s", "broken/no-radar"]
    {
        logs.extend(shared(&format!("logs/{name}.mcap")));
    }
    for (index, log) in logs.iter().enumerate() {
        let dataset = folder.path().join(format!("{index}"));
        let said = into(&dataset, &[log]);
        assert!([0, 3].contains(&said.code), "{}", said.err);
        adds_up(log, &dataset);
    }
}

#[test]
fn each_message_that_is_left_out_has_its_reason() {
    let folder = tempfile::tempdir().unwrap();
    let drive = DriveLog { bad_pictures: vec![3], ego_gap_s: Some((1.22, 1.58)), ..short() };
    // Pictures at 20 Hz, of which the grid takes every second.
    let between = DriveLog { start_ns: drive.start_ns + ns(0.05), ..short() }.messages();
    let between = between.into_iter().filter(|message| message.topic == CAMERA);
    let early = DriveLog { start_ns: drive.start_ns - ns(0.5), seconds: 0.3, ..short() }.messages();
    let early = early.into_iter().filter(|message| message.topic == "/lidar");
    let mut messages: Vec<Recorded> = early.chain(drive.messages()).chain(between).collect();
    messages.sort_by_key(|message| message.log_time_ns);
    let twice = messages.iter().position(|message| message.topic == "/odom").unwrap();
    messages.insert(twice, messages[twice].clone());
    messages[twice + 20].data.truncate(12);
    let cut = messages[twice + 20].topic;
    let (said, record) = made(folder.path(), "a", &mcap_bytes(&messages, &Layout::default()));
    assert_eq!(said.code, 3);

    let camera = account(&record, CAMERA);
    // Of 21 ticks one has a broken picture and three no ego pose.
    let reasons = BTreeMap::from([
        (LeftOut::Damaged, 1),
        (LeftOut::TickLeftOut, 3),
        (LeftOut::NotNearest, 20),
        (LeftOut::OutsideGrid, 1),
    ]);
    let sum = |reasons: &BTreeMap<LeftOut, u64>| reasons.values().sum::<u64>();
    assert_eq!((camera.read, camera.used), (42, 17), "{camera:?}");
    assert_eq!(sum(&camera.left_out), sum(&reasons));
    for why in [LeftOut::Damaged, LeftOut::TickLeftOut] {
        assert_eq!(camera.left_out[&why], reasons[&why], "{camera:?}");
    }
    let lidar = account(&record, "/lidar");
    assert_eq!((lidar.used, lidar.left_out[&LeftOut::TickLeftOut]), (17, 4), "{lidar:?}");
    assert_eq!(lidar.left_out[&LeftOut::OutsideGrid], 4);
    assert_eq!(account(&record, "/odom").left_out[&LeftOut::SameStamp], 1);
    assert_eq!(account(&record, cut).left_out[&LeftOut::Undecodable], 1);
    let (count, why) = &record.undecodable[cut];
    assert!(*count == 1 && why.contains("logged at 2023-11-14 22:13:2"), "{why}");
    assert!(why.contains("; at byte "), "{why}");
    assert!(
        said.err.contains(&format!("  {CAMERA}: 17 of 42 messages used; not: ")),
        "{}",
        said.err
    );
}

#[test]
fn a_cut_jpeg_costs_its_frame() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = short().messages();
    let message = messages.iter_mut().filter(|message| message.topic == CAMERA).nth(5).unwrap();
    let at = message.data.windows(2).position(|bytes| bytes == [0xff, 0xd8]).unwrap();
    let whole = jpeg(480, 360, 90);
    let part = &whole[..whole.len() / 2];
    message.data.truncate(at - 4);
    message.data.extend_from_slice(&(part.len() as u32).to_le_bytes());
    message.data.extend_from_slice(part);
    let (said, record) = made(folder.path(), "a", &mcap_bytes(&messages, &Layout::default()));
    assert_eq!((said.code, record.frames), (3, 20), "{}", said.err);
    assert_eq!(account(&record, CAMERA).left_out[&LeftOut::Damaged], 1);
}

#[test]
fn messages_of_channels_that_nobody_declared_are_counted_as_damage() {
    let folder = tempfile::tempdir().unwrap();
    let layout = Layout { is_chunked: false, ..Layout::default() };
    let mut bytes = mcap_bytes(&short().messages(), &layout);
    let (mut at, mut seen) = (8, 0);
    while bytes[at] != 0x0f {
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == 0x05 {
            seen += 1;
            if [40, 50, 60].contains(&seen) {
                bytes[at + 9..at + 11].copy_from_slice(&999_u16.to_le_bytes());
            }
        }
        at += 9 + len;
    }
    let (said, record) = made(folder.path(), "a", &bytes);
    assert_eq!(said.code, 3);
    assert_eq!((record.damage.len(), record.messages), (3, seen - 3));
    assert!(record.damage.iter().all(|damage| damage.what.contains("unknown channel 999")));
}

#[test]
fn files_of_other_kinds_are_told_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    for (bytes, name, hint) in [
        (&b"#ROSBAG V2.0\n"[..], "a ROS 1 bag", "mcap convert in.bag out.mcap"),
        (b"SQLite format 3\0", "an SQLite database", "mcap convert in.db3 out.mcap"),
        (b"\x1f\x8b\x08\0\0\0\0\0", "a gzip file", "gunzip"),
        (b"PK\x03\x04\0\0\0\0", "a zip archive", "unzip"),
    ] {
        let log = write(folder.path(), "a", bytes);
        let said = into(&folder.path().join("a"), &[&log]);
        assert_eq!(said.code, 1);
        assert!(said.err.contains(name) && said.err.contains(hint), "{}", said.err);
    }
}

/// A drive with one more topic in an encoding that is not read; `camera`: its own camera goes.
fn with_flatbuffers(has_camera: bool) -> Vec<u8> {
    let messages = short().messages();
    let whole = mcap_bytes(&messages, &Layout::default());
    let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
    let mut channels = BTreeMap::new();
    for message in mcap::MessageStream::new(&whole).unwrap().map(Result::unwrap) {
        if message.channel.topic == CAMERA && !has_camera {
            continue;
        }
        let schema = message.channel.schema.clone().unwrap();
        let id = *channels.entry(message.channel.topic.clone()).or_insert_with(|| {
            let id = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            writer.add_channel(id, &message.channel.topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let header = MessageHeader {
            channel_id: id,
            sequence: message.sequence,
            log_time: message.log_time,
            publish_time: message.publish_time,
        };
        writer.write_to_known_channel(&header, &message.data).unwrap();
    }
    let schema = writer.add_schema("foxglove.CompressedImage", "flatbuffer", b"bfbs").unwrap();
    let channel_id = writer.add_channel(schema, "/flat", "flatbuffer", &BTreeMap::new()).unwrap();
    let header = MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"1234").unwrap();
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

#[test]
fn an_encoding_that_is_not_read_is_an_error_where_it_is_needed_and_else_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let (said, record) = made(folder.path(), "note", &with_flatbuffers(true));
    assert_eq!(said.code, 0, "{}", said.err);
    let note = "/flat (foxglove.CompressedImage): `flatbuffer` definitions";
    assert!(record.notes.iter().any(|told| told.starts_with(note)), "{:?}", record.notes);
    assert_eq!(account(&record, "/flat").left_out[&LeftOut::TopicNotUsed], 1);

    let log = write(folder.path(), "error", &with_flatbuffers(false));
    let said = into(&folder.path().join("error"), &[&log]);
    assert!(said.code == 1 && said.err.starts_with("error: no camera in "), "{}", said.err);
    assert!(said.err.contains(note), "{}", said.err);
    let profile = folder.path().join("flat.toml");
    fs::write(&profile, "[topics]\ncamera = \"/flat\"").unwrap();
    let (dataset, log) = (folder.path().join("named"), folder.path().join("note.mcap"));
    let said = ingest(&["--out", text(&dataset), text(&log), "--profile", text(&profile)]);
    assert!(said.code == 1 && said.err.contains("`/flat` cannot be the camera"), "{}", said.err);
}

#[test]
fn a_sensor_that_a_profile_requires_and_the_log_lacks_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let log = DriveLog { has_lidar: false, ..short() }.write(folder.path(), "a.mcap");
    let profile = folder.path().join("p.toml");
    fs::write(&profile, "[required]\nlidar = true").unwrap();
    let dataset = folder.path().join("a");
    let said = ingest(&["--out", text(&dataset), text(&log), "--profile", text(&profile)]);
    assert!(
        said.code == 1 && said.err.contains("no lidar, which the profile requires"),
        "{}",
        said.err
    );
    assert_eq!(into(&dataset, &[&log]).code, 0);
}
