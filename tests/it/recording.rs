//! A recorded drive: what is in its file, and what the writer does with files.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use mcap::MessageStream;
use pmp::{
    dataset::manifest::Manifest,
    error::Error,
    log::{
        CONDITIONS_RECORD,
        encode::{CompressedImage, Header},
        head,
        writer::{ChunkCompression, LogOptions, LogWriter},
    },
    scene::{
        conditions::{Illumination, Sky, Weather},
        shapes::Shapes,
    },
    sim::{
        message::Encoding,
        plan::Episode,
        record::{OUTCOME_RECORD, Recipe, record},
        rig::Rig,
        stage::Stage,
    },
    world::{density::Density, town::Town},
};
use prost::Message as _;
use tempfile::tempdir;

use crate::ingest::{ingest, text};

/// Length of the drives that tests look into.
pub(crate) const SECONDS: f64 = 7.0;

/// Drives of the same episode that tests share.
pub(crate) struct Shared {
    pub(crate) stage: Stage,
    pub(crate) shapes: Shapes,
    pub(crate) episode: Episode,
    folder: tempfile::TempDir,
}

/// Rain at night, dense traffic, steering bursts; after 5 s it turns left.
pub(crate) fn shared() -> &'static Shared {
    static SHARED: OnceLock<Shared> = OnceLock::new();
    SHARED.get_or_init(|| {
        let town = Town::open(None, "Town02").unwrap();
        Shared {
            stage: Stage::new(town),
            shapes: Shapes::new(),
            episode: Episode {
                number: 23,
                seed: 5,
                town: "Town02".into(),
                sky: Sky { illumination: Illumination::Night, weather: Weather::Rainy },
                traffic: Density::Dense,
            },
            folder: tempdir().unwrap(),
        }
    })
}

/// Sensors without noise: what they say can be held against the simulator.
pub(crate) fn exact_rig() -> Rig {
    let mut rig = Rig::default();
    let odometry = &mut rig.odometry;
    odometry.position_std_m = 0.0;
    odometry.yaw_std_rad = 0.0;
    odometry.velocity_std_mps = 0.0;
    odometry.yaw_rate_std_radps = 0.0;
    let radar = &mut rig.radar;
    radar.range_std_m = 0.0;
    radar.angle_std_rad = 0.0;
    radar.speed_std_mps = 0.0;
    rig
}

impl Shared {
    pub(crate) const BURST_CHANCE: f64 = 0.3;

    pub(crate) fn recipe(encoding: Encoding, seconds: f64) -> Recipe {
        let burst_chance = Shared::BURST_CHANCE;
        Recipe { rig: exact_rig(), encoding, seconds: Some(seconds), burst_chance }
    }

    pub(crate) fn record(&self, recipe: &Recipe, name: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        let identity = ("me", &BTreeMap::from([("number".to_string(), "23".to_string())]));
        record(&self.stage, &self.shapes, &self.episode, recipe, &path, identity, &|| ()).unwrap();
        path
    }

    /// A log of Foxglove's messages.
    pub(crate) fn foxglove(&self) -> &'static Path {
        static LOG: OnceLock<PathBuf> = OnceLock::new();
        let recipe = || Shared::recipe(Encoding::Foxglove, SECONDS);
        LOG.get_or_init(|| self.record(&recipe(), "foxglove.mcap"))
    }
}

/// Messages by topic, and how far behind their stamps they were logged, s.
fn messages(log: &Path, stamp_ns: impl Fn(&mcap::Message) -> Option<i64>) -> BTreeMap<String, u64> {
    let bytes = fs::read(log).unwrap();
    let mut counts = BTreeMap::new();
    let (mut stamps, mut last_log_time) = (Vec::new(), 0);
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        *counts.entry(message.channel.topic.clone()).or_insert(0) += 1;
        assert!(message.log_time >= last_log_time, "written in order of arrival");
        last_log_time = message.log_time;
        if let Some(stamp_ns) = stamp_ns(&message) {
            let behind_ms = (message.log_time as i64 - stamp_ns) as f64 / 1e6;
            assert!((0.9..110.0).contains(&behind_ms), "{}: {behind_ms}", message.channel.topic);
            stamps.push(stamp_ns);
        }
    }
    assert!(!stamps.is_sorted(), "arrivals of different sensors are out of stamp order");
    counts
}

fn check_rates(counts: &BTreeMap<String, u64>, seconds: f64, rates: &[(&str, f64)], once: &[&str]) {
    for (topic, rate_hz) in rates {
        let (count, wanted) = (counts[*topic] as f64, seconds * rate_hz);
        assert!((count - wanted).abs() <= 1.5, "{topic}: {count} messages in {seconds} s");
    }
    for topic in once {
        assert_eq!(counts[*topic], 1, "{topic}");
    }
    assert_eq!(counts.len(), rates.len() + once.len(), "{counts:?}");
}

/// What all our protobuf messages but the transforms and boxes begin with.
#[derive(prost::Message)]
struct Stamp {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<prost_types::Timestamp>,
}

#[test]
fn a_log_has_every_topic_at_its_rate_and_arrivals_behind_their_stamps() {
    let counts = messages(shared().foxglove(), |message| {
        let topic = message.channel.topic.as_str();
        // Transforms and boxes have stamps inside, fixes have theirs elsewhere.
        let is_plain = !["/tf", "/tf_static", "/objects", "/gnss"].contains(&topic);
        let stamp = is_plain.then(|| Stamp::decode(&*message.data).unwrap().timestamp.unwrap())?;
        Some(stamp.seconds * 1_000_000_000 + i64::from(stamp.nanos))
    });
    let rates = [
        ("/camera/front/calibration", 10.0),
        ("/camera/front/image", 10.0),
        ("/gnss", 10.0),
        ("/imu", 100.0),
        ("/lidar/points", 10.0),
        ("/objects", 10.0),
        ("/odom", 50.0),
        ("/radar/front", 13.0),
        ("/route", 2.0),
        ("/situation", 10.0),
        ("/tf", 50.0),
        ("/vehicle/applied_control", 20.0),
        ("/vehicle/control", 20.0),
    ];
    check_rates(&counts, SECONDS, &rates, &["/tf_static"]);
}

#[test]
fn ros_2_logs_are_those_of_carlas_bridge_and_give_the_same_frames() {
    let shared = shared();
    const SECONDS: f64 = 1.2;
    let of = |encoding, name: &str| {
        let log = shared.record(&Shared::recipe(encoding, SECONDS), name);
        let dataset = shared.folder.path().join(format!("{name}.data"));
        let said = ingest(&["--out", text(&dataset), text(&log)]);
        assert_eq!(said.code, 0, "{}", said.err);
        let rig = Manifest::read(&dataset).unwrap().logs[0].mapping.rig.clone();
        let frames = crate::ingest::frames(&dataset);
        (log, rig, frames.into_iter().map(|(_, frame)| frame).collect::<Vec<_>>())
    };
    let (log, rig, ros) = of(Encoding::Ros2, "ros2.mcap");
    let counts = messages(&log, |message| {
        let topic = message.channel.topic.as_str();
        let has_header = topic.starts_with("/carla/ego_vehicle/");
        // Seconds and nanoseconds behind the encapsulation header.
        let word = |i: usize| u32::from_le_bytes(message.data[i..i + 4].try_into().unwrap());
        has_header.then(|| i64::from(word(4)) * 1_000_000_000 + i64::from(word(8)))
    });
    let rates = [
        ("/carla/ego_vehicle/gnss", 10.0),
        ("/carla/ego_vehicle/imu", 100.0),
        ("/carla/ego_vehicle/lidar", 10.0),
        ("/carla/ego_vehicle/objects", 10.0),
        ("/carla/ego_vehicle/odometry", 50.0),
        ("/carla/ego_vehicle/radar_front", 13.0),
        ("/carla/ego_vehicle/rgb_front/camera_info", 10.0),
        ("/carla/ego_vehicle/rgb_front/image/compressed", 10.0),
        ("/carla/ego_vehicle/situation", 10.0),
        ("/carla/ego_vehicle/vehicle_control_cmd", 20.0),
        ("/carla/ego_vehicle/vehicle_status", 20.0),
        ("/carla/ego_vehicle/waypoints", 2.0),
        ("/tf", 50.0),
    ];
    check_rates(&counts, SECONDS, &rates, &["/tf_static", "/carla/world_info", "/carla/weather"]);
    assert_eq!(rig.as_deref(), Some("carla-ros-bridge"));

    let (_, rig, foxglove) = of(Encoding::Foxglove, "as-foxglove.mcap");
    assert_eq!(rig.as_deref(), Some("pmp"));
    assert!(ros.len() >= 10, "{} frames", ros.len());
    assert!(ros == foxglove, "the frames differ with the encoding");
}

#[test]
fn a_log_says_what_the_drive_was_like_and_how_it_ended() {
    let words = |name: &str| {
        let bytes = fs::read(shared().foxglove()).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        let index = summary.metadata_indexes.iter().find(|index| index.name == name).unwrap();
        let record = mcap::read::metadata(&bytes, index).unwrap();
        record.metadata.iter().map(|(k, v)| format!("{k}={v}")).collect::<Vec<_>>()
    };
    assert_eq!(
        words(CONDITIONS_RECORD),
        [
            "applied_control=/vehicle/applied_control",
            "illumination=night",
            "town=Town02",
            "traffic=dense",
            "weather=rainy"
        ]
    );
    let outcome = words(OUTCOME_RECORD).join(" ");
    assert!(outcome.starts_with("duration_s=7.00 end=cut-off pedestrians="), "{outcome}");
    let own = head::metadata(shared().foxglove(), "me").unwrap();
    assert_eq!(own, Some(BTreeMap::from([("number".to_string(), "23".to_string())])));
    assert_eq!(head::metadata(shared().foxglove(), "you").unwrap(), None);
}

fn picture() -> CompressedImage {
    let header = Header { stamp_ns: 1_000, frame_id: "camera".into() };
    CompressedImage { header, format: "jpeg".into(), data: vec![1, 2, 3] }
}

fn names(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn every_chunk_compression_reads_back() {
    for compression in [ChunkCompression::Zstd, ChunkCompression::Lz4, ChunkCompression::None] {
        let folder = tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let options = LogOptions { compression, chunk_bytes: 100, ..LogOptions::default() };
        let mut log = LogWriter::create(&path, options).unwrap();
        for i in 0..20 {
            log.write("/camera", &picture(), i * 50).unwrap();
        }
        log.finish().unwrap();
        let bytes = fs::read(&path).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
        assert!(summary.chunk_indexes.len() > 3, "{compression:?}");
        assert_eq!(mcap::MessageStream::new(&bytes).unwrap().filter_map(Result::ok).count(), 20);
    }
}

#[test]
fn writer_refuses_to_overwrite_a_log() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    fs::write(&path, "mine").unwrap();
    let refused = LogWriter::create(&path, LogOptions::default()).err().unwrap();
    assert!(matches!(refused, Error::Exists { .. }), "{refused}");
    assert_eq!(fs::read(&path).unwrap(), b"mine");
}

#[test]
fn topic_that_changes_its_type_is_refused() {
    let folder = tempdir().unwrap();
    let mut log = LogWriter::create(&folder.path().join("l.mcap"), LogOptions::default()).unwrap();
    log.write("/camera", &picture(), 0).unwrap();
    let scan = pmp::log::encode::RadarScan { header: picture().header, returns: vec![] };
    let refused = log.write("/camera", &scan, 1).unwrap_err().to_string();
    assert!(refused.contains("/camera cannot carry radar_msgs/msg/RadarScan too"), "{refused}");
}

#[test]
fn log_that_was_never_finished_leaves_nothing_that_looks_whole() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let mut log = LogWriter::create(&path, LogOptions::default()).unwrap();
    log.write("/camera", &picture(), 0).unwrap();
    // What a kill at this moment would leave behind.
    let left = names(folder.path());
    assert!(left.iter().all(|p| p.extension().unwrap() == "unfinished"), "{left:?}");
    assert!(mcap::Summary::read(&fs::read(&left[0]).unwrap()).is_err());
    drop(log);
    assert!(names(folder.path()).is_empty(), "an abandoned log is cleared away");
}
