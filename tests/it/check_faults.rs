//! One planted fault for every check of `pmp-stats check`, and what else necessarily follows.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path, sync::Arc};

use arrow::array::{ArrayRef, RecordBatch, StringArray};
use half::f16;
use pmp::{
    dataset::{
        manifest::{EpisodeRecord, FailedLog, LogRecord, Manifest},
        split::Split,
    },
    drops::Reason,
    frame::{Command, FUTURE_STEPS, Frame, RouteSource},
};

use crate::checks::{Course, Drive, HEIGHT, Pose, WIDTH, jpeg};

/// When a fault is planted on the way from a course to files.
pub(crate) enum Plant {
    /// How the cars are driven.
    Courses(fn(&mut [Course])),
    /// Where the cars are, before anything is derived from it.
    Poses(fn(&mut [Vec<Pose>])),
    /// Frames, before they are written.
    Drives(fn(&mut Vec<Drive>)),
    /// The table of the first drive's shard.
    Shard(fn(RecordBatch) -> RecordBatch),
    /// Records, before the table of episodes and the manifest are made of them.
    Records(fn(&Path, &mut Vec<LogRecord>)),
    /// The manifest, before it is written.
    Manifest(fn(&mut Manifest)),
    /// Files of the finished dataset.
    Files(fn(&Path)),
}

/// A fault, the code that must find it, and codes that follow from it, with the reason.
pub(crate) struct Fault {
    pub(crate) code: &'static str,
    pub(crate) plant: Plant,
    pub(crate) also: &'static [(&'static str, &'static str)],
}

use Plant::{Courses, Drives, Files, Poses, Records, Shard};

const fn fault(code: &'static str, plant: Plant) -> Fault {
    Fault { code, plant, also: &[] }
}

const fn with(
    code: &'static str,
    plant: Plant,
    also: &'static [(&'static str, &'static str)],
) -> Fault {
    Fault { code, plant, also }
}

/// Frames of the first drive, from one row to another.
fn first(drives: &mut [Drive], rows: std::ops::Range<usize>) -> &mut [Frame] {
    &mut drives[0].frames[rows]
}

fn all(drives: &mut [Drive]) -> impl Iterator<Item = &mut Frame> {
    drives.iter_mut().flat_map(|drive| &mut drive.frames)
}

/// A column of words in place of another.
fn with_words(batch: &RecordBatch, name: &str, word: &str) -> RecordBatch {
    let at = batch.schema().index_of(name).unwrap();
    let words: StringArray = (0..batch.num_rows()).map(|_| Some(word)).collect();
    let mut columns: Vec<ArrayRef> = batch.columns().to_vec();
    columns[at] = Arc::new(words);
    RecordBatch::try_new(batch.schema(), columns).unwrap()
}

fn shard_of(root: &Path, number: usize) -> std::path::PathBuf {
    let text = fs::read_to_string(Manifest::path(root)).unwrap();
    let manifest: Manifest = serde_json::from_str(&text).unwrap();
    root.join(&manifest.logs[number].shards[0].path)
}

/// Keep so many steps of future.
fn cut_future(frame: &mut Frame, steps: usize) {
    let future = &mut frame.future;
    future.len = future.len.min(steps as u8);
    future.speed_mps[steps..].fill(0.0);
    future.yaw_rad[steps..].fill(0.0);
    future.xy_m[2 * steps..].fill(0.0);
}

/// Give all waypoints another place.
fn move_route(frame: &mut Frame, to: impl Fn(f32, f32) -> (f32, f32)) {
    for point in frame.route.waypoints_m.chunks_exact_mut(2) {
        let (x, y) = to(point[0], point[1]);
        point.copy_from_slice(&[x, y]);
    }
}

pub(crate) static FAULTS: &[Fault] = &[
    // Structure.
    fault("S01", Files(|root| fs::remove_file(Manifest::path(root)).unwrap())),
    fault("S02", Files(|root| fs::write(Manifest::path(root), "{\"version\": 1}").unwrap())),
    fault("S03", Files(|root| fs::remove_file(shard_of(root, 0)).unwrap())),
    fault("S04", Records(|_, logs| logs[0].shards[0].bytes += 1)),
    fault(
        "S05",
        Files(|root| {
            let path = shard_of(root, 0);
            let mut bytes = fs::read(&path).unwrap();
            let footer = bytes.len() - 300;
            bytes[footer..].fill(0);
            fs::write(path, bytes).unwrap();
        }),
    ),
    fault(
        "S06",
        Shard(|batch| {
            let keep: Vec<usize> = (0..batch.num_columns())
                .filter(|at| batch.schema().field(*at).name() != "yaw")
                .collect();
            batch.project(&keep).unwrap()
        }),
    ),
    fault(
        "S07",
        Records(|_, logs| {
            logs[0].shards[0].rows += 1;
            logs[0].frames += 1;
            logs[0].episodes[0].frames += 1;
        }),
    ),
    fault("S08", Records(|_, logs| logs[0].shards[0].sha256 = "0".repeat(64))),
    fault("S09", Plant::Manifest(|manifest| manifest.frames += 1)),
    fault(
        "S10",
        Plant::Manifest(|manifest| {
            let episodes = &mut manifest.logs[0].episodes;
            episodes[0].frames -= 1;
            let id = "ep-other".to_string();
            let other = EpisodeRecord { id, frames: 1, shards: 0, ..episodes[0].clone() };
            episodes.push(other);
        }),
    ),
    fault("S11", Shard(|batch| with_words(&batch, "episode", "ep-another"))),
    fault(
        "S12",
        Files(|root| {
            let stray = root.join("frames/split=val/stray.parquet");
            fs::copy(shard_of(root, 0), stray).map(|_| ()).unwrap();
        }),
    ),
    fault(
        "S13",
        Records(|root, logs| {
            let to = logs[0].shards[0].path.replace("split=train", "split=val");
            fs::rename(root.join(&logs[0].shards[0].path), root.join(&to)).unwrap();
            logs[0].shards[0].path = to;
        }),
    ),
    fault(
        "S14",
        Plant::Manifest(|manifest| {
            let error = "no camera".to_string();
            manifest.failed.push(FailedLog { source_log: "night.mcap".into(), error });
        }),
    ),
    fault("S15", Records(|_, logs| logs[0].episodes[0].drops.add_run(Reason::ImageGap, 0, 60))),
    fault(
        "S16",
        Records(|_, logs| {
            let empty = EpisodeRecord {
                id: "ep-empty".into(),
                frames: 0,
                shards: 0,
                ..logs[0].episodes[0].clone()
            };
            logs[0].episodes.push(empty);
        }),
    ),
    // Time.
    fault(
        "T01",
        Drives(|drives| {
            let mut again = drives[0].frames[100].clone();
            again.image = drives[0].frames[103].image.clone();
            drives[0].frames.insert(101, again);
        }),
    ),
    fault("T02", Drives(|drives| first(drives, 100..101)[0].stamp_ns += 5_000_000)),
    fault("T03", Drives(|drives| drop(drives[0].frames.drain(100..111)))),
    fault("T04", Drives(|drives| drives[0].frames.retain(|frame| frame.index % 10 != 5))),
    fault(
        "T05",
        Drives(|drives| {
            first(drives, 50..80).iter_mut().for_each(|f| f.skew.lidar_ns = Some(70_000_000));
        }),
    ),
    fault(
        "T06",
        Drives(|drives| {
            for frame in first(drives, 50..80) {
                frame.skew.image_ns = if frame.index % 2 == 0 { 50_000_000 } else { -50_000_000 };
            }
        }),
    ),
    fault(
        "T07",
        Drives(|drives| {
            for frame in first(drives, 0..200) {
                let early = frame.index % 2 == 0;
                frame.skew.lidar_ns = Some(if early { 50_000_000 } else { -50_000_000 });
            }
        }),
    ),
    fault(
        "T08",
        Drives(|drives| {
            let (frames, drive) = (drives[0].frames.clone(), &mut drives[0]);
            drive.frames.truncate(130);
            drive.second = frames[110..].to_vec();
        }),
    ),
    fault("T09", Drives(|drives| drives[0].frames.truncate(40))),
    // Ego motion.
    fault("E01", Drives(|drives| first(drives, 100..101)[0].velocity_mps[1] = f32::NAN)),
    fault("E02", Poses(|cars| cars[0].iter_mut().for_each(|pose| pose.speed_mps *= 3.6))),
    fault(
        "E03",
        Drives(|drives| {
            let turned = std::f32::consts::FRAC_1_SQRT_2;
            for frame in first(drives, 0..240) {
                let speed = frame.velocity_mps[0];
                frame.velocity_mps = [speed * turned, speed * turned];
            }
        }),
    ),
    fault("E04", Poses(|cars| cars[0].iter_mut().for_each(|pose| pose.yaw_rad += 0.6))),
    fault(
        "E05",
        Poses(|cars| cars[0][120..].iter_mut().for_each(|pose| pose.position_m[0] += 30.0)),
    ),
    // At rest, so that no label of a moving car is turned.
    fault("E06", Poses(|cars| cars[0][2].yaw_rad += 1.0)),
    fault("E07", Poses(|cars| cars[0][100].speed_mps += 3.0)),
    fault("E08", Courses(|courses| courses[0].bend_1pm[120] += 0.4)),
    fault(
        "E09",
        Courses(|courses| {
            courses[0].stand(620);
        }),
    ),
    fault(
        "E10",
        Poses(|cars| cars[0][120..].iter_mut().for_each(|pose| pose.position_m[2] += 2.0)),
    ),
    fault(
        "E11",
        Drives(|drives| {
            first(drives, 50..60).iter_mut().for_each(|f| f.yaw_rad += std::f64::consts::TAU);
        }),
    ),
    fault(
        "E12",
        Poses(|cars| {
            let car = &mut cars[0];
            let (at, lost) = (car[120].position_m, car[128].position_m);
            car[121..=128].iter_mut().for_each(|pose| pose.position_m = at);
            for pose in &mut car[129..] {
                for axis in 0..3 {
                    pose.position_m[axis] += at[axis] - lost[axis];
                }
            }
        }),
    ),
    fault(
        "E13",
        Poses(|cars| {
            for pose in &mut cars[0] {
                pose.yaw_rad += std::f64::consts::PI;
                pose.speed_mps = -pose.speed_mps;
            }
        }),
    ),
    fault("E14", Courses(|courses| courses[0].acceleration_mps2.fill(0.0))),
    // Labels of the motion.
    fault(
        "L01",
        Drives(|drives| {
            first(drives, 50..60).iter_mut().for_each(|f| f.future.xy_m[2 * 9 + 1] += 2.0);
        }),
    ),
    fault(
        "L02",
        Drives(|drives| {
            first(drives, 50..60).iter_mut().for_each(|f| f.future.speed_mps[9] += 2.0);
        }),
    ),
    fault(
        "L03",
        Drives(|drives| {
            let turned = |f: &mut Frame| f.future.yaw_rad.iter_mut().for_each(|yaw| *yaw = -*yaw);
            first(drives, 40..200).iter_mut().for_each(turned);
        }),
    ),
    fault("L04", Drives(|drives| first(drives, 50..52).iter_mut().for_each(|f| f.future.len = 12))),
    with(
        "L05",
        Drives(|drives| all(drives).for_each(|frame| cut_future(frame, FUTURE_STEPS - 1))),
        &[(
            "L07",
            "the future is cut short although frames follow: there is no other way to lack it",
        )],
    ),
    fault("L06", Drives(|drives| first(drives, 50..51)[0].future.speed_mps[3] = f32::NAN)),
    fault(
        "L07",
        Drives(|drives| first(drives, 50..100).iter_mut().for_each(|frame| cut_future(frame, 20))),
    ),
    // Actions.
    fault("A01", Drives(|drives| first(drives, 100..101)[0].action.steer = Some(1.5))),
    fault(
        "A02",
        Drives(|drives| first(drives, 0..240).iter_mut().for_each(|f| f.action.throttle = None)),
    ),
    fault(
        "A03",
        Drives(|drives| {
            let turned = |f: &mut Frame| f.action.steer = f.action.steer.map(|steer| -steer);
            first(drives, 0..240).iter_mut().for_each(turned);
        }),
    ),
    fault(
        "A04",
        Drives(|drives| {
            for frame in first(drives, 0..240) {
                // Any sequence without a rhythm.
                let noise = frame.index.wrapping_mul(2_654_435_761) >> 16;
                frame.action.steer = Some(noise as f32 / 65_536.0 - 0.5);
            }
        }),
    ),
    fault(
        "A05",
        Drives(|drives| {
            let frames = first(drives, 0..240);
            let steer: Vec<_> = frames.iter().map(|frame| frame.action.steer).collect();
            for (row, frame) in frames.iter_mut().enumerate() {
                frame.action.steer = steer[row.saturating_sub(10)];
            }
        }),
    ),
    fault(
        "A06",
        Drives(|drives| {
            let braking = |f: &mut Frame| f.action.brake = Some(0.15);
            let rows = first(drives, 0..240).iter_mut();
            rows.filter(|f| f.action.throttle > Some(0.25)).take(12).for_each(braking);
        }),
    ),
    fault(
        "A07",
        Drives(|drives| {
            let ends = |f: &mut Frame| {
                f.action.steer = f.action.steer.map(|steer| (steer * 5.0).clamp(-1.0, 1.0));
            };
            first(drives, 0..240).iter_mut().for_each(ends);
        }),
    ),
    fault(
        "A08",
        Drives(|drives| {
            first(drives, 100..160).iter_mut().for_each(|f| f.action.steer = Some(0.05));
        }),
    ),
    fault(
        "A09",
        Drives(|drives| {
            for frame in first(drives, 0..240) {
                let action = &mut frame.action;
                std::mem::swap(&mut action.throttle, &mut action.brake);
            }
        }),
    ),
    // Route and command.
    fault(
        "R01",
        Drives(|drives| {
            first(drives, 0..240).iter_mut().for_each(|f| move_route(f, |x, y| (x, y + 4.5)));
        }),
    ),
    fault(
        "R02",
        Drives(|drives| {
            first(drives, 0..240).iter_mut().for_each(|f| move_route(f, |x, y| (1.2 * x, 1.2 * y)));
        }),
    ),
    fault("R03", Drives(|drives| first(drives, 50..60).iter_mut().for_each(|f| f.route.len = 100))),
    fault(
        "R04",
        Drives(|drives| {
            for frame in drives[..2].iter_mut().flat_map(|drive| &mut drive.frames) {
                let route = &mut frame.route;
                route.len = 10;
                let last = [route.waypoints_m[18], route.waypoints_m[19]];
                route.waypoints_m[20..].chunks_exact_mut(2).for_each(|p| p.copy_from_slice(&last));
            }
        }),
    ),
    with(
        "R05",
        Drives(|drives| {
            first(drives, 0..240).iter_mut().for_each(|f| move_route(f, |x, y| (-x, -y)));
        }),
        &[("R06", "a car that drives forward leaves a route that runs backwards")],
    ),
    fault(
        "R06",
        Drives(|drives| {
            let (sin, cos) = 0.7_f32.sin_cos();
            let turned = |x: f32, y: f32| (x * cos - y * sin, x * sin + y * cos);
            first(drives, 0..240).iter_mut().for_each(|f| move_route(f, turned));
        }),
    ),
    fault(
        "R07",
        Drives(|drives| {
            first(drives, 0..240).iter_mut().for_each(|f| f.route.source = RouteSource::Driven);
        }),
    ),
    fault("R08", Drives(|drives| all(drives).for_each(|f| f.route.source = RouteSource::Driven))),
    fault(
        "R09",
        Drives(|drives| {
            for frame in first(drives, 0..240) {
                frame.command = match frame.command {
                    Command::Left => Command::Right,
                    Command::Right => Command::Left,
                    other => other,
                };
            }
        }),
    ),
    fault("R10", Shard(|batch| with_words(&batch, "command", "u-turn"))),
    // Images.
    fault(
        "I01",
        Drives(|drives| {
            let image = &mut first(drives, 100..101)[0].image;
            image.truncate(image.len() / 2);
        }),
    ),
    fault(
        "I02",
        Drives(|drives| {
            let shade =
                |x: usize, y: usize| if (x / 3 + y / 3).is_multiple_of(2) { 60 } else { 180 };
            first(drives, 100..101)[0].image = jpeg(2 * WIDTH, HEIGHT, shade);
        }),
    ),
    fault("I03", Drives(|drives| first(drives, 100..101)[0].image = jpeg(WIDTH, HEIGHT, |_, _| 3))),
    fault(
        "I04",
        Drives(|drives| first(drives, 100..101)[0].image = jpeg(WIDTH, HEIGHT, |_, _| 254)),
    ),
    fault(
        "I05",
        Drives(|drives| {
            let frames = first(drives, 100..102);
            frames[0].image = frames[1].image.clone();
        }),
    ),
    fault(
        "I06",
        Drives(|drives| {
            let blurred = jpeg(WIDTH, HEIGHT, |x, _| (2 * x + 40) as u8);
            for (at, frame) in first(drives, 0..240).iter_mut().enumerate() {
                // Otherwise they would be the same: data behind the end does not count.
                frame.image = [blurred.as_slice(), &[at as u8]].concat();
            }
        }),
    ),
    fault(
        "I07",
        Drives(|drives| first(drives, 100..101)[0].image = jpeg(WIDTH, HEIGHT, |_, _| 128)),
    ),
    // Lidar and radar.
    fault(
        "P01",
        Drives(|drives| {
            for frame in first(drives, 0..240) {
                frame.lidar = None;
                frame.skew.lidar_ns = None;
            }
        }),
    ),
    fault(
        "P02",
        Drives(|drives| {
            first(drives, 0..240).iter_mut().for_each(|f| f.lidar = Some(Default::default()));
        }),
    ),
    fault(
        "P03",
        Drives(|drives| {
            for radar in all(drives).filter_map(|frame| frame.radar.as_mut()) {
                radar.pixel.clear();
                radar.speed_mps = Some(Vec::new());
            }
        }),
    ),
    fault(
        "P04",
        Drives(|drives| {
            let radar = first(drives, 100..101)[0].radar.as_mut().unwrap();
            *radar.pixel.last_mut().unwrap() = (WIDTH * HEIGHT) as u32;
        }),
    ),
    fault(
        "P05",
        Drives(|drives| first(drives, 100..101)[0].radar.as_mut().unwrap().pixel.swap(0, 1)),
    ),
    fault(
        "P06",
        Drives(|drives| {
            let radar = first(drives, 100..101)[0].radar.as_mut().unwrap();
            radar.speed_mps.as_mut().unwrap()[0] = f16::NAN;
        }),
    ),
    fault(
        "P07",
        Drives(|drives| {
            let radar = first(drives, 100..101)[0].radar.as_mut().unwrap();
            radar.speed_mps.as_mut().unwrap().truncate(2);
        }),
    ),
    fault(
        "P08",
        Drives(|drives| {
            let lidar = first(drives, 100..101)[0].lidar.as_mut().unwrap();
            std::mem::swap(&mut lidar.y, &mut lidar.z);
        }),
    ),
    fault(
        "P09",
        Drives(|drives| {
            for radar in first(drives, 0..240).iter_mut().filter_map(|f| f.radar.as_mut()) {
                radar.speed_mps.as_mut().unwrap().fill(f16::ZERO);
            }
        }),
    ),
    fault(
        "P10",
        Drives(|drives| {
            for radar in first(drives, 0..240).iter_mut().filter_map(|f| f.radar.as_mut()) {
                radar.speed_mps.as_mut().unwrap().iter_mut().for_each(|speed| *speed = -*speed);
            }
        }),
    ),
    // Division.
    fault(
        "D01",
        Records(|_, logs| {
            let val = logs.iter().position(|log| log.split == Split::Val).unwrap();
            let train = logs.iter().position(|log| log.split == Split::Train).unwrap();
            logs[val].source_sha256 = logs[train].source_sha256.clone();
        }),
    ),
    fault(
        "D02",
        Drives(|drives| {
            let copy = drives[0].frames.iter().skip(3).cloned().map(|mut frame| {
                frame.stamp_ns += 1_000_000_000_000;
                frame
            });
            let copy: Vec<Frame> = copy.collect();
            drives.iter_mut().find(|drive| drive.split == Split::Val).unwrap().frames = copy;
        }),
    ),
    fault(
        "D03",
        Records(|_, logs| {
            let mut train = logs.iter_mut().filter(|log| log.split == Split::Train);
            let (one, other) = (train.next().unwrap(), train.next().unwrap());
            other.source_sha256 = one.source_sha256.clone();
        }),
    ),
    fault("D04", Drives(|drives| drives.iter_mut().for_each(|drive| drive.split = Split::Train))),
    fault(
        "D05",
        Drives(|drives| {
            let val = drives.iter_mut().find(|drive| drive.split == Split::Val).unwrap();
            val.frames.truncate(60);
        }),
    ),
    fault(
        "D06",
        Drives(|drives| {
            let val = drives.iter_mut().find(|drive| drive.split == Split::Val).unwrap();
            let clear = |f: &mut Frame| f.conditions.weather = Some("clear".into());
            val.frames.iter_mut().for_each(clear);
        }),
    ),
    // Balance.
    fault(
        "B01",
        Drives(|drives| all(drives).for_each(|f| f.action.brake = Some(f.index as f32 * 1e-4))),
    ),
    fault(
        "B02",
        Drives(|drives| all(drives).for_each(|f| f.action.steer = f.action.steer.map(|s| s * 0.3))),
    ),
    fault(
        "B03",
        Drives(|drives| {
            let slow = all(drives).filter(|frame| frame.velocity_mps[0] < 0.5);
            slow.for_each(|frame| frame.action.throttle = Some(0.05));
        }),
    ),
    fault(
        "B04",
        Drives(|drives| {
            let left = all(drives).filter(|frame| frame.command == Command::Left);
            left.for_each(|frame| frame.command = Command::Follow);
        }),
    ),
    with(
        "B05",
        Courses(|courses| {
            for course in courses {
                course.start_mps = 8.0;
                course.acceleration_mps2.fill(0.0);
            }
        }),
        &[("B01", "who always drives at one speed never brakes"), ("B03", "and never starts")],
    ),
    fault("B06", Courses(|courses| courses.iter_mut().for_each(|course| course.stand(200)))),
    fault("B07", Courses(|courses| courses[0].go_on(1300))),
    // Conditions.
    fault("C01", Drives(|drives| all(drives).for_each(|f| f.conditions.town = None))),
    fault(
        "C02",
        Drives(|drives| {
            first(drives, 0..240).iter_mut().for_each(|f| f.conditions.town = None);
        }),
    ),
    fault(
        "C03",
        Drives(|drives| {
            let foggy = |f: &mut Frame| f.conditions.weather = Some("foggy".into());
            first(drives, 0..40).iter_mut().for_each(foggy);
        }),
    ),
    fault("C04", Records(|_, logs| logs[0].conditions.town = Some("Town07".into()))),
    fault(
        "C05",
        Drives(|drives| all(drives).for_each(|f| f.conditions.weather = Some("clear".into()))),
    ),
    fault(
        "C06",
        Drives(|drives| {
            all(drives).for_each(|f| f.conditions.illumination = Some("sunset".into()));
        }),
    ),
    fault(
        "C07",
        Drives(|drives| all(drives).for_each(|f| f.conditions.traffic = Some("empty".into()))),
    ),
    fault(
        "C08",
        Drives(|drives| all(drives).for_each(|f| f.conditions.town = Some("Town01".into()))),
    ),
    fault("C09", Drives(|drives| all(drives).for_each(|f| f.perturbed = false))),
];
