//! From plan to action: targets, PID, fusion, against arithmetic by hand.

use pmp::{
    control::{
        driver::{ControlConfig, Driver},
        fusion::{Fusion, fuse, variance},
        pid::{Pid, PidConfig},
        target::Target,
    },
    policy::{Action, Mode, ModeStd, Plan},
};

const STEP_S: f64 = 0.1;

/// A motion at a speed along a circle of a curvature, positive = left.
fn motion(speed_mps: f32, curvature_per_m: f32) -> Mode {
    Mode {
        weight: 1.0,
        speed_mps: [speed_mps; 30],
        yaw_rad: std::array::from_fn(|i| curvature_per_m * speed_mps * 0.1 * (i + 1) as f32),
        std: None,
    }
}

fn plan(mode: Mode) -> Plan {
    Plan { motion: vec![mode], ..Plan::default() }
}

fn near(a: f32, b: f64) {
    assert!((f64::from(a) - b).abs() < 1e-6, "{a} {b}");
}

#[test]
fn pid_is_its_formula_over_a_window() {
    let mut pid = Pid::new(PidConfig { p: 2.0, i: 3.0, d: 0.5, window: 2 }, 0.1);
    let out = [1.0, 3.0, -2.0].map(|error| pid.step(error));
    let by_hand = [
        2.0 + 3.0 * 0.1,
        6.0 + 3.0 * 0.4 + 0.5 * 20.0,
        -4.0 + 3.0 * 0.1 - 0.5 * 50.0, // the first error is out of the window
    ];
    for (out, by_hand) in out.iter().zip(by_hand) {
        assert!((out - by_hand).abs() < 1e-12, "{out} {by_hand}");
    }
    pid.reset();
    assert!((pid.step(1.0) - 2.3).abs() < 1e-12);
}

#[test]
fn target_is_the_first_step_five_metres_along_the_way() {
    // 8 m/s straight on: 4.8 m after 6 steps, 5.6 m after 7.
    let target = Target::of(&motion(8.0, 0.0), 8.0, 5.0);
    assert_eq!((target.step, target.bearing_rad, target.speed_mps), (7, 0.0, 8.0));
    assert!((target.path_m - 24.0).abs() < 1e-9);
    // A circle of 20 m radius: the chord's bearing is half of the arc's angle.
    let target = Target::of(&motion(8.0, 0.05), 8.0, 5.0);
    assert!((target.bearing_rad - 5.6 / 20.0 / 2.0).abs() < 1e-3, "{}", target.bearing_rad);
    // Too slow to get there: the last step.
    assert_eq!(Target::of(&motion(1.0, 0.0), 1.0, 5.0).step, 30);
}

#[test]
fn left_is_steered_to_the_left_and_lack_of_speed_is_throttle() {
    let config = ControlConfig::default();
    let mut driver = Driver::new(config, Fusion::A2, STEP_S);
    let left = driver.decide(&plan(motion(8.0, 0.05)), 8.0);
    let bearing = left.target.unwrap().bearing_rad;
    near(left.action.steer, -0.7 * bearing);
    assert_eq!((left.action.throttle, left.action.brake), (0.0, 0.0));

    driver.reset();
    let faster = driver.decide(&plan(motion(6.0, 0.0)), 5.0).action;
    near(faster.throttle, 0.25 + 0.20 * 0.1);
    let still = driver.decide(&plan(motion(6.0, 0.0)), 5.0).action;
    near(still.throttle, 0.25 + 0.20 * 0.2); // the lack adds up

    driver.reset();
    let flat_out = driver.decide(&plan(motion(20.0, 0.0)), 0.0).action;
    near(flat_out.throttle, 0.75);
    driver.reset();
    let slower = driver.decide(&plan(motion(6.0, 0.0)), 8.0).action;
    near(slower.brake, 2.0 * 0.25 + 2.0 * 0.20 * 0.1);
    assert_eq!(slower.throttle, 0.0);
}

#[test]
fn plan_to_stand_presses_the_brake_down_and_does_not_steer() {
    let mut driver = Driver::new(ControlConfig::default(), Fusion::A2, STEP_S);
    let mut stop = motion(0.0, 0.0);
    stop.yaw_rad = [0.5; 30];
    let action = driver.decide(&plan(stop), 0.0).action;
    assert_eq!((action.steer, action.throttle, action.brake), (0.0, 0.0, 1.0));
    // A policy that says nothing stops.
    let action = driver.decide(&Plan::default(), 5.0).action;
    assert_eq!((action.throttle, action.brake), (0.0, 1.0));
}

#[test]
fn brushed_brakes_are_none_and_the_harder_pedal_counts() {
    let mut driver = Driver::new(ControlConfig::default(), Fusion::A1, STEP_S);
    let mut act = |throttle: f32, brake: f32| {
        let action = Some(Action { steer: 0.0, throttle, brake });
        let action = driver.decide(&Plan { action, ..Plan::default() }, 5.0).action;
        (action.throttle, action.brake)
    };
    assert_eq!(act(0.3, 0.09), (0.3, 0.0));
    assert_eq!(act(0.05, 0.09), (0.05, 0.0));
    assert_eq!(act(0.5, 0.4), (0.5, 0.0));
    assert_eq!(act(0.3, 0.4), (0.0, 0.4));
}

#[test]
fn fusion_trusts_the_plan_as_far_as_its_variance_is_small() {
    let std = ModeStd { speed_mps: [2.0; 30], yaw_rad: [0.1; 30] };
    // (2 / 10)^2 + 0.1^2 a step.
    assert!((variance(&std, 7) - 7.0 * 0.05).abs() < 1e-6);
    let fusion = Fusion::Variance { c1: 2.0, c2: 0.25 };
    assert_eq!(fusion.lambda(Some(0.2)), 1.0);
    assert!((fusion.lambda(Some(0.35)) - (-0.2f64).exp()).abs() < 1e-12);
    assert_eq!(fusion.lambda(None), 1.0);
    assert_eq!([Fusion::A1.lambda(Some(0.0)), Fusion::A2.lambda(Some(9.0))], [0.0, 1.0]);
    assert_eq!(Fusion::Fixed { lambda: 0.3 }.lambda(None), 0.3);

    let (a1, a2) = (
        Action { steer: 1.0, throttle: 0.0, brake: 0.5 },
        Action { steer: 0.0, throttle: 0.8, brake: 0.1 },
    );
    let fused = fuse(a1, a2, 0.25);
    near(fused.steer, 0.75);
    near(fused.throttle, 0.2);
    near(fused.brake, 0.4);

    let mut driver = Driver::new(ControlConfig::default(), fusion, STEP_S);
    let mut mode = motion(8.0, 0.0);
    mode.std = Some(std);
    let decision =
        driver.decide(&Plan { action: Some(a1), motion: vec![mode], ..Plan::default() }, 8.0);
    assert!((decision.variance.unwrap() - 0.35).abs() < 1e-6);
    assert!((decision.lambda - (-0.2f64).exp()).abs() < 1e-6);
    near(decision.action.steer, 1.0 - decision.lambda);
}

#[test]
fn calibration_puts_one_half_at_the_95th_percentile() {
    let variances: Vec<f64> = (0..=1000).rev().map(|i| f64::from(i) / 1000.0).collect();
    let fusion = Fusion::calibrated(&variances).unwrap();
    assert_eq!(fusion.lambda(Some(0.5)), 1.0);
    assert!((fusion.lambda(Some(0.95)) - 0.5).abs() < 1e-12);
    assert!(Fusion::calibrated(&variances[..19]).is_none());
    assert!(Fusion::calibrated(&[0.3; 100]).is_none());
}

/// `schemas/control.toml` has every key, each with its default.
#[test]
fn the_file_of_the_controller_says_what_holds_without_it() {
    let text = include_str!("../../schemas/control.toml");
    assert_eq!(toml::from_str::<ControlConfig>(text).unwrap(), ControlConfig::default());
    let table: toml::Table = toml::from_str(text).unwrap();
    let ours = toml::Table::try_from(ControlConfig::default()).unwrap();
    assert_eq!(table, ours, "every key is there");
    assert!(toml::from_str::<ControlConfig>("ahead = 5.0").is_err());
}
