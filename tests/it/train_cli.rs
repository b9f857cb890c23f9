//! `pmp-train` as a process: exit codes and words.

use std::process::{Command, Output};

fn pmp_train(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_pmp-train")).args(args).output().unwrap()
}

fn stderr(out: &Output) -> String {
    assert!(out.stdout.is_empty(), "talk does not belong on stdout");
    String::from_utf8(out.stderr.clone()).unwrap()
}

#[test]
fn mistyped_flag_of_pmp_train_exits_2_and_names_the_right_one() {
    let out = pmp_train(&["--data", "d", "--out", "r", "--resum"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(stderr(&out).contains("'--resume'"));
}

#[test]
fn configuration_that_makes_no_sense_is_refused_before_anything_is_made() {
    let dir = tempfile::tempdir().unwrap();
    let (out, file) = (dir.path().join("run"), dir.path().join("mine.toml"));
    let out = out.to_str().unwrap();
    let done = pmp_train(&["--data", "d", "--out", out, "--steps", "0"]);
    assert_eq!(done.status.code(), Some(1));
    assert_eq!(stderr(&done), "error: steps: must be at least 1\n");

    std::fs::write(&file, "leraning_rate = 1\n").unwrap();
    let file = file.to_str().unwrap();
    let done = pmp_train(&["--data", "d", "--out", out, "--config", file]);
    assert_eq!(done.status.code(), Some(1));
    assert!(stderr(&done).contains("leraning_rate: there is no such key"));
    assert!(!std::path::Path::new(out).exists());
}

#[test]
fn place_that_is_none_is_bad_usage() {
    let done = pmp_train(&["--data", "d", "--out", "r", "--device", "gpu"]);
    assert_eq!(done.status.code(), Some(2));
    assert!(stderr(&done).contains("`gpu` is none of auto, cpu, cuda, cuda:N"));
}

#[cfg(not(feature = "cuda"))]
#[test]
fn gpu_is_refused_by_a_program_built_without_cuda() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("run");
    let done = pmp_train(&["--data", "d", "--out", out.to_str().unwrap(), "--device", "cuda:1"]);
    assert_eq!(done.status.code(), Some(1));
    let text = stderr(&done);
    assert!(text.contains("device: cuda:1 in a program that was built without CUDA"), "{text}");
    assert!(text.contains("scripts/build_cuda.sh"), "{text}");
    assert!(!out.exists());
}

#[test]
fn network_is_described_without_data() {
    let done = pmp_train(&["--describe", "--model", "int", "--preset", "nano"]);
    assert_eq!(done.status.code(), Some(0));
    let text = String::from_utf8(done.stdout).unwrap();
    let line = |name: &str| -> Vec<String> {
        let line = text.lines().find(|line| line.starts_with(name)).unwrap();
        line.split_whitespace().map(String::from).collect()
    };
    // 7 x 7 x 3 x 4 kernel, scale and shift; on 8 x 20 pixels.
    assert_eq!(
        line("camera.conv1 "),
        ["camera.conv1", "8", "x", "20", "x", "4", "596", "94", "080"]
    );
    assert_eq!(line("action.fc1"), ["action.fc1", "3", "195", "192"]);
    assert!(text.lines().last().unwrap().starts_with("all"));
}

#[test]
fn only_networks_that_can_do_without_a_part_are_asked_to() {
    let done = pmp_train(&["--describe", "--model", "cil", "--disable", "camera"]);
    assert_eq!(done.status.code(), Some(1));
    assert!(stderr(&done).starts_with("error: disable: only the networks `pmp` and `blind`"));
}

#[test]
fn help_of_pmp_train_shows_examples_and_exit_codes() {
    let out = pmp_train(&["--help"]);
    assert_eq!(out.status.code(), Some(0));
    let text = String::from_utf8(out.stdout).unwrap();
    for word in ["Examples:", "--resume --steps 6000", "RUN/config.json", "Exit codes:"] {
        assert!(text.contains(word), "{text}");
    }
}
