//! The constants of eq. (3): from which frames they come, what is said of them, and the file.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use pmp::{
    control::fusion::Fusion,
    eval::{
        calibration::{self, Calibration},
        offline::{
            errors::{Errors, PolicyErrors, Sight},
            metrics::FrameErrors,
        },
    },
    frame::RecordedAction,
    policy::Action,
};
use serde_json::Value;

use crate::evaluation::accelerating;

/// 101 frames, S = 0 ... 0.1, where the recorded action is nothing, a1 is off by 0.1 in every channel
/// and a2 by 0.3; `target_m` is the displacement at the target and the mean up to it.
fn errors(target_m: fn(usize) -> f64) -> Errors {
    let mut errors = Errors::default();
    let same = |value: f32| Action { steer: value, throttle: value, brake: value };
    let mut rows = Vec::new();
    for i in 0..=100 {
        let mut frame = accelerating(i, 5.0, 0.0);
        frame.action = RecordedAction { steer: Some(0.0), throttle: Some(0.0), brake: Some(0.0) };
        errors.push_frame(0, &frame);
        rows.push(FrameErrors {
            planned: [Some(same(0.1)), Some(same(0.3)), None],
            variance: Some(f64::from(i) * 1e-3),
            target_m: Some(target_m(i as usize)),
            target_ade_m: Some(target_m(i as usize)),
            ..FrameErrors::default()
        });
    }
    errors.policies.push(PolicyErrors {
        name: "run".to_string(),
        sees_the_future: false,
        sight: Sight::Blind,
        fusion: None,
        branches: Vec::new(),
        rows,
    });
    errors
}

fn calibrated(errors: &Errors) -> Calibration {
    let of = ("step-00000020".to_string(), "ab".repeat(32));
    calibration::calibration(errors, &errors.policies[0], of.0, of.1).unwrap()
}

#[test]
fn constants_trust_half_of_the_frames_and_their_errors_are_told() {
    let found = calibrated(&errors(|i| i as f64 * 1e-3));
    let Fusion::Variance { c1, c2 } = found.fusion else { panic!("{:?}", found.fusion) };
    assert!((c2 - 0.05).abs() < 1e-12 && (c1 - 2f64.ln() / 0.045).abs() < 1e-9, "{c1} {c2}");
    assert_eq!((found.frames, found.s_median, found.s_q95), (101, 0.05, 0.095));
    assert_eq!(found.s_spearman, Some(1.0));
    let near = |a: Option<f64>, b: f64| assert!((a.unwrap() - b).abs() < 1e-6, "{a:?} {b}");
    near(found.a1_l1, 0.1);
    near(found.a2_l1, 0.3);
    near(found.ade_at_target_m, 0.05);
    // lambda is 1 in the first 51 frames, then 2^(-k / 45) in the k-th.
    let lambdas = 51.0 + (1..=50).map(|k| 0.5f64.powf(f64::from(k) / 45.0)).sum::<f64>();
    near(found.fused_l1, 0.1 + 0.2 * lambdas / 101.0);
}

#[test]
fn each_warning_stands_where_its_bound_is_crossed() {
    let found = calibrated(&errors(|i| i as f64 * 1e-3));
    assert_eq!(found.warnings.len(), 1, "{:?}", found.warnings);
    assert!(
        found.warnings[0].contains("more than 2 times the 0.100 of a1"),
        "{:?}",
        found.warnings
    );
    let mut better = errors(|i| i as f64 * 1e-3);
    for row in &mut better.policies[0].rows {
        row.planned[1] = row.planned[0];
    }
    assert_eq!(calibrated(&better).warnings, [] as [String; 0]);
    for row in &mut better.policies[0].rows {
        row.target_ade_m = Some(0.6);
        row.target_m = row.variance.map(|s| -s);
    }
    let warnings = calibrated(&better).warnings;
    assert_eq!(warnings.len(), 2, "{warnings:?}");
    assert!(warnings[0].contains("off by 0.60 m") && warnings[0].contains("drive by a1"));
    assert!(warnings[1].contains("-1.00, below 0.1"), "{warnings:?}");
}

#[test]
fn run_without_deviations_has_nothing_to_calibrate() {
    let mut errors = errors(|_| 0.0);
    errors.policies[0].rows.iter_mut().for_each(|row| row.variance = None);
    let of = (String::new(), String::new());
    let error = calibration::calibration(&errors, &errors.policies[0], of.0, of.1).unwrap_err();
    assert!(error.to_string().contains("nothing to calibrate"), "{error}");
}

#[test]
fn calibration_is_kept_once_and_read_back() {
    let run = tempfile::tempdir().unwrap();
    assert_eq!(calibration::read(run.path()).unwrap(), None);
    let found = calibrated(&errors(|i| i as f64 * 1e-3));
    calibration::write(run.path(), &found, false).unwrap();
    assert_eq!(calibration::read(run.path()).unwrap(), Some(found.clone()));
    let error = calibration::write(run.path(), &found, false).unwrap_err();
    assert!(error.hint().unwrap().contains("--force"), "{error}");
    let other = Calibration { frames: 7, ..found };
    calibration::write(run.path(), &other, true).unwrap();
    assert_eq!(calibration::read(run.path()).unwrap(), Some(other));
    assert_eq!(fs::read_dir(run.path()).unwrap().count(), 1, "no temporary file is left");
    fs::write(run.path().join(calibration::FILE), r#"{"version": 7}"#).unwrap();
    let error = calibration::read(run.path()).unwrap_err().to_string();
    assert!(error.contains("version 7, this build reads 1"), "{error}");
}

#[test]
fn schema_lists_every_field() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/fusion.v1.json");
    let schema: Value = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let listed: Vec<&str> =
        schema["fields"].as_array().unwrap().iter().map(|f| f["path"].as_str().unwrap()).collect();
    let found = serde_json::to_value(calibrated(&errors(|i| i as f64 * 1e-3))).unwrap();
    let mut fields = Vec::new();
    for (key, value) in found.as_object().unwrap() {
        match value {
            Value::Object(parts) => fields.extend(parts.keys().map(|part| format!("{key}.{part}"))),
            Value::Array(_) => fields.push(format!("{key}[]")),
            _ => fields.push(key.clone()),
        }
    }
    fields.sort();
    let mut listed: Vec<String> = listed.into_iter().map(str::to_string).collect();
    listed.sort();
    assert_eq!(fields, listed);
}
