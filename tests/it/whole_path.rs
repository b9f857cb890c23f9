//! From a log to a table through the programs, as a user would.

use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use pmp::eval::offline::errors::Sight;

use crate::{
    fixtures::DriveLog,
    ingest::{into, same_trees, text},
};

fn train(dataset: &Path, run: &Path, more: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pmp-train"));
    command.args(["--data", text(dataset), "--out", text(run)]).args(more);
    command
}

fn evaluate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pmp-eval")).args(arguments).output().unwrap()
}

/// A dataset of three drives of 12 s.
fn dataset(folder: &Path) -> std::path::PathBuf {
    let logs: Vec<_> = (0..3)
        .map(|i| {
            let speed_mps = 4.0 + f64::from(i);
            let log = DriveLog { seconds: 12.0, speed_mps, ..DriveLog::default() };
            log.write(folder, &format!("drive-{i}.mcap"))
        })
        .collect();
    let dataset = folder.join("data");
    let said = into(&dataset, &logs.iter().map(|log| log.as_path()).collect::<Vec<_>>());
    assert_eq!(said.code, 0, "{}", said.err);
    dataset
}

#[test]
fn a_training_killed_and_resumed_on_a_dataset_ends_with_the_bytes_of_one_never_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = dataset(folder.path());
    let config = folder.path().join("tiny.toml");
    fs::write(&config, "preset = \"tiny\"\nsteps = 12\nsave_every = 4\nlog_every = 2\n").unwrap();
    let more = ["--config", text(&config), "--batch-size", "8"];

    let whole = folder.path().join("whole");
    let done = train(&dataset, &whole, &more).args(["--jobs", "2"]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));

    let killed = folder.path().join("killed");
    let mut child = train(&dataset, &killed, &more)
        .args(["--jobs", "1"])
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !killed.join("run.json").exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        assert!(begun.elapsed() < Duration::from_secs(60), "no checkpoint is being made");
        thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let done = train(&dataset, &killed, &more).arg("--resume").output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    same_trees(&whole, &killed);
}

#[test]
fn a_trained_run_is_evaluated_beside_the_baselines_and_its_table_printed_again() {
    let folder = tempfile::tempdir().unwrap();
    let dataset = dataset(folder.path());
    let (run, report) = (folder.path().join("run"), folder.path().join("report"));
    let done = train(&dataset, &run, &["--preset", "nano", "--steps", "20"]).output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));

    let calibrate = ["calibrate", "--policy", text(&run), "--data", text(&dataset)];
    let said = evaluate(&calibrate);
    assert_eq!(said.status.code(), Some(0), "{}", String::from_utf8_lossy(&said.stderr));
    assert!(String::from_utf8(said.stdout).unwrap().starts_with("c1 = "));
    assert_eq!(evaluate(&calibrate).status.code(), Some(1), "it is there already");
    let fusion = pmp::eval::calibration::read(&run).unwrap().unwrap().fusion;

    let offline = ["offline", "--policy", text(&run), "--data", text(&dataset), "--out"];
    let done = evaluate(&[offline.as_slice(), &[text(&report)]].concat());
    let table = String::from_utf8(done.stdout).unwrap();
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(table.contains("| `run` | `constant-velocity` | `stand-still` |"), "{table}");
    assert!(table.contains("Held out by episodes"), "{table}");

    let read = pmp::eval::offline::store::read(&report).unwrap();
    let policy = &read.policies[0];
    assert_eq!((policy.sight, policy.fusion), (Sight::Blind, Some(fusion)), "nano has no pictures");
    assert!(policy.metrics["fused_steer_l1"].value.is_some());
    assert!(policy.variance.as_ref().unwrap().lambda.is_some());
    assert_eq!(policy.attention.keys().collect::<Vec<_>>(), ["route", "velocity"]);

    let again = evaluate(&["table", text(&report)]);
    assert_eq!(String::from_utf8(again.stdout).unwrap(), table);

    let refused = evaluate(&[offline.as_slice(), &[text(&report)]].concat());
    assert_eq!(refused.status.code(), Some(1));
    let error = String::from_utf8(refused.stderr).unwrap();
    assert!(error.contains("a report is already here"), "{error}");
}

#[test]
fn a_lone_episode_is_cut_in_time_and_its_report_says_that_it_is_weak() {
    let folder = tempfile::tempdir().unwrap();
    let log = DriveLog { seconds: 30.0, ..DriveLog::default() };
    let log = log.write(folder.path(), "alone.mcap");
    let dataset = folder.path().join("data");
    assert_eq!(into(&dataset, &[&log]).code, 0);

    let opened = pmp::dataset::open::Dataset::open(&dataset).unwrap();
    let ticks =
        |part| -> Vec<u32> { opened.frames(part).map(|frame| frame.unwrap().1.index).collect() };
    let (trains, judges) = (ticks(&opened.train), ticks(&opened.val));
    assert_eq!(judges, (201..=300).collect::<Vec<_>>(), "the last third");
    assert_eq!(trains, (0..=170).collect::<Vec<_>>(), "3 s are between them");

    let report = folder.path().join("report");
    let policy = ["offline", "--policy", "recorded", "--data", text(&dataset), "--out"];
    let done = evaluate(&[policy.as_slice(), &[text(&report)]].concat());
    let table = String::from_utf8(done.stdout).unwrap();
    assert!(table.contains("**Weak evidence"), "{table}");
    let json = fs::read_to_string(report.join("report.json")).unwrap();
    assert!(json.contains("\"weak\": true"));
}
