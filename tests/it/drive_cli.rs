//! `pmp-eval drive` as a process: episodes, tables, going on, and what it refuses.

use std::{
    fs,
    path::Path,
    process::{Command, Output, Stdio},
    thread,
    time::Duration,
};

use pmp::closed_loop::results;

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
fn a_drive_that_was_killed_goes_on_and_ends_with_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let suite = folder.path().join("suite.toml");
    fs::write(&suite, SUITE.replace("episodes = 2", "episodes = 8")).unwrap();
    let (whole, killed) = (folder.path().join("whole"), folder.path().join("killed"));
    let arguments = |out: &Path| {
        let words =
            ["drive", "--policy", "expert", "--jobs", "1", "--suite", text(&suite), "--out"];
        words.iter().chain([&text(out)]).map(|word| word.to_string()).collect::<Vec<_>>()
    };
    let program = || Command::new(env!("CARGO_BIN_EXE_pmp-eval"));
    let done = program().args(arguments(&whole)).output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{}", said(&done.stderr));

    let mut child =
        program().args(arguments(&killed)).stderr(Stdio::null()).stdout(Stdio::null()).spawn();
    let child = child.as_mut().unwrap();
    let first = killed.join("episodes/expert/Town02-empty-00.json");
    while !first.exists() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!killed.join("episodes.parquet").exists(), "it was not killed in time");
    let done = program().args(arguments(&killed)).output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{}", said(&done.stderr));
    for file in ["episodes.parquet", "table.md", "drive.json"] {
        let bytes = |out: &Path| fs::read(out.join(file)).unwrap();
        assert!(bytes(&whole) == bytes(&killed), "{file}");
    }
}

/// Routes that were not made by pmp, on a map that was not.
#[test]
fn routes_of_the_carla_leaderboard_are_driven_on_carlas_own_map() {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/maps");
    let routes = shared.join("routes/routes_town02_tiny.xml");
    if !routes.exists() {
        println!("skipped: no {}", routes.display());
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let suite = folder.path().join("suite.toml");
    fs::copy(&routes, folder.path().join("routes.xml")).unwrap();
    let listed = SUITE.replace("skies =", "routes = \"routes.xml\"\nskies =");
    fs::write(&suite, listed.replace("1e9", "10.0").replace("grace_s = 4.0", "")).unwrap();
    let out = folder.path().join("out");
    let arguments =
        ["--policy", "expert", "stand-still", "--suite", text(&suite), "--out", text(&out)];
    let done = drive(&[arguments.as_slice(), &["--maps", text(&shared)]].concat());
    assert_eq!(done.status.code(), Some(0), "{}", said(&done.stderr));
    let rows = results::read(&out.join(results::FILE)).unwrap();
    let ends: Vec<_> = rows.iter().map(|row| (&*row.policy, &*row.reason)).collect();
    let expected = [("expert", "goal"), ("stand-still", "timeout")];
    assert_eq!(ends, [expected[0], expected[0], expected[1], expected[1]]);
    assert!(rows.iter().all(|row| (20.0..60.0).contains(&row.route_m)), "{rows:?}");
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
