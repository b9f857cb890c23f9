//! What a recipe can ask for: micro-batches, an average of the weights, early stopping, schedules,
//! checkpoints to keep, curves for others, grids.

use std::{collections::BTreeMap, fs};

use candle_core::{Device::Cpu, Tensor};
use pmp::{
    model::{
        config::{LossConfig, Optimizer, Schedule, TrainConfig},
        learned::Learned,
        run, sweep,
        train::{Event, State, train},
    },
    policy::Policy as _,
};
use serde_json::Value;

use crate::training::{
    Synthetic, assert_same_files, data, files, run as train_in, run_with, small,
};

fn weights_after(cfg: &TrainConfig) -> BTreeMap<String, Tensor> {
    let mut state = State::new(cfg, &Cpu).unwrap();
    train(cfg, &mut state, &mut data(Synthetic::new(4)), &mut |_, _| Ok(())).unwrap();
    state.weights.snapshot().unwrap()
}

fn numbers(t: &Tensor) -> Vec<f32> {
    t.flatten_all().unwrap().to_vec1().unwrap()
}

#[test]
fn micro_batches_make_the_step_of_the_whole_batch() {
    let whole = TrainConfig { steps: 3, optimizer: Optimizer::Adam, ..small() };
    let parts = TrainConfig { micro_batches: 3, ..whole.clone() };
    let (whole, parts) = (weights_after(&whole), weights_after(&parts));
    for (name, value) in &whole {
        for (a, b) in numbers(value).iter().zip(numbers(&parts[name])) {
            // Adam's step is the gradient's sign at first: rounding moves what hardly matters.
            assert!((a - b).abs() < 2e-5, "{name}: {a} {b}");
        }
    }
}

#[test]
fn average_is_judged_drives_and_is_resumed() {
    let dir = tempfile::tempdir().unwrap();
    let (whole, cut) = (dir.path().join("whole"), dir.path().join("cut"));
    let cfg = TrainConfig { ema: 0.9, ..small() };
    train_in(&cfg, &whole, false).unwrap();
    for dies_at in [5, 9] {
        run_with(&cfg, &cut, true, Synthetic::dying(4, dies_at)).unwrap_err();
    }
    train_in(&cfg, &cut, true).unwrap();
    assert_same_files(&whole, &cut);

    // By hand: what the policy has is the average, with the slow start.
    let mut state = State::new(&cfg, &Cpu).unwrap();
    let name = "route.fc0.bias";
    let mut by_hand = numbers(&state.weights.snapshot().unwrap()[name]);
    train(&cfg, &mut state, &mut data(Synthetic::new(4)), &mut |state, event| {
        if let Event::Trained { line, .. } = event {
            let n = line.step as f32;
            let decay = 0.9f32.min((1.0 + n) / (10.0 + n));
            let now = numbers(&state.weights.snapshot().unwrap()[name]);
            for (average, now) in by_hand.iter_mut().zip(now) {
                *average = decay * *average + (1.0 - decay) * now;
            }
        }
        Ok(())
    })
    .unwrap();
    let kept = run::trained(&whole, &Cpu).unwrap().weights;
    for (got, want) in numbers(&kept[name]).iter().zip(&by_hand) {
        assert!((got - want).abs() < 1e-6, "{got} {want}");
    }
    assert_ne!(numbers(&kept[name]), numbers(&state.weights.snapshot().unwrap()[name]));
}

#[test]
fn training_that_does_not_improve_ends_and_its_best_checkpoint_stays() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    // So large a rate only makes it worse.
    let cfg = TrainConfig {
        steps: 60,
        lr: 0.3,
        schedule: Schedule::Constant,
        eval_every: 2,
        save_every: 7,
        patience: 3,
        keep: 2,
        ..small()
    };
    let events = train_in(&cfg, &out, false).unwrap();
    let validations: Vec<(u64, f64)> = events
        .iter()
        .filter_map(|event| match event {
            Event::Validated { line, .. } => Some((line.step, line.terms.total)),
            _ => None,
        })
        .collect();
    let best = validations.iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    let manifest = run::manifest(&out).unwrap().unwrap();
    assert_eq!(manifest.progress.best.as_ref().unwrap().step, best.0);
    assert!(manifest.progress.stopped_early && manifest.step == best.0 + 6, "{manifest:?}");
    assert!(matches!(events.last(), Some(Event::StoppedEarly { step }) if *step == manifest.step));
    let kept: Vec<&str> = manifest.checkpoints.keys().map(String::as_str).collect();
    assert!(kept.contains(&format!("step-{:08}", best.0).as_str()), "{kept:?}");
    assert!(kept.len() <= 3, "{kept:?}");

    // A finished run is left alone; a checkpoint of it drives by its own path.
    let before = files(&out);
    train_in(&cfg, &out, true).unwrap();
    assert_eq!(before, files(&out));
    let path = out.join("checkpoints").join(kept[0]);
    assert_eq!(Learned::open(&path, &Cpu).unwrap().name(), kept[0]);
    let missing = Learned::open(&out.join("checkpoints/step-00000001"), &Cpu).unwrap_err();
    assert!(missing.to_string().starts_with("no trained run"), "{missing}");
}

#[test]
fn stopped_early_run_killed_anywhere_ends_with_the_same_files() {
    let dir = tempfile::tempdir().unwrap();
    let (whole, cut) = (dir.path().join("whole"), dir.path().join("cut"));
    let cfg = TrainConfig { lr: 0.3, eval_every: 2, patience: 2, steps: 40, keep: 2, ..small() };
    train_in(&cfg, &whole, false).unwrap();
    for dies_at in [1, 3, 4, 5] {
        run_with(&cfg, &cut, true, Synthetic::dying(4, dies_at)).unwrap_err();
    }
    train_in(&cfg, &cut, true).unwrap();
    assert_same_files(&whole, &cut);
}

#[test]
fn learning_rate_is_constant_or_falls_in_steps() {
    let constant = TrainConfig { schedule: Schedule::Constant, ..TrainConfig::default() };
    assert_eq!([constant.lr_at(50), constant.lr_at(2999)], [1e-3; 2]);
    let step = TrainConfig { schedule: Schedule::Step, lr_step: 100, ..TrainConfig::default() };
    assert_eq!([step.lr_at(149), step.lr_at(150), step.lr_at(349)], [1e-3, 5e-4, 2.5e-4]);
}

#[test]
fn weights_of_terms_make_the_total() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let loss = LossConfig { motion_weight: 0.5, entropy_weight: 0.2, ..small().loss };
    train_in(&TrainConfig { loss, ..small() }, &out, false).unwrap();
    let text = fs::read_to_string(out.join("metrics.jsonl")).unwrap();
    for line in text.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let n = |key: &str| line[key].as_f64().unwrap();
        let total = n("action") + 0.5 * n("motion") - 0.2 * n("entropy");
        assert!((n("total") - total).abs() < 1e-9, "{line}");
        assert!((0.0..=3f64.ln() + 1e-6).contains(&n("entropy")));
    }
}

/// CRC-32C bit by bit (RFC 3720).
fn crc32c(data: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { crc >> 1 ^ 0x82F6_3B78 } else { crc >> 1 };
    !data.iter().fold(!0u32, |crc, byte| (0..8).fold(crc ^ u32::from(*byte), |crc, _| step(crc)))
}

#[test]
fn tensorboards_records_hold_the_curves_and_their_checksums() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    train_in(&small(), &out, false).unwrap();
    let bytes = fs::read(out.join("events.out.tfevents.0.pmp")).unwrap();
    let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let masked = |data: &[u8]| crc32c(data).rotate_right(15).wrapping_add(0xa282_ead8);
    let (mut at, mut records) = (0, vec![]);
    while at < bytes.len() {
        let len = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
        assert_eq!(number(at + 8), masked(&bytes[at..at + 8]));
        let data = &bytes[at + 12..at + 12 + len];
        assert_eq!(number(at + 12 + len), masked(data));
        records.push(data);
        at += 16 + len;
    }
    let contains =
        |record: &[u8], text: &str| record.windows(text.len()).any(|w| w == text.as_bytes());
    assert!(contains(records[0], "brain.Event:2"));
    let lines = fs::read_to_string(out.join("metrics.jsonl")).unwrap();
    assert_eq!(records.len(), 1 + lines.lines().count());
    assert!(contains(records[1], "train/total") && contains(records[1], "train/lr"));
    // The first logged loss, as a float of the record.
    let first: Value = serde_json::from_str(lines.lines().next().unwrap()).unwrap();
    let total = (first["total"].as_f64().unwrap() as f32).to_le_bytes();
    assert!(records[1].windows(4).any(|w| w == total));

    let curves = fs::read_to_string(out.join("curves.svg")).unwrap();
    assert!(curves.starts_with("<svg") && curves.contains("validation"));
}

#[test]
fn grid_is_every_combination_and_its_table_puts_the_best_first() {
    let text = "model = \"blind\"\nsteps = 9\n[grid]\nlr = [1e-3, 0.01]\n\"net.modes\" = [1, 3]\n";
    let runs = sweep::expand(text, None, None).unwrap();
    let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "lr=0.001,net.modes=1",
            "lr=0.001,net.modes=3",
            "lr=0.01,net.modes=1",
            "lr=0.01,net.modes=3"
        ]
    );
    assert_eq!((runs[2].config.lr, runs[2].config.steps), (0.01, 9));
    let error = |text: &str| sweep::expand(text, None, None).unwrap_err().to_string();
    assert_eq!(error("steps = 9"), "grid: there is no table of that name");
    assert_eq!(error("[grid]\nlr = 3"), "lr: must be a list of values");
    assert_eq!(error("[grid]\nlt = [3]"), "lt: there is no such key");

    let line = |total: f64| {
        let cfg = small();
        let state = State::new(&cfg, &Cpu).unwrap();
        let mut line =
            pmp::model::train::validate(&cfg, &state, &mut data(Synthetic::new(4))).unwrap();
        line.terms.total = total;
        Some(line)
    };
    let results = [("a".to_string(), line(0.5)), ("b".into(), None), ("c".into(), line(0.25))];
    let table = sweep::table(&results);
    let rows: Vec<&str> = table.lines().skip(2).map(|row| &row[2..3]).collect();
    assert_eq!(rows, ["c", "a", "b"]);
}
