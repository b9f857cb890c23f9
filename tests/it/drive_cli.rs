//! `pmp-eval drive` as a process: episodes, tables, going on, and what it refuses.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use crate::ingest::text;

/// Two towns' worth of nobody, 4 s each.
const SUITE: &str = r#"
version = 1
name = "four-seconds"
seed = 3
episodes = 2
quick_episodes = 1
route_m = [350.0, 1500.0]

[rules]
slowest_kmph = 1e9
grace_s = 4.0

[[task]]
condition = "a test"
town = "Town02"
traffic = ["empty"]
skies = ["clear-daytime"]
"#;

fn drive(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pmp-eval"));
    command.arg("drive").args(arguments).output().unwrap()
}

fn said(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn policies_drive_a_suite_and_the_table_can_be_printed_again() {
    let folder = tempfile::tempdir().unwrap();
    let suite = folder.path().join("suite.toml");
    fs::write(&suite, SUITE).unwrap();
    let policies = ["--policy", "expert", "oracle-plan", "stand-still", "constant-velocity"];
    let run = |out: &Path, jobs: &str| {
        let more = ["--suite", text(&suite), "--out", text(out), "--jobs", jobs];
        drive(&[policies.as_slice(), &more].concat())
    };
    let (one, two) = (folder.path().join("one"), folder.path().join("two"));
    let done = run(&one, "1");
    assert_eq!(done.status.code(), Some(0), "{}", said(&done.stderr));
    let table = said(&done.stdout);
    for policy in &policies[1..] {
        assert!(table.contains(policy), "{table}");
    }
    assert!(said(&done.stderr).contains("expert: 2 episodes"), "{}", said(&done.stderr));
    assert!(!done.stderr.contains(&0x1b), "no escape codes off a terminal");

    assert_eq!(run(&two, "2").status.code(), Some(0));
    let bytes = |out: &Path| fs::read(out.join("episodes.parquet")).unwrap();
    assert!(bytes(&one) == bytes(&two), "the same bytes for any number of jobs");
    assert_eq!(said(&run(&one, "2").stdout), table, "given again, nothing is driven");

    let again = Command::new(env!("CARGO_BIN_EXE_pmp-eval")).args(["table", text(&one)]).output();
    assert_eq!(said(&again.unwrap().stdout), table);

    let other = ["--policy", "expert", "--suite", text(&suite), "--out", text(&one)];
    let refused = drive(&other);
    assert_eq!(refused.status.code(), Some(1));
    assert!(said(&refused.stderr).contains("(policies)"), "{}", said(&refused.stderr));
}

#[test]
fn who_cannot_drive_is_an_error_that_says_who_can() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let refused = |more: &[&str]| {
        let done = drive(&[&["--out", text(&out)], more].concat());
        assert_eq!(done.status.code(), Some(1));
        assert!(!out.exists(), "nothing is made before it is known that it can be");
        said(&done.stderr)
    };
    assert!(refused(&["--policy", "recorded"]).contains("expert"));
    assert!(refused(&["--policy", "runs/none"]).contains("neither a run directory"));
    assert!(refused(&["--policy", "expert", "--suite", "deeptset"]).contains("deeptest"));
    assert!(refused(&["--policy", "expert", "expert"]).contains("two policies"));
}
