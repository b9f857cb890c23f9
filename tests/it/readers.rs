//! Recorded logs in the hands of the official readers of MCAP, held against the simulator.
#![allow(clippy::unwrap_used)]

use std::{path::Path, process::Command};

use pmp::sim::{clocks::STEPS_PER_S, message::Encoding, reading::objects};
use serde_json::Value as Json;

use crate::{
    recording::{Shared, shared},
    replay::known,
    writers::python,
};

/// What a reader finds; `None` where its package is absent.
fn read_by(flavour: &str, package: &str, log: &Path) -> Option<Json> {
    let import = format!("import numpy, PIL, mcap, {package}");
    let has = Command::new(python()).args(["-c", &import]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: {} has not all of numpy, pillow, mcap, {package}", python());
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/readers.py");
    let output = Command::new(python()).arg(script).arg(flavour).arg(log).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

fn numbers(json: &Json) -> Vec<f64> {
    json.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// The step of a stamp, which is an integer too large for a float.
fn step(stamp_ns: &Json) -> usize {
    let since_ns = stamp_ns.as_i64().unwrap() - shared().episode.start_ns();
    since_ns as usize / (1_000_000_000 / STEPS_PER_S as usize)
}

fn check(found: &Json, topics: usize) {
    let known = known();
    assert_eq!(found["topics"].as_object().unwrap().len(), topics);
    assert_eq!(found["metadata"]["pmp.conditions"]["town"], "Town02");
    assert_eq!(found["picture_sizes"], serde_json::json!([[600, 250]]));
    let points = numbers(&found["cloud_points"]);
    assert!(points[2] > 10_000.0 && points[2].fract() == 0.0, "{points:?}");

    let odometry = found["odometry"].as_array().unwrap();
    assert!(odometry.len() > 40);
    for said in odometry {
        let car = &known[step(&said[0])].car;
        let velocity = car.velocity_ego_mps();
        let wanted = [car.position_m.x, car.position_m.y, velocity.x, velocity.y];
        assert_eq!(numbers(said)[1..], wanted, "odometry without noise is the car's state");
    }
    let steering = found["steering"].as_array().unwrap();
    assert!(steering.len() > 20);
    for said in steering {
        let wanted = known[step(&said[0])].decision.wanted.steer;
        assert_eq!(said[1].as_f64().unwrap() as f32, wanted);
    }
    // The first boxes are those of the first picture.
    let boxes = numbers(&found["boxes"][0]);
    let others = objects(&known[8].snapshot);
    let heights_m: f64 = others.iter().map(|object| object.size_m.z).sum();
    assert_eq!(boxes[0], others.len() as f64);
    assert!((boxes[1] - heights_m).abs() < 1e-9);
}

#[test]
fn the_readers_of_mcap_read_foxgloves_messages() {
    let package = "mcap_protobuf";
    let Some(found) = read_by("protobuf", package, shared().foxglove()) else { return };
    check(&found, 14);
    assert_eq!(found["topics"]["/objects"][0], "foxglove.SceneUpdate");
}

#[test]
fn foxgloves_own_package_defines_the_messages_as_the_log_does() {
    let Some(found) = read_by("foxglove-sdk", "mcap_protobuf, foxglove", shared().foxglove())
    else {
        return;
    };
    check(&found, 14);
    let same = found["same_definitions"].as_object().unwrap();
    assert!(same.len() > 7 && same.values().all(|same| *same == true), "{same:?}");
}

#[test]
fn the_readers_of_mcap_read_ros_2_messages() {
    let log = shared().record(&Shared::recipe(Encoding::Ros2, 1.2), "for-readers.mcap");
    let Some(found) = read_by("ros2", "mcap_ros2", &log) else { return };
    check(&found, 16);
}
