//! A minute of a real drive and damaged copies of it, against numbers that were computed from the
//! source arrays by other means. Skipped, in a printed line, where the files are not there.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use pmp::{
    dataset::manifest::Manifest,
    drops::Reason,
    frame::{Frame, RouteSource},
};
use serde_json::Value;

use crate::{
    fixtures::shared,
    ingest::{Said, frames, into},
};

/// An ingested log.
struct Ingested {
    said: Said,
    frames: Vec<Frame>,
    manifest: Manifest,
    log: PathBuf,
    _folder: tempfile::TempDir,
}

fn ingested(log: PathBuf) -> Ingested {
    let folder = tempfile::tempdir().unwrap();
    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&log]);
    assert!([0, 3].contains(&said.code), "{}", said.err);
    let frames = frames(&dataset).into_iter().map(|(_, frame)| frame).collect();
    let manifest = Manifest::read(&dataset).unwrap();
    Ingested { said, frames, manifest, log, _folder: folder }
}

/// The whole drive, ingested once for all tests.
fn drive() -> Option<&'static Ingested> {
    static DRIVE: OnceLock<Option<Ingested>> = OnceLock::new();
    DRIVE.get_or_init(|| shared("logs/comma2k19-ros2.mcap").map(ingested)).as_ref()
}

fn facts() -> Value {
    let path = shared("facts/comma2k19-ros2.json").unwrap();
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// Header stamps and bytes of a topic, read by the `mcap` crate and from fixed places.
fn messages(log: &Path, topic: &str) -> Vec<(i64, Vec<u8>)> {
    let bytes = fs::read(log).unwrap();
    let word = |data: &[u8], at: usize| {
        i64::from(u32::from_le_bytes(data[at..at + 4].try_into().unwrap()))
    };
    mcap::MessageStream::new(&bytes)
        .unwrap()
        .map_while(Result::ok)
        .filter(|message| message.channel.topic == topic)
        .map(|message| {
            let data = message.data.to_vec();
            (word(&data, 4) * 1_000_000_000 + word(&data, 8), data)
        })
        .collect()
}

fn float(data: &[u8], at: usize) -> f64 {
    f64::from(f32::from_le_bytes(data[at..at + 4].try_into().unwrap()))
}

const CAMERA: &str = "/camera/front/image/compressed";

/// The frame index that is burnt into a stored picture.
fn burnt_in(frame: &Frame) -> u32 {
    let mut decoder =
        zune_jpeg::JpegDecoder::new(zune_jpeg::zune_core::bytestream::ZCursor::new(&frame.image));
    let pixels = decoder.decode().unwrap();
    assert_eq!(decoder.dimensions(), Some((600, 250)));
    // Squares of 24 at (8 + 32 k, 8) of 480 x 360, scaled to 600 x 250: their centres.
    let is_white = |bit: usize| {
        let (column, row) = (25 + 40 * bit, 14);
        pixels[3 * (row * 600 + column)] > 128
    };
    (0..11).map(|bit| u32::from(is_white(bit)) << bit).sum()
}

/// Every picture is the nearest that the log still has.
fn pictures_are_the_nearest(ingested: &Ingested) {
    let stamps: Vec<(i64, u32)> = messages(&ingested.log, CAMERA)
        .iter()
        .map(|(stamp_ns, _)| {
            (*stamp_ns, ((stamp_ns - 1_533_226_488_397_000_000 + 25_000_000) / 50_000_000) as u32)
        })
        .collect();
    for frame in &ingested.frames {
        let nearest = stamps.iter().min_by_key(|(stamp_ns, _)| stamp_ns.abs_diff(frame.stamp_ns));
        let (stamp_ns, index) = nearest.unwrap();
        assert_eq!(burnt_in(frame), *index, "frame {}", frame.index);
        assert_eq!(i64::from(frame.skew.image_ns), stamp_ns - frame.stamp_ns);
    }
}

#[track_caller]
fn near(got: f64, expected: f64, tolerance: f64) {
    assert!((got - expected).abs() <= tolerance, "{got}, expected {expected} +- {tolerance}");
}

fn point(values: &[f32], at: usize) -> [f64; 2] {
    [f64::from(values[2 * at]), f64::from(values[2 * at + 1])]
}

#[test]
fn a_real_drive_has_the_frames_and_the_length_that_its_source_has() {
    let Some(drive) = drive() else { return };
    let facts = &facts()["facts"];
    assert_eq!(drive.said.code, 0, "{}", drive.said.err);
    assert_eq!(drive.frames.len() as u64, facts["grid_10hz_frames"].as_u64().unwrap());
    let full = drive.frames.iter().filter(|frame| frame.future.len == 30).count() as u64;
    assert_eq!(full, facts["grid_10hz_frames_with_full_3s_future"].as_u64().unwrap());
    let log = &drive.manifest.logs[0];
    assert_eq!((log.frames_with_full_future, log.drops.total()), (570, 0));
    assert_eq!(log.start_ns, facts["grid_t0_ns"].as_i64().unwrap());
    near(log.distance_m, facts["distance_xy_m"].as_f64().unwrap(), 1.0);
    assert_eq!(log.messages, 23474);
    let speeds = drive.frames.iter().map(|frame| f64::from(frame.velocity_mps[0]));
    near(speeds.sum::<f64>() / 600.0, facts["mean_speed"].as_f64().unwrap(), 0.1);
}

#[test]
fn speeds_futures_and_routes_of_a_real_drive_are_those_of_its_source() {
    let Some(drive) = drive() else { return };
    for fact in facts()["facts"]["frames"].as_array().unwrap() {
        let number = |key: &str| fact[key].as_f64().unwrap();
        let pair = |key: &str| [0, 1].map(|i| fact[key][i].as_f64().unwrap());
        let frame = &drive.frames[number("tick") as usize];
        assert_eq!(frame.stamp_ns, fact["stamp_ns"].as_i64().unwrap());
        assert_eq!(f64::from(burnt_in(frame)), number("nearest_camera_index"));
        let speed = f64::from(frame.velocity_mps[0]).hypot(f64::from(frame.velocity_mps[1]));
        near(speed, number("speed"), 0.3);
        let future = &frame.future;
        near(f64::from(future.speed_mps[29]), number("speed_plus_3s"), 0.3);
        let mean = future.speed_mps.iter().map(|speed| f64::from(*speed)).sum::<f64>() / 30.0;
        near(mean, number("mean_speed_next_3s"), 0.3);
        let [x, y] = pair("displacement_3s_ego_xy");
        let [got_x, got_y] = point(&future.xy_m, 29);
        near((got_x - x).hypot(got_y - y), 0.0, 0.5);
        near(f64::from(future.yaw_rad[29]).to_degrees(), number("yaw_change_3s_deg"), 1.0);
        assert_eq!(frame.route.source, RouteSource::Driven);
        // Waypoints 25 and 130 lie at 10 m and, since there are 130, the last at 51.6 m.
        let [x, y] = pair("driven_path_point_at_10m_ego_xy");
        let [got_x, got_y] = point(&frame.route.waypoints_m, 25);
        near((got_x - x).hypot(got_y - y), 0.0, 0.3);
        let [x, y] = pair("driven_path_point_at_52m_ego_xy");
        let [got_x, got_y] = point(&frame.route.waypoints_m, 129);
        near(got_x, x - 0.4, 0.3);
        near(got_y, y, 0.3);
    }
}

#[test]
fn every_picture_of_a_real_drive_is_the_nearest_that_was_taken() {
    let Some(drive) = drive() else { return };
    pictures_are_the_nearest(drive);
}

#[test]
fn the_first_radar_scan_of_a_real_drive_falls_where_its_geometry_says() {
    let Some(drive) = drive() else { return };
    let facts = &facts()["facts"]["radar_scan_0"];
    let frame = &drive.frames[0];
    let skew_ns = facts["stamp_ns"].as_i64().unwrap() - frame.stamp_ns;
    assert_eq!(frame.skew.radar_ns.map(i64::from), Some(skew_ns));
    // The radar sits 1.5 m ahead of the camera and 0.7 m below it; both look straight ahead.
    let (fx, fy) = (375.25773196 * 600.0 / 480.0, 374.82837529 * 250.0 / 360.0);
    let mut nearest: BTreeMap<u32, (f64, f64)> = BTreeMap::new();
    for polar in facts["range_azimuth_doppler"].as_array().unwrap() {
        let [range, azimuth, doppler] = [0, 1, 2].map(|i| polar[i].as_f64().unwrap());
        let (ahead, left) = (range * azimuth.cos() + 1.5, range * azimuth.sin());
        let (u, v) = (300.0 - fx * left / ahead, 125.0 + fy * 0.7 / ahead);
        if (0.0..600.0).contains(&u) {
            let seen = nearest.entry(v as u32 * 600 + u as u32).or_insert((f64::MAX, 0.0));
            if ahead.hypot(left) < seen.0 {
                *seen = (ahead.hypot(left), doppler);
            }
        }
    }
    let radar = frame.radar.as_ref().unwrap();
    assert_eq!(radar.pixel, nearest.keys().copied().collect::<Vec<_>>());
    for (got, (_, doppler)) in radar.speed_mps.as_ref().unwrap().iter().zip(nearest.values()) {
        near(got.to_f64(), *doppler, 0.01);
    }
}

#[test]
fn controls_of_a_real_drive_have_the_sign_and_the_range_of_the_bus() {
    let Some(drive) = drive() else { return };
    // Front-wheel angle, positive = left; throttle and steering lie behind a header of 28 bytes.
    let angles = messages(&drive.log, "/vehicle/steering");
    let controls = messages(&drive.log, "/vehicle/control");
    let (mut turning, mut most) = (0, 0.0_f32);
    for frame in &drive.frames {
        let nearest = |samples: &[(i64, Vec<u8>)]| {
            let found = samples.iter().min_by_key(|(stamp, _)| stamp.abs_diff(frame.stamp_ns));
            found.unwrap().clone()
        };
        let (stamp_ns, control) = nearest(&controls);
        assert_eq!(frame.skew.control_ns.map(i64::from), Some(stamp_ns - frame.stamp_ns));
        let (throttle, steer) = (frame.action.throttle.unwrap(), frame.action.steer.unwrap());
        assert_eq!(f64::from(throttle), float(&control, 28));
        assert_eq!(f64::from(steer), float(&control, 32));
        assert_eq!(frame.action.brake, None, "the car slowed down and no brake was recorded");
        let angle = float(&nearest(&angles).1, 28);
        if angle.abs() > 0.0007 {
            turning += 1;
            assert!(f64::from(steer) * angle < 0.0, "steer {steer} at a wheel angle of {angle}");
        }
        most = most.max(throttle);
    }
    assert!(turning > 20, "only {turning} frames tell left from right");
    let gas_max = facts()["facts"]["gas_max"].as_f64().unwrap();
    assert!(f64::from(most) <= gas_max + 1e-3 && f64::from(most) > 0.5 * gas_max, "{most}");
}

#[test]
fn a_truncated_log_gives_the_frames_before_the_cut() {
    let Some(log) = shared("logs/broken/truncated-midchunk.mcap") else { return };
    let broken = ingested(log);
    // Pictures 0 to 710 remain.
    assert_eq!((broken.said.code, broken.frames.len()), (3, 355));
    let expected = "  byte 1522518: the file is cut off in this chunk, which is left out\n";
    assert!(broken.said.err.contains(expected), "{}", broken.said.err);
    pictures_are_the_nearest(&broken);
    if let Some(whole) = drive() {
        let parts = broken.frames.iter().zip(&whole.frames);
        assert!(parts.clone().all(|(part, whole)| part.stamp_ns == whole.stamp_ns));
        assert!(parts.take(300).all(|(part, whole)| part.future == whole.future));
    }
}

#[test]
fn a_camera_gap_of_2_s_costs_its_ticks_and_no_other() {
    let Some(log) = shared("logs/broken/camera-gap-2s.mcap") else { return };
    let broken = ingested(log);
    assert_eq!(broken.said.code, 3, "{}", broken.said.err);
    let dropped = broken.manifest.logs[0].drops.count(Reason::ImageGap);
    assert!((19..=21).contains(&dropped), "{dropped} ticks");
    assert_eq!(broken.frames.len() as u64, 600 - dropped);
    assert!(broken.frames.iter().all(|frame| frame.skew.image_ns.abs() <= 60_000_000));
    pictures_are_the_nearest(&broken);
}

#[test]
fn a_log_without_radar_has_null_radar_columns_and_no_loss() {
    let Some(log) = shared("logs/broken/no-radar.mcap") else { return };
    let broken = ingested(log);
    assert_eq!((broken.said.code, broken.frames.len()), (0, 600));
    assert!(broken.frames.iter().all(|f| f.radar.is_none() && f.skew.radar_ns.is_none()));
}

#[test]
fn logs_of_nothing_are_errors() {
    for (name, what) in
        [("empty", "the file is empty"), ("zero-messages", "the log has no messages")]
    {
        let Some(log) = shared(&format!("logs/broken/{name}.mcap")) else { return };
        let folder = tempfile::tempdir().unwrap();
        let dataset = folder.path().join("data");
        let said = into(&dataset, &[&log]);
        assert!(said.code == 1 && said.err.starts_with(&format!("error: {what}")), "{}", said.err);
        assert!(!dataset.exists());
    }
}

/// What the car's frames say, one line each.
fn as_text(frames: &[Frame]) -> String {
    let mut text = String::new();
    for frame in frames.iter().step_by(20) {
        let [x, y, z] = frame.position_m;
        let [[near_x, near_y], [far_x, far_y]] =
            [25, 129].map(|at| point(&frame.route.waypoints_m, at));
        let [then_x, then_y] = point(&frame.future.xy_m, 29);
        let or_none = |value: Option<f32>| value.map_or("-".into(), |value| format!("{value:.4}"));
        let radar = frame.radar.as_ref();
        writeln!(
            text,
            "{:3} +{:.3} s  v {:.2} {:.2}  yaw {:.4}  at {x:.2} {y:.2} {z:.2}  steer {} throttle {} \
             brake {}  route {} {near_x:.2} {near_y:.2} {far_x:.2} {far_y:.2}  {}  future {} {:.2} \
             {:.4} {then_x:.2} {then_y:.2}  skew ms {:.1} {:.1}  radar {:?}",
            frame.index,
            (frame.stamp_ns - frames[0].stamp_ns) as f64 * 1e-9,
            frame.velocity_mps[0],
            frame.velocity_mps[1],
            frame.yaw_rad,
            or_none(frame.action.steer),
            or_none(frame.action.throttle),
            or_none(frame.action.brake),
            frame.route.len,
            frame.command.name(),
            frame.future.len,
            frame.future.speed_mps[29],
            frame.future.yaw_rad[29],
            f64::from(frame.skew.image_ns) * 1e-6,
            f64::from(frame.skew.radar_ns.unwrap_or_default()) * 1e-6,
            radar.map_or(&[][..], |radar| &radar.pixel[..radar.pixel.len().min(4)]),
        )
        .unwrap();
    }
    text
}

/// `scripts/golden.sh` rewrites the text; review its difference as you would review code.
#[test]
#[allow(clippy::disallowed_methods, reason = "the script has no other way to speak to a test")]
fn a_real_drive_gives_the_frames_it_gave_before() {
    let Some(drive) = drive() else { return };
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/golden/comma2k19-ros2.frames.txt");
    let text = as_text(&drive.frames);
    if std::env::var("PMP_UPDATE_GOLDEN").is_ok() {
        fs::write(&path, &text).unwrap();
    }
    let before = fs::read_to_string(&path).unwrap_or_default();
    for (got, before) in text.lines().zip(before.lines()) {
        assert_eq!(got, before, "scripts/golden.sh rewrites the text, if this is meant");
    }
    assert_eq!(text, before);
}
