//! A drive written by packages that others maintain, against what numpy says of its arrays.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{env, path::Path, process::Command};

use pmp::frame::Frame;
use serde_json::Value as Json;

use crate::ingest::{frames, into};

/// The Python that has the peers' packages: scripts/check.sh makes one.
#[allow(clippy::disallowed_methods)] // Where the peers are is no setting of pmp's.
pub(crate) fn python() -> String {
    env::var("PMP_PYTHON").unwrap_or_else(|_| "python3".to_string())
}

/// The frames that come of a writer's log, and numpy's facts; `None` where its package is absent.
fn written_by(writer: &str, package: &str) -> Option<(Vec<Frame>, Json)> {
    let import = format!("import numpy, PIL, {package}");
    let has = Command::new(python()).args(["-c", &import]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: {} has not all of numpy, pillow, {package}", python());
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("drive.mcap");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/writers.py");
    let output = Command::new(python()).arg(script).arg(writer).arg(&log).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&log]);
    assert_eq!(said.code, 0, "{writer}: {}", said.err);
    let frames = frames(&dataset).into_iter().map(|(_, frame)| frame).collect();
    Some((frames, serde_json::from_slice(&output.stdout).unwrap()))
}

fn numbers(fact: &Json) -> Vec<f64> {
    fact.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

#[track_caller]
fn near(what: &str, ours: f64, theirs: f64, tolerance: f64) {
    assert!((ours - theirs).abs() <= tolerance, "{what}: {ours}, and numpy says {theirs}");
}

/// Ralidar to the pixel and to the bit, motion and labels of a left turn; `is_exact` where the log
/// has velocities, and does not leave them to the derivative of positions.
fn check(writer: &str, package: &str, is_exact: bool) {
    let Some((frames, facts)) = written_by(writer, package) else { return };
    let (speed, yaw_rate) = (facts["speed"].as_f64().unwrap(), facts["yaw_rate"].as_f64().unwrap());
    let ticks = facts["ticks"].as_array().unwrap();
    assert_eq!((frames.len(), ticks.len()), (46, 11), "{writer}");
    for (frame, fact) in frames.iter().zip(ticks) {
        let (lidar, radar) = (frame.lidar.as_ref().unwrap(), frame.radar.as_ref().unwrap());
        let pixels = |of: &[u32]| of.iter().map(|pixel| f64::from(*pixel)).collect::<Vec<_>>();
        assert_eq!(pixels(&lidar.pixel), numbers(&fact["lidar_pixel"]), "{writer}");
        assert_eq!(pixels(&radar.pixel), numbers(&fact["radar_pixel"]), "{writer}");
        assert!(lidar.pixel.len() > 100 && radar.pixel.len() > 10);
        let speeds: Vec<f64> = radar.speed_mps.iter().flatten().map(|v| v.to_f64()).collect();
        assert_eq!(speeds, numbers(&fact["radar_speed"]), "{writer}");
        for (i, xyz) in fact["lidar_xyz"].as_array().unwrap().iter().enumerate() {
            let ours = [lidar.x[i], lidar.y[i], lidar.z[i]].map(|v| v.to_f64());
            // Half floats: the last bit may differ where two ways of computing straddle a step.
            for (ours, theirs) in ours.into_iter().zip(numbers(xyz)) {
                near("lidar", ours, theirs, theirs.abs() * 1e-3);
            }
        }
        for (ours, theirs) in frame.position_m.into_iter().zip(numbers(&fact["position"])) {
            near("position", ours, theirs, 1e-9);
        }
        near("yaw", frame.yaw_rad, fact["yaw"].as_f64().unwrap(), 1e-9);
        let tolerance = if is_exact { 1e-6 } else { 0.02 };
        near("speed", f64::from(frame.velocity_mps[0]), speed, tolerance);

        // Left is positive: yaw grows, the route and the next 3 s bend to positive y.
        assert_eq!(frame.future.len, 30);
        near("yaw in 3 s", f64::from(frame.future.yaw_rad[29]), 3.0 * yaw_rate, 1e-5);
        let radius = speed / yaw_rate;
        let (x, y) = (frame.future.xy_m[58], frame.future.xy_m[59]);
        near("x in 3 s", f64::from(x), radius * (3.0 * yaw_rate).sin(), 1e-4);
        near("y in 3 s", f64::from(y), radius * (1.0 - (3.0 * yaw_rate).cos()), 1e-4);
        let last = usize::from(frame.route.len) - 1;
        assert!(frame.route.waypoints_m[2 * last + 1] > 1.0, "{writer}: the route bends left");
    }
}

#[test]
fn rosbags_writes_ros_2() {
    check("rosbags-ros2", "rosbags", true);
}

#[test]
fn rosbags_writes_ros_1() {
    check("rosbags-ros1", "rosbags", true);
}

#[test]
fn mcap_ros2_support_writes_ros_2() {
    check("mcap-ros2-support", "mcap_ros2, rosbags", true);
}

#[test]
fn mcap_protobuf_support_writes_foxgloves_types() {
    check("mcap-protobuf-support", "mcap_protobuf, foxglove_schemas_protobuf", false);
}

#[test]
fn foxglove_sdk_writes_its_own_types() {
    check("foxglove-sdk", "foxglove", false);
}
