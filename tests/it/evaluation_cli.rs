//! `pmp-eval` as a process: what it prints, writes and refuses.
#![allow(clippy::unwrap_used)]

use std::{
    path::Path,
    process::{Command, Output},
};

use pmp::eval::offline::{errors::Errors, report::Report, store};

use crate::evaluation_report::{errors, report_of};

fn pmp_eval(arguments: &[&str], directory: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pmp-eval"));
    command.args(arguments).current_dir(directory).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[test]
fn table_merges_reports_of_the_same_frames_and_prints_to_stdout() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, errors: &Errors| {
        store::write(&directory.path().join(name), &report_of(errors, false), errors).unwrap();
    };
    write("a", &errors(1.0, 6, 40));
    let mut renamed = errors(0.5, 6, 40);
    renamed.policies[0].name = "run_2".to_string();
    write("b", &renamed);
    let output = pmp_eval(&["table", "a", "b", "--format", "csv"], directory.path());
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let csv = String::from_utf8(output.stdout).unwrap();
    let names: Vec<_> = csv.lines().skip(1).map(|row| row.split(',').nth(3).unwrap()).collect();
    assert_eq!(names, ["run_1", "constant-velocity", "stand-still", "run_2"]);
    for (format, start) in [("md", "# Offline"), ("tex", "\\begin{tabular}"), ("json", "{\n")] {
        let output = pmp_eval(&["table", "a", "--format", format], directory.path());
        assert!(String::from_utf8(output.stdout).unwrap().starts_with(start), "{format}");
    }
}

#[test]
fn table_refuses_what_does_not_belong_together_and_says_which() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, report: &Report, errors: &Errors| {
        store::write(&directory.path().join(name), report, errors).unwrap();
    };
    let of = errors(1.0, 6, 40);
    write("a", &report_of(&of, false), &of);
    let fewer = errors(1.0, 6, 39);
    write("frames", &report_of(&fewer, false), &fewer);
    let mut elsewhere = report_of(&of, false);
    elsewhere.dataset.manifest_sha256 = "cd".repeat(32);
    write("dataset", &elsewhere, &of);
    let retrained = errors(2.0, 6, 40);
    write("name", &report_of(&retrained, false), &retrained);
    for (other, what) in [
        ("frames", "is over other frames (234 held out by episodes) than a (240 by episodes)"),
        ("dataset", "of dataset town (cdcdcdcdcdcd) and a is of dataset town (abababababab)"),
        ("name", "another `run_1` than in a"),
        ("absent", "no report can be read"),
    ] {
        let output = pmp_eval(&["table", "a", other], directory.path());
        assert_eq!(output.status.code(), Some(1), "{other}");
        assert!(output.stdout.is_empty(), "{other}");
        assert!(stderr(&output).contains(what), "{}", stderr(&output));
        assert!(stderr(&output).contains("hint: "), "{}", stderr(&output));
    }
}

#[test]
fn misuse_exits_2_and_help_teaches() {
    let here = Path::new(".");
    let output = pmp_eval(&["offline", "--policy", "stand-still", "--out", "x"], here);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("--data"), "{}", stderr(&output));
    let help = String::from_utf8(pmp_eval(&["offline", "--help"], here).stdout).unwrap();
    for word in ["Examples:", "Exit codes:", "constant-velocity", "report.json"] {
        assert!(help.contains(word), "{help}");
    }
}

#[test]
fn unknown_policy_fails_with_the_names_that_exist() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = ["offline", "--policy", "constant-speed", "--data", "d", "--out", "o"];
    let output = pmp_eval(&arguments, directory.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("constant-velocity"), "{}", stderr(&output));
    assert!(!directory.path().join("o").exists(), "nothing was written");
}
