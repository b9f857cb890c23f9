//! One drive told in every way that logs tell drives: worlds with other axes, poses of cameras, /tf,
//! satellites; radars with other angles and signs; routes in other frames. The frames are the same.
#![allow(clippy::unwrap_used)]

use std::fs;

use glam::{DQuat, DVec3};
use pmp::{
    dataset::conditions,
    drops::Reason,
    frame::{Frame, RouteSource},
    geodesy,
    log::signals::Weather,
};
use proptest::prelude::*;

use crate::{
    fixtures::shared,
    ingest::text,
    rig_fixtures::{
        CAMERA_M, CARLA_RADAR_FIELDS, CLOSING_MPS, Messages, NONE, OPTICAL, POINTS, SPEED_MPS,
        YAW_RATE_RADPS, at_rate, carla_radar_point, header, pose, yaw_quaternion,
    },
    rigs::{bends_to_the_left, ingested, tried},
};

/// A log with a camera and what `tell` adds at each instant of 20 Hz.
fn log(tell: impl Fn(&mut Messages, f64)) -> Vec<u8> {
    let mut log = Messages::default();
    for t in at_rate(10.0) {
        log.camera(["/camera/compressed", "/camera_info"], "camera", t);
    }
    for t in at_rate(20.0) {
        tell(&mut log, t);
    }
    log.bytes()
}

fn frames_of(log: &[u8], profile: &str) -> (Vec<Frame>, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.toml");
    fs::write(&path, profile).unwrap();
    let (_, frames, record) = ingested(folder.path(), log, &["--profile", text(&path)]);
    (frames, [record.notes, record.left_out].concat())
}

/// Odometry of the drive, of a frame that sits at `place` on the car with these axes, in a world
/// that `world` leads to from x ahead, y left, z up.
fn odometry(
    messages: &mut Messages,
    frames: [&str; 2],
    t: f64,
    world: DQuat,
    (place, axes): (DVec3, DQuat),
) {
    let [x, y, yaw] = pose(t);
    let heading = DQuat::from_rotation_z(yaw);
    let position = world * (DVec3::new(x, y, 0.0) + heading * place);
    let turn = DVec3::Z * YAW_RATE_RADPS;
    let velocity = axes.inverse() * (DVec3::X * SPEED_MPS + turn.cross(place));
    let turn = axes.inverse() * turn;
    let twist = [velocity.x, velocity.y, velocity.z, turn.x, turn.y, turn.z];
    let rotation = (world * heading * axes).to_array();
    messages.odometry_of("/odom", frames, t, position.to_array(), rotation, twist);
}

fn quaternion(q: [f64; 4]) -> DQuat {
    DQuat::from_array(q)
}

#[track_caller]
fn same_motion(told: &[Frame], expected: &[Frame], tolerance: f32) {
    assert_eq!(told.len(), expected.len());
    for (a, b) in told.iter().zip(expected) {
        let numbers = |f: &Frame| {
            let position = f.position_m.map(|m| m as f32);
            let mut all = vec![f.yaw_rad as f32, position[0], position[1], position[2]];
            all.extend(f.velocity_mps.iter().chain(&f.route.waypoints_m).chain(&f.future.xy_m));
            all.extend(f.future.yaw_rad.iter().chain(&f.future.speed_mps));
            all
        };
        for (a, b) in numbers(a).into_iter().zip(numbers(b)) {
            assert!((a - b).abs() <= tolerance, "frame {}: {a} and {b}", told[0].index);
        }
    }
}

#[test]
fn a_drive_told_north_east_down_or_left_handed_gives_the_frames_of_one_told_as_ros_does() {
    let at_base = (DVec3::ZERO, DQuat::IDENTITY);
    let plain = log(|m, t| odometry(m, ["odom", "base_link"], t, DQuat::IDENTITY, at_base));
    let (expected, _) = frames_of(&plain, "");
    bends_to_the_left(&expected, 0.01);

    // North is y, east is x, down is the other way; the car's axes are forward, right, down.
    let ned_twist = [SPEED_MPS, 0.0, 0.0, 0.0, 0.0, -YAW_RATE_RADPS];
    let ned = |frame: &'static str| {
        log(move |m, t| {
            let [x, y, yaw] = pose(t);
            let turn = yaw_quaternion(std::f64::consts::FRAC_PI_2 - yaw);
            m.odometry_of("/odom", [frame, "base_link"], t, [y, x, 0.0], turn, ned_twist);
        })
    };
    for (frame, profile) in [("odom_ned", ""), ("odom", "[ego]\nworld = \"ned\"\n")] {
        let (told, notes) = frames_of(&ned(frame), profile);
        same_motion(&told, &expected, 1e-4);
        assert!(notes.iter().any(|note| note.contains("north, east, down")), "{notes:?}");
    }
    // A plan is not a direction.
    let (told, _) = frames_of(&ned("planned"), "");
    assert!((told[0].yaw_rad - expected[0].yaw_rad).abs() > 1.0);

    let left_handed = log(|m, t| {
        let [x, y, yaw] = pose(t);
        let frames = ["map", "base_link"];
        m.odometry_of("/odom", frames, t, [x, -y, 0.0], yaw_quaternion(-yaw), ned_twist);
    });
    let (told, _) = frames_of(&left_handed, "[ego]\nworld = \"left_handed\"\n");
    same_motion(&told, &expected, 1e-4);
}

#[test]
fn the_pose_of_a_camera_or_a_lidar_is_brought_to_the_car() {
    let at_base = (DVec3::ZERO, DQuat::IDENTITY);
    let plain = log(|m, t| odometry(m, ["odom", "base_link"], t, DQuat::IDENTITY, at_base));
    let (expected, _) = frames_of(&plain, "");
    let pitched = DQuat::from_rotation_y(4_f64.to_radians());
    let mounts = [
        (DVec3::from(CAMERA_M), pitched),
        (DVec3::from(CAMERA_M), pitched * quaternion(OPTICAL)),
        (DVec3::new(-0.4, 0.3, 1.9), DQuat::from_rotation_z(-1.2)),
    ];
    for (place, axes) in mounts {
        let told = log(|m, t| {
            if t == 0.0 {
                let (place, axes) = (place.to_array(), axes.to_array());
                m.transform("/tf_static", ["base_link", "sensor"], t, place, axes);
            }
            odometry(m, ["odom", "sensor"], t, DQuat::IDENTITY, (place, axes));
        });
        let (frames, notes) = frames_of(&told, "");
        same_motion(&frames, &expected, 1e-4);
        let note = "pose: of `sensor`, brought to `base_link` by the transforms".to_string();
        assert!(notes.contains(&note), "{notes:?}");
    }
}

#[test]
fn the_pose_of_an_optical_frame_that_nothing_ties_to_the_car_is_known_by_its_motion() {
    let at_base = (DVec3::ZERO, DQuat::IDENTITY);
    let plain = log(|m, t| odometry(m, ["odom", "base_link"], t, DQuat::IDENTITY, at_base));
    let (expected, _) = frames_of(&plain, "");
    let optical = quaternion(OPTICAL);
    // The second is KITTI's: the world has the axes of the first camera.
    for world in [DQuat::IDENTITY, optical.inverse()] {
        let told = log(|m, t| odometry(m, ["world", "left"], t, world, (DVec3::ZERO, optical)));
        let (frames, notes) = frames_of(&told, "");
        same_motion(&frames, &expected, 1e-4);
        assert!(notes.iter().any(|note| note.contains("moves along its z axis")), "{notes:?}");
    }
    let told = log(|m, t| odometry(m, ["odom", "body"], t, DQuat::IDENTITY, at_base));
    let (frames, notes) = frames_of(&told, "");
    same_motion(&frames, &expected, 1e-6);
    assert!(notes.iter().any(|note| note.contains("no transform ties to the car")), "{notes:?}");
}

#[test]
fn a_mount_that_is_rounded_anew_each_time_stands_still_and_one_that_nods_does_not() {
    for (swing_m, ties) in [(1e-4, true), (0.1, false)] {
        let told = log(|m, t| {
            let place = [CAMERA_M[0], swing_m * (5.0 * t).sin(), CAMERA_M[2]];
            m.transform("/tf", ["base_link", "sensor"], t, place, NONE);
            let mount = (DVec3::from(CAMERA_M), DQuat::IDENTITY);
            odometry(m, ["odom", "sensor"], t, DQuat::IDENTITY, mount);
        });
        let (_, notes) = frames_of(&told, "");
        let note = "pose: of `sensor`, brought to `base_link` by the transforms".to_string();
        assert_eq!(notes.contains(&note), ties, "{notes:?}");
    }
}

#[test]
fn a_lidar_falls_on_the_picture_whose_frame_the_pose_is_of() {
    // As converters of KITTI's odometry sequences write it: all hangs on the left camera.
    let optical = quaternion(OPTICAL);
    let velo_m = [-0.3, 0.0, 0.1];
    let told = log(|m, t| {
        odometry(m, ["world", "camera"], t, optical.inverse(), (DVec3::ZERO, optical));
        if t == 0.0 {
            let place = [-velo_m[1], -velo_m[2], velo_m[0]];
            m.transform("/tf_static", ["camera", "velo"], t, place, optical.inverse().to_array());
        }
        m.lidar("/velo", "velo", t, velo_m);
    });
    let (frames, _) = frames_of(&told, "");
    // The camera is the car's origin here.
    let pixel = |[x, y, z]: [f64; 3]| {
        let (u, v) = (300.0 - 300.0 * y / x, 125.0 - 300.0 * z / x);
        v as u32 * 600 + u as u32
    };
    let mut expected = POINTS.map(pixel);
    expected.sort_unstable();
    assert_eq!(frames[0].lidar.as_ref().unwrap().pixel, expected);
}

#[test]
fn a_pose_that_stays_the_identity_while_tf_moves_is_not_the_cars() {
    let told = log(|m, t| {
        let [x, y, yaw] = pose(t);
        m.transform("/tf", ["map", "base_link"], t, [x, y, 0.0], yaw_quaternion(yaw));
        let mut cdr = header(t, "map");
        m.add("/pose", "geometry_msgs/PoseStamped", t, cdr.f64s(&[0.0; 3]).f64s(&NONE));
    });
    let (frames, notes) = frames_of(&told, "");
    bends_to_the_left(&frames, 0.01);
    assert!(notes.iter().any(|note| note.starts_with("pose: /pose is told in the car's own")));
}

#[test]
fn the_end_of_a_chain_of_moving_frames_is_the_pose() {
    // The map slides under the odometry, the car moves in it.
    let drift = |t: f64| (DVec3::new(100.0 + 0.1 * t, 50.0, 0.0), DQuat::from_rotation_z(0.5));
    let told = log(|m, t| {
        let (place, turn) = drift(t);
        m.transform("/tf", ["map", "odom"], t, place.to_array(), turn.to_array());
        let [x, y, yaw] = pose(t);
        m.transform("/tf", ["odom", "base_link"], t, [x, y, 0.0], yaw_quaternion(yaw));
    });
    let (frames, notes) = frames_of(&told, "");
    assert_eq!(frames.len(), 46);
    for frame in &frames {
        let t = f64::from(frame.index) / 10.0;
        let [x, y, yaw] = pose(t);
        let (place, turn) = drift(t);
        let expected = place + turn * DVec3::new(x, y, 0.0);
        assert!(DVec3::from(frame.position_m).distance(expected) < 1e-6);
        assert!((frame.yaw_rad - yaw - 0.5).abs() < 1e-6);
    }
    assert!(notes.iter().any(|note| note == "velocity: from the derivative of the pose"));
}

/// The antenna sits ahead of the car's origin and above it.
const ANTENNA_M: [f64; 3] = [0.8, 0.0, 1.5];
const HOME_DEG: [f64; 2] = [48.1, 11.5];

/// Latitude and longitude by the radii of curvature at home, good to millimetres over the drive.
fn place(t: f64) -> [f64; 3] {
    let [x, y, yaw] = pose(t);
    let (x, y) = (x + ANTENNA_M[0] * yaw.cos(), y + ANTENNA_M[0] * yaw.sin());
    let (a, e2) = (6_378_137.0_f64, 0.006_694_379_990_14);
    let [lat, lon] = HOME_DEG;
    let w = (1.0 - e2 * lat.to_radians().sin().powi(2)).sqrt();
    let (meridian, normal) = (a * (1.0 - e2) / w.powi(3), a / w);
    let (east, north) = (x / (normal * lat.to_radians().cos()), y / meridian);
    [lat + north.to_degrees(), lon + east.to_degrees(), 500.0]
}

fn satellites(fix_hz: f64, has_attitude: bool, has_speed: bool) -> Vec<u8> {
    log(|m, t| {
        if t == 0.0 {
            m.transform("/tf_static", ["base_link", "gps"], t, ANTENNA_M, NONE);
            // A receiver that has not found itself says so.
            m.fix("/gps", -1.0, -1, [0.0; 3]);
        }
        if (t * fix_hz).fract() < 1e-9 {
            m.fix("/gps", t, 0, place(t));
        }
        let attitude = has_attitude.then(|| yaw_quaternion(pose(t)[2]));
        m.imu("/imu", "base_link", t, attitude, [0.0, 0.0, YAW_RATE_RADPS]);
        if has_speed {
            m.twist("/speed", "base_link", t, [SPEED_MPS, 0.0, 0.0, 0.0, 0.0, 0.0]);
        }
    })
}

#[test]
fn positions_from_satellites_make_the_drive_with_attitudes_or_with_rates_of_turn() {
    for has_attitude in [true, false] {
        let (frames, notes) = frames_of(&satellites(20.0, has_attitude, false), "");
        assert_eq!(frames.len(), 46);
        bends_to_the_left(&frames, 0.06);
        let start = DVec3::new(-ANTENNA_M[0], 0.0, 0.0);
        for frame in &frames {
            let [x, y, yaw] = pose(f64::from(frame.index) / 10.0);
            let expected = start + DVec3::new(x, y, frame.position_m[2]);
            let off = DVec3::from(frame.position_m).distance(expected);
            assert!(off < 0.03, "{off} m at {}", frame.index);
            assert!((frame.yaw_rad - yaw).abs() < 0.02, "{}", frame.yaw_rad - yaw);
        }
        let unused = "pose: 1 of 92 messages of /gps are no fix and not used";
        assert!(notes.iter().any(|note| note == unused), "{notes:?}");
    }
}

#[test]
fn an_attitude_that_does_not_know_north_is_joined_to_the_courses() {
    let told = log(|m, t| {
        if t == 0.0 {
            m.transform("/tf_static", ["base_link", "gps"], t, ANTENNA_M, NONE);
        }
        m.fix("/gps", t, 0, place(t));
        let attitude = yaw_quaternion(pose(t)[2] - 2.0);
        m.imu("/imu", "base_link", t, Some(attitude), [0.0, 0.0, YAW_RATE_RADPS]);
    });
    let (frames, notes) = frames_of(&told, "");
    bends_to_the_left(&frames, 0.06);
    assert!((frames[10].yaw_rad - 0.2).abs() < 0.02, "{}", frames[10].yaw_rad);
    assert!(notes.iter().any(|note| note.contains("lies -115 degrees off")), "{notes:?}");
}

#[test]
fn a_standing_receiver_with_a_gyroscope_has_no_heading() {
    let told = log(|m, t| {
        m.fix("/gps", t, 0, place(0.0));
        m.imu("/imu", "base_link", t, None, [0.0; 3]);
    });
    let folder = tempfile::tempdir().unwrap();
    let (said, _) = tried(folder.path(), &told, &[]);
    assert_eq!(said.code, 1);
    assert!(said.err.contains("no heading for the positions of /gps"), "{}", said.err);
}

#[test]
fn a_speed_carries_the_pose_from_one_fix_a_second_to_the_next_and_nothing_else_does() {
    let named = "[topics]\ngnss = \"/gps\"\n";
    let (frames, _) = frames_of(&satellites(1.0, false, true), named);
    // The last fix is at 4 s.
    assert_eq!(frames.len(), 41);
    bends_to_the_left(&frames, 0.03);
    let folder = tempfile::tempdir().unwrap();
    let (said, frames, record) = ingested(folder.path(), &satellites(1.0, true, false), &[]);
    assert_eq!((said.code, frames.len()), (3, 5));
    assert_eq!(record.drops.count(Reason::EgoGap), 36);
}

#[test]
fn places_on_earth_are_those_of_the_tables() {
    let close = |got: DVec3, expected: [f64; 3]| {
        assert!(got.distance(DVec3::from(expected)) < 1e-3, "{got}, expected {expected:?}");
    };
    // Axes of the ellipsoid (NIMA TR8350.2), and 45 degrees north.
    close(geodesy::earth_centred(0.0, 0.0, 0.0), [6_378_137.0, 0.0, 0.0]);
    close(geodesy::earth_centred(0.0, 90.0, 100.0), [0.0, 6_378_237.0, 0.0]);
    close(geodesy::earth_centred(90.0, 0.0, 0.0), [0.0, 0.0, 6_356_752.314_2]);
    close(geodesy::earth_centred(45.0, 0.0, 0.0), [4_517_590.878_8, 0.0, 4_487_348.408_9]);
    // A degree of the meridian at the equator is 110,574.3 m of arc; its chord is shorter by the
    // cube of the angle over 24.
    let north = geodesy::TangentPlane::new(-0.5, 7.0, 0.0).enu(0.5, 7.0, 0.0);
    let arc = 110_574.276_f64;
    let chord = arc * (1.0 - (arc / 6_335_439.0).powi(2) / 24.0);
    assert!((north.length() - chord).abs() < 0.05, "{}", north.length());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    /// Back by the iteration of Bowring's auxiliary angle, which is not what makes it.
    #[test]
    fn places_go_to_the_plane_and_back(
        latitude in -89.0_f64..89.0,
        longitude in -180.0_f64..180.0,
        height in -100.0_f64..5000.0,
    ) {
        let point = geodesy::earth_centred(latitude, longitude, height);
        let (a, b) = (6_378_137.0_f64, 6_356_752.314_245_f64);
        let (e2, second) = (1.0 - b * b / (a * a), a * a / (b * b) - 1.0);
        let flat = point.x.hypot(point.y);
        let mut angle = (point.z * a).atan2(flat * b);
        let mut back = 0.0_f64;
        for _ in 0..4 {
            back = (point.z + second * b * angle.sin().powi(3))
                .atan2(flat - e2 * a * angle.cos().powi(3));
            angle = (b * back.sin()).atan2(a * back.cos());
        }
        prop_assert!((back.to_degrees() - latitude).abs() < 1e-9);
        prop_assert!((point.y.atan2(point.x).to_degrees() - longitude).abs() < 1e-9);
        // The plane keeps distances and puts its own origin at zero.
        let plane = geodesy::TangentPlane::new(latitude, longitude, height);
        prop_assert!(plane.enu(latitude, longitude, height).length() < 1e-6);
        let other = geodesy::earth_centred(latitude + 0.01, longitude - 0.02, height + 5.0);
        let told = plane.enu(latitude + 0.01, longitude - 0.02, height + 5.0);
        prop_assert!((told.length() - other.distance(point)).abs() < 1e-6);
        prop_assert!(told.x <= 0.0 && told.y > 0.0);
    }
}

/// The radar cloud of a drive.
fn radar(
    fields: &[(&str, usize)],
    step: usize,
    point: &[f64],
    profile: &str,
) -> (Frame, Vec<String>) {
    let told = log(|m, t| {
        m.odometry("/odom", ["odom", "base_link"], t);
        if t == 0.0 {
            m.transform("/tf_static", ["base_link", "camera"], t, CAMERA_M, OPTICAL);
            m.transform("/tf_static", ["base_link", "radar"], t, CAMERA_M, NONE);
        }
        m.cloud("/radar/points", "radar", t, (fields, step), &[point.to_vec()]);
    });
    let (mut frames, notes) = frames_of(&told, profile);
    (frames.remove(0), notes)
}

#[test]
fn a_radar_cloud_is_the_same_in_carlas_layout_in_polar_coordinates_and_with_other_signs() {
    let whole = carla_radar_point();
    let [range, azimuth, elevation] = [whole[3], whole[5], whole[6]];
    let speeds = |frame: &Frame| frame.radar.clone().unwrap();
    let (expected, _) = radar(&CARLA_RADAR_FIELDS, 32, &whole, "");
    let expected = speeds(&expected);
    assert_eq!(expected.speed_mps, Some(vec![half::f16::from_f64(CLOSING_MPS)]));
    let polar = [("velocity", 0), ("range", 4), ("azimuth", 8), ("elevation", 14)];
    let (told, _) = radar(&polar, 18, &[CLOSING_MPS, range, -azimuth, elevation], "");
    assert_eq!(speeds(&told), expected);
    let right = "[radar]\nazimuth = \"right\"\nclosing_speed = \"positive\"\n";
    let (told, _) = radar(&polar, 18, &[-CLOSING_MPS, range, azimuth, elevation], right);
    assert_eq!(speeds(&told), expected);

    // Without a speed the returns are kept, and say so.
    let (told, notes) = radar(&CARLA_RADAR_FIELDS[..3], 12, &whole[..3], "");
    let kept = told.radar.unwrap();
    assert_eq!((kept.pixel, kept.speed_mps), (expected.pixel, None));
    let note = "radar: /radar/points measures no radial speed, so radar_speed is null; its returns \
                are kept";
    assert!(notes.iter().any(|other| other == note), "{notes:?}");
    // A return whose speed is no number is none.
    let mut broken = whole.clone();
    broken[4] = f64::NAN;
    let (told, _) = radar(&CARLA_RADAR_FIELDS, 32, &broken, "");
    assert_eq!(speeds(&told).pixel.len(), 0);
}

#[test]
fn routes_are_brought_to_the_world_of_the_pose_or_left_out() {
    // Straight ahead along the first heading, told in the map, in the car's frame, and in a frame
    // that nothing knows.
    let told = |frame: &'static str, points: [[f64; 2]; 2]| {
        log(move |m, t| {
            m.odometry("/odom", ["odom", "base_link"], t);
            if t == 0.0 {
                let turn = DQuat::from_rotation_z(1.0).to_array();
                m.transform("/tf_static", ["map", "odom"], t, [10.0, 20.0, 0.0], turn);
                m.path("/route", frame, t, &points);
            }
        })
    };
    let (sin, cos) = 1.0_f64.sin_cos();
    let in_map = [[10.0, 20.0], [10.0 + 60.0 * cos, 20.0 + 60.0 * sin]];
    for (frame, points) in [
        ("odom", [[0.0, 0.0], [60.0, 0.0]]),
        ("map", in_map),
        ("base_link", [[0.0, 0.0], [60.0, 0.0]]),
    ] {
        let (frames, _) = frames_of(&told(frame, points), "");
        assert_eq!(frames[0].route.source, RouteSource::Planned);
        for point in frames[0].route.waypoints_m.chunks_exact(2).enumerate() {
            let (i, [x, y]) = (point.0, [point.1[0], point.1[1]]);
            assert!((x - 0.4 * i as f32).abs() < 1e-3 && y.abs() < 1e-3, "{frame}: {x}, {y}");
        }
    }
    let (frames, notes) = frames_of(&told("mars", [[0.0, 0.0], [60.0, 0.0]]), "");
    assert_eq!(frames[0].route.source, RouteSource::Driven);
    let left_out = "route /route: 1 of 1 left out, no transform from `mars` to `odom`; the log has \
                    map -> odom";
    assert!(notes.iter().any(|note| note == left_out), "{notes:?}");
}

#[test]
fn the_presets_of_carla_have_the_words_of_their_names() {
    let Some(path) = shared("facts/carla_weather_0916.json") else { return };
    let presets: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    for (name, preset) in presets.as_object().unwrap() {
        let told = Weather {
            precipitation: preset["precipitation"].as_f64().unwrap(),
            sun_altitude_deg: preset["sun_altitude_angle"].as_f64().unwrap(),
        };
        let rains = [("SoftRain", "drizzle"), ("MidRain", "rainy"), ("HardRain", "storm")];
        let rain = rains.iter().find(|(prefix, _)| name.starts_with(prefix));
        let suns = [("Night", "night"), ("Sunset", "sunset")];
        let sun = suns.iter().find(|(suffix, _)| name.ends_with(suffix));
        let expected = match name.as_str() {
            "Default" => (None, None),
            _ => (Some(rain.map_or("clear", |r| r.1)), Some(sun.map_or("daytime", |s| s.1))),
        };
        let words = (conditions::weather(&told), conditions::illumination(&told));
        assert_eq!(words, expected, "{name}");
    }
}

#[test]
fn poses_of_autoware_with_covariance_and_velocities_of_their_own_make_the_drive() {
    let told = log(|m, t| {
        let [x, y, yaw] = pose(t);
        let mut cdr = header(t, "map");
        cdr.f64s(&[x, y, 0.0]).f64s(&yaw_quaternion(yaw)).f64s(&[0.0; 36]);
        m.add("/pose", "geometry_msgs/PoseWithCovarianceStamped", t, &mut cdr);
        let mut velocity = header(t, "base_link");
        velocity.f32(SPEED_MPS as f32).f32(0.125).f32(YAW_RATE_RADPS as f32);
        m.add("/velocity", "autoware_vehicle_msgs/VelocityReport", t, &mut velocity);
    });
    let (frames, notes) = frames_of(&told, "");
    assert_eq!(frames.len(), 46);
    assert!(frames.iter().all(|frame| frame.velocity_mps == [5.0, 0.125]));
    assert!(notes.iter().any(|note| note == "velocity: from /velocity"));
}
