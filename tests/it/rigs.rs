//! Every rig that is known by name: recognised, its bend to the left told as one, its returns on
//! the pixels that its geometry says; and what happens where names and types leave a question.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeMap, fs, path::Path};

use pmp::{
    dataset::manifest::{LogRecord, Manifest},
    frame::{Command, Frame, RadarPixels, RouteSource},
    log::rigs::Rig,
};

use crate::{
    ingest::{Said, frames, ingest, text},
    rig_fixtures::{
        CAMERA_M, CLOSING_MPS, FOCAL, Messages, NONE, OPTICAL, POINTS, RETURN, SIZE, SPEED_MPS,
        YAW_RATE_RADPS, at_rate, autoware, carla, comma, kitti, nuscenes, pmp,
    },
};

/// What a rig's log has besides the camera and the ego motion.
struct Expected {
    name: &'static str,
    log: fn() -> Vec<u8>,
    camera: &'static str,
    lidar: bool,
    radar: bool,
    /// Steering, throttle, brake.
    action: [Option<f32>; 3],
}

const DRIVEN: [Option<f32>; 3] = [Some(-0.5), Some(0.25), Some(0.125)];

const RIGS: [Expected; 6] = [
    Expected {
        name: "carla-ros-bridge",
        log: carla,
        camera: "/carla/hero/rgb_front/image",
        lidar: true,
        radar: true,
        action: DRIVEN,
    },
    Expected {
        name: "nuscenes2mcap",
        log: nuscenes,
        camera: "/cam_front/image_rect_compressed",
        lidar: true,
        radar: true,
        action: [None; 3],
    },
    Expected {
        name: "kitti",
        log: kitti,
        camera: "/kitti/camera_color_left/image_raw",
        lidar: true,
        radar: false,
        action: [None; 3],
    },
    Expected {
        name: "autoware",
        log: autoware,
        camera: "/sensing/camera/camera0/image_rect_color/compressed",
        lidar: true,
        radar: true,
        action: DRIVEN,
    },
    Expected {
        name: "pmp",
        log: pmp,
        camera: "/camera/front/image/compressed",
        lidar: true,
        radar: true,
        action: DRIVEN,
    },
    Expected {
        name: "comma",
        log: comma,
        camera: "/camera/front/image/compressed",
        lidar: false,
        radar: true,
        action: DRIVEN,
    },
];

/// Ingest a log with these arguments.
pub(crate) fn ingested(folder: &Path, log: &[u8], more: &[&str]) -> (Said, Vec<Frame>, LogRecord) {
    let (said, dataset) = tried(folder, log, more);
    assert!([0, 3].contains(&said.code), "{}", said.err);
    let record = Manifest::read(&dataset).unwrap().logs.remove(0);
    let frames = frames(&dataset).into_iter().map(|(_, frame)| frame).collect();
    (said, frames, record)
}

pub(crate) fn tried(folder: &Path, log: &[u8], more: &[&str]) -> (Said, std::path::PathBuf) {
    let (path, dataset) = (folder.join("drive.mcap"), folder.join("data"));
    fs::write(&path, log).unwrap();
    if dataset.exists() {
        fs::remove_dir_all(&dataset).unwrap();
    }
    let arguments = [&["--out", text(&dataset), text(&path)], more].concat();
    (ingest(&arguments), dataset)
}

#[track_caller]
fn near(got: f64, expected: f64, tolerance: f64) {
    assert!((got - expected).abs() <= tolerance, "{got}, expected {expected} +- {tolerance}");
}

/// The pixel of the stored picture of 600 x 250 that a point of the car's frame falls on.
fn pixel([x, y, z]: [f64; 3]) -> u32 {
    let (ahead, scale) = (x - CAMERA_M[0], 600.0 / SIZE[0] as f64);
    let u = 300.0 - FOCAL * scale * y / ahead;
    let v = 125.0 - FOCAL * scale * (z - CAMERA_M[2]) / ahead;
    v.floor() as u32 * 600 + u.floor() as u32
}

/// A frame at the beginning of the bend has its numbers, from the closed form.
#[track_caller]
pub(crate) fn bends_to_the_left(frames: &[Frame], tolerance: f64) {
    let frame = frames.iter().find(|frame| frame.future.len == 30).unwrap();
    let [vx, vy] = frame.velocity_mps.map(f64::from);
    near(vx, SPEED_MPS, tolerance);
    near(vy, 0.0, tolerance);
    let (radius, turned) = (SPEED_MPS / YAW_RATE_RADPS, 3.0 * YAW_RATE_RADPS);
    near(f64::from(frame.future.yaw_rad[29]), turned, tolerance);
    near(f64::from(frame.future.xy_m[58]), radius * turned.sin(), 2.0 * tolerance);
    near(f64::from(frame.future.xy_m[59]), radius * (1.0 - turned.cos()), 2.0 * tolerance);
    let later = frames.iter().find(|other| other.index == frame.index + 10).unwrap();
    near(later.yaw_rad - frame.yaw_rad, YAW_RATE_RADPS, tolerance);
    let end = 2 * usize::from(frame.route.len) - 2;
    assert!(frame.route.len > 40 && frame.route.waypoints_m[end + 1] > 2.0, "the way bends left");
}

#[test]
fn every_rig_is_recognised_and_its_bend_to_the_left_is_one() {
    let folder = tempfile::tempdir().unwrap();
    for rig in RIGS {
        let (said, frames, record) = ingested(folder.path(), &(rig.log)(), &[]);
        assert_eq!(record.mapping.rig.as_deref(), Some(rig.name), "{}", said.err);
        assert_eq!(record.mapping.camera.as_deref(), Some(rig.camera));
        assert!(frames.len() >= 40, "{}: {} frames", rig.name, frames.len());
        bends_to_the_left(&frames, 0.03);
        for frame in &frames {
            let action = [frame.action.steer, frame.action.throttle, frame.action.brake];
            assert_eq!(action, rig.action, "{}", rig.name);
        }
    }
}

#[test]
fn returns_of_every_rig_fall_on_the_pixels_that_its_geometry_says() {
    let folder = tempfile::tempdir().unwrap();
    let mut lidar: Vec<u32> = POINTS.map(pixel).to_vec();
    lidar.sort_unstable();
    for rig in RIGS {
        let (_, frames, _) = ingested(folder.path(), &(rig.log)(), &[]);
        let frame = &frames[frames.len() / 2];
        let got = frame.lidar.as_ref().map(|lidar| lidar.pixel.clone());
        assert_eq!(got, rig.lidar.then(|| lidar.clone()), "{}", rig.name);
        let radar = RadarPixels {
            pixel: vec![pixel(RETURN)],
            speed_mps: Some(vec![half::f16::from_f64(CLOSING_MPS)]),
        };
        assert_eq!(frame.radar, rig.radar.then_some(radar), "{}", rig.name);
        if let Some(lidar) = &frame.lidar {
            // Depths along the optical axis.
            let mut ahead: Vec<f32> = lidar.z.iter().map(|z| z.to_f32()).collect();
            ahead.sort_by(f32::total_cmp);
            for (got, [x, ..]) in ahead.iter().zip([POINTS[1], POINTS[0], POINTS[2]]) {
                near(f64::from(*got), x - CAMERA_M[0], 0.01);
            }
        }
    }
}

#[test]
fn carla_tells_its_town_its_weather_and_its_way() {
    let folder = tempfile::tempdir().unwrap();
    let (_, frames, record) = ingested(folder.path(), &carla(), &[]);
    let told = &record.conditions;
    assert_eq!(told.town.as_deref(), Some("Town03"));
    assert_eq!(told.weather.as_deref(), Some("drizzle"));
    assert_eq!(told.illumination.as_deref(), Some("sunset"));
    assert_eq!(frames[0].route.source, RouteSource::Planned);
    assert_eq!(frames[0].command, Command::Left);
}

#[test]
fn rigs_are_listed_and_only_these() {
    let names: Vec<_> = Rig::names().collect();
    for name in &names {
        let rig = Rig::named(name).unwrap_or_else(|| panic!("{name} does not parse"));
        assert!(!rig.about.is_empty() && !rig.recognise.topics.is_empty());
    }
    let said = ingest(&["--help"]);
    assert!(names.iter().all(|name| said.out.contains(name)), "{}", said.out);
    assert_eq!(Rig::named("waymo"), None);
    let files =
        fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/profiles")).unwrap();
    assert_eq!(files.count(), names.len());
}

/// A drive with cameras of these topics and frames, and odometry of these topics.
fn drive(cameras: &[(&'static str, &str)], odometry: &[&'static str]) -> Vec<u8> {
    let mut log = Messages::default();
    log.transform("/tf_static", ["base_link", "camera"], 0.0, CAMERA_M, OPTICAL);
    log.transform("/tf_static", ["base_link", "lidar"], 0.0, [0.0; 3], NONE);
    for t in at_rate(10.0) {
        for (topic, frame) in cameras {
            log.camera([topic, "/camera_info"], frame, t);
        }
        for topic in odometry {
            log.odometry(topic, ["odom", "base_link"], t);
        }
    }
    log.bytes()
}

/// Cameras and their frames, odometries, what is asked.
type Open = (&'static [(&'static str, &'static str)], &'static [&'static str], &'static str);

const QUESTIONS: [Open; 4] = [
    (
        &[("/front_a/compressed", "a"), ("/front_b/compressed", "b")],
        &["/odom"],
        "2 topics could be the camera: /front_a/compressed (frame a), /front_b/compressed (frame b)",
    ),
    (
        &[("/left/compressed", "a"), ("/right/compressed", "b")],
        &["/odom"],
        "2 topics could be the camera: /left/compressed (frame a), /right/compressed (frame b)",
    ),
    (
        &[("/cam1/compressed", "a"), ("/cam2/image_raw", "b"), ("/cam2/compressed", "b")],
        &["/odom"],
        "2 topics could be the camera: /cam1/compressed (frame a), /cam2/compressed (frame b)",
    ),
    (
        &[("/camera/compressed", "camera")],
        &["/odom", "/wheels"],
        "2 topics could be the odometry: /odom (frame odom), /wheels (frame odom)",
    ),
];

#[test]
fn what_names_and_types_do_not_tell_is_a_question_with_the_flag_that_answers_it() {
    let folder = tempfile::tempdir().unwrap();
    for (cameras, odometry, asked) in QUESTIONS {
        let log = drive(cameras, odometry);
        let (said, _) = tried(folder.path(), &log, &[]);
        assert_eq!(said.code, 1);
        assert!(said.err.contains(asked), "{}", said.err);
        let flag = said.err.split("--topic ").nth(1).unwrap().split(',').next().unwrap();
        let answer = ["--topic", flag];
        let (_, frames, record) = ingested(folder.path(), &log, &answer);
        assert_eq!(frames.len(), 46);
        assert!(record.mapping.uses(flag.split_once('=').unwrap().1).is_some());
        // Looking at the log shows its topics and asks the same.
        let path = folder.path().join("drive.mcap");
        let looked = ingest(&["inspect", text(&path)]);
        assert_eq!(looked.code, 1);
        assert!(looked.out.contains(cameras[0].0) && looked.err.contains(asked), "{}", looked.err);
        assert_eq!(ingest(&["inspect", text(&path), "--topic", flag]).code, 0);
    }
}

#[test]
fn names_that_say_where_a_camera_looks_decide_and_two_pictures_of_one_camera_are_no_question() {
    let folder = tempfile::tempdir().unwrap();
    let cameras = [
        ("/cam_front/compressed", "a"),
        ("/cam_front/image_raw", "a"),
        ("/cam_front_left/compressed", "b"),
        ("/cam_back/compressed", "c"),
        ("/cam/compressed", "d"),
    ];
    let (said, _, record) = ingested(folder.path(), &drive(&cameras, &["/odom"]), &[]);
    assert_eq!(record.mapping.camera.as_deref(), Some("/cam_front/compressed"));
    let note = "camera: /cam_front/compressed taken, not /cam_front/image_raw, /cam/compressed, \
                /cam_front_left/compressed, /cam_back/compressed";
    assert!(record.notes.iter().any(|other| other == note), "{:?}", record.notes);
    assert_eq!(said.code, 0);
}

#[test]
fn a_topic_that_the_user_names_must_be_there_and_one_that_a_rig_names_need_not() {
    let folder = tempfile::tempdir().unwrap();
    let log = drive(&[("/camera/compressed", "camera")], &["/odom"]);
    let (said, _) = tried(folder.path(), &log, &["--topic", "camera=/front"]);
    assert_eq!(said.code, 1);
    assert!(said.err.contains("topic `/front` cannot be the camera (it is not in the log"));
    assert!(said.err.contains("topics that could be the camera: /camera/compressed"));

    let (_, frames, record) = ingested(folder.path(), &log, &["--profile", "autoware"]);
    assert_eq!(frames.len(), 46);
    assert_eq!(record.mapping.camera.as_deref(), Some("/camera/compressed"));
    let found = |note: &&String| note.starts_with("camera: found by type; autoware would have /se");
    assert!(record.notes.iter().any(|note| found(&note)), "{:?}", record.notes);

    for (flag, why) in [("camera", "names no topic"), ("cam=/a", "`cam` is not a signal")] {
        let (said, _) = tried(folder.path(), &log, &["--topic", flag]);
        assert!(said.err.contains(why), "{}", said.err);
    }
}

#[test]
fn a_profile_of_ones_own_may_build_on_a_rig() {
    let folder = tempfile::tempdir().unwrap();
    let profile = folder.path().join("own.toml");
    fs::write(&profile, "rig = \"autoware\"\n[control]\nsteering_lock_rad = 0.7\n").unwrap();
    let (_, frames, record) = ingested(folder.path(), &autoware(), &["--profile", text(&profile)]);
    assert_eq!(record.mapping.rig.as_deref(), Some("autoware"));
    near(f64::from(frames[0].action.steer.unwrap()), -0.5, 1e-6);
    fs::write(&profile, "rig = \"auto\"\n").unwrap();
    let (_, _, record) = ingested(folder.path(), &autoware(), &["--profile", text(&profile)]);
    assert_eq!(record.mapping.rig.as_deref(), Some("autoware"));
    fs::write(&profile, "rig = \"waymo\"\n").unwrap();
    let (said, _) = tried(folder.path(), &autoware(), &["--profile", text(&profile)]);
    assert!(said.err.contains("rig: `waymo` is not a profile"), "{}", said.err);
}

#[test]
fn the_pose_in_the_cars_own_frame_is_not_how_it_moves() {
    let folder = tempfile::tempdir().unwrap();
    let (_, _, record) = ingested(folder.path(), &nuscenes(), &[]);
    let note = "pose: /pose is told in the car's own frame (`base_link`), so it is not how the \
                car moves";
    assert!(record.notes.iter().any(|other| other == note), "{:?}", record.notes);
    let uses: BTreeMap<&str, Option<String>> =
        ["/pose", "/lidar_top"].map(|topic| (topic, record.mapping.uses(topic))).into();
    assert_eq!((uses["/pose"].clone(), uses["/lidar_top"].as_deref()), (None, Some("lidar")));
}
