//! Several processes that share the logs of one dataset.
#![allow(clippy::unwrap_used)]

use std::{
    fs,
    path::Path,
    process::{Child, Command as Process, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::ingest::{PROGRAM, ingest, names, same_trees, text, three_logs};

fn start(dataset: &Path, logs: &Path, more: &[&str]) -> Child {
    Process::new(PROGRAM)
        .args(["--jobs", "1", "--out", text(dataset), text(logs)])
        .args(more)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

fn wait_until(child: &mut Child, moment: impl Fn() -> bool) {
    let begun = Instant::now();
    while !moment() {
        assert!(child.try_wait().unwrap().is_none(), "it ended too early");
        assert!(begun.elapsed() < Duration::from_secs(60), "nothing is being written");
        thread::sleep(Duration::from_millis(2));
    }
}

fn is_writing(dataset: &Path) -> bool {
    names(dataset).iter().any(|name| name.ends_with(".parquet.unfinished"))
}

#[test]
fn shares_side_by_side_and_a_last_run_write_the_bytes_of_one_process() {
    let (folder, logs) = three_logs(4.0);
    // The same bytes in both shares.
    let copies = folder.path().join("a");
    fs::create_dir(&copies).unwrap();
    fs::copy(&logs[0], copies.join("copy.mcap")).unwrap();
    let (one, shared) = (folder.path().join("one"), folder.path().join("shared"));
    let whole = ingest(&["--out", text(&one), text(folder.path())]);
    assert_eq!(whole.code, 3, "{}", whole.err);

    let shares = ["1/2", "2/2"].map(|i| start(&shared, folder.path(), &["--shard", i]));
    for child in shares {
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert!(said.contains("2 episodes, 82 frames"), "{said}");
    }
    assert!(!shared.join("manifest.json").exists());
    assert_eq!(names(&shared).iter().filter(|name| name.starts_with("logs/")).count(), 3);
    let last = ingest(&["--out", text(&shared), text(folder.path())]);
    assert_eq!((last.code, last.err), (3, whole.err));
    same_trees(&one, &shared);
}

#[test]
fn a_process_does_not_disturb_what_another_is_writing() {
    let (folder, _logs) = three_logs(30.0);
    let dataset = folder.path().join("data");
    let mut share = start(&dataset, folder.path(), &["--shard", "1/2"]);
    wait_until(&mut share, || is_writing(&dataset));
    let alone = ingest(&["--out", text(&dataset), text(folder.path())]);
    let expected = "error: another pmp-ingest is at work in this dataset";
    assert!(alone.code == 1 && alone.err.starts_with(expected), "{}", alone.err);
    assert!(is_writing(&dataset));
    assert_eq!(ingest(&["--out", text(&dataset), text(folder.path()), "--shard", "2/2"]).code, 0);
    assert_eq!(share.wait().unwrap().code(), Some(0));

    // A share that is killed lets go, and the last run does its work.
    let other = folder.path().join("other");
    let mut share = start(&other, folder.path(), &["--shard", "1/2"]);
    wait_until(&mut share, || is_writing(&other));
    share.kill().unwrap();
    share.wait().unwrap();
    for dataset in [&dataset, &other] {
        assert_eq!(ingest(&["--out", text(dataset), text(folder.path())]).code, 0);
    }
    same_trees(&dataset, &other);
}

#[test]
fn a_share_is_i_of_n_and_may_have_nothing_to_do() {
    let (folder, _logs) = three_logs(0.5);
    let dataset = folder.path().join("data");
    for wrong in ["0/2", "3/2", "1", "a/b", "1/0"] {
        let said = ingest(&["--out", text(&dataset), text(folder.path()), "--shard", wrong]);
        assert_eq!(said.code, 2, "{wrong}");
    }
    let said = ingest(&["--out", text(&dataset), text(folder.path()), "--shard", "5/5"]);
    assert_eq!(said.code, 0, "{}", said.err);
    let said =
        ingest(&["--out", text(&dataset), text(folder.path()), "--shard", "1/5", "--rate", "5"]);
    assert!(said.err.contains("made with another configuration"), "{}", said.err);
}
