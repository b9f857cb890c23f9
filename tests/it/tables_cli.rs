//! `pmp-eval table` as a process: what it takes, prints and refuses.

use std::{
    fs,
    path::Path,
    process::{Command, Output},
};

use pmp::{closed_loop::results, dataset::episodes::write_episodes};

use crate::tables::driven;

fn pmp_eval(arguments: &[&str], directory: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pmp-eval"));
    command.arg("table").args(arguments).current_dir(directory).output().unwrap()
}

#[track_caller]
fn printed(arguments: &[&str], directory: &Path) -> String {
    let output = pmp_eval(arguments, directory);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[track_caller]
fn refused(arguments: &[&str], directory: &Path) -> String {
    let output = pmp_eval(arguments, directory);
    assert_eq!(output.status.code(), Some(1));
    assert!(output.stdout.is_empty());
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("hint: "), "{said}");
    said
}

/// One directory for each policy, of one town.
fn directories() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    for policy in ["good", "poor"] {
        let rows: Vec<_> = driven()
            .into_iter()
            .filter(|row| row.policy == policy && row.town == "Town03")
            .collect();
        results::write(&directory.path().join(policy).join(results::FILE), &rows).unwrap();
    }
    directory
}

#[test]
fn driven_episodes_of_several_directories_are_one_table() {
    let directory = directories();
    let at = directory.path();
    let text = printed(&["good", "poor", "--format", "csv"], at);
    assert!(
        text.contains("deeptest,good,driven,all,all,all,sr,%,94.44444444444444,17,18,"),
        "{text}"
    );
    assert!(
        text.contains("deeptest,poor,driven,all,all,all,sr,%,16.666666666666668,3,18,"),
        "{text}"
    );
    assert!(!text.contains(",paper,"));
    for (format, start) in [("md", "# Closed loop"), ("tex", "% `good` succeeds"), ("json", "{\n")]
    {
        let text = printed(&["good", "poor", "--format", format], at);
        assert!(text.starts_with(start), "{format}: {text}");
    }
    let text = printed(&["good", "--reference", "paper"], at);
    assert!(text.contains("| PMP (paper) | 100 (18/18) | 72 (13/18) |"), "{text}");
    let text = printed(&["good", "poor", "--group", "both=good,poor", "--format", "csv"], at);
    assert!(text.contains("deeptest,both,driven,all,all,all,sr,%,55.5"), "{text}");
    let said = refused(&["good", "--group", "both=good,other"], at);
    assert!(said.contains("no policy `other`") && said.contains("good"), "{said}");
}

#[test]
fn the_papers_table_is_printed_without_driving() {
    let here = Path::new(".");
    let text = printed(&["--reference", "paper"], here);
    assert!(text.contains("| **SR** % | CIL (paper) | 38 (7/18) | 16 (3/18) |"), "{text}");
    assert!(text.contains("188/216"), "{text}");
    let output = pmp_eval(&[], here);
    assert_eq!(output.status.code(), Some(2), "neither directories nor the paper");
}

#[test]
fn directories_of_something_else_are_refused_with_what_they_are() {
    let directory = directories();
    let at = directory.path();
    fs::create_dir(at.join("empty")).unwrap();
    let said = refused(&["good", "empty"], at);
    assert!(said.contains("neither report.json nor episodes.parquet"), "{said}");
    assert!(said.contains("pmp-eval offline") && said.contains("pmp-eval drive"), "{said}");
    fs::create_dir(at.join("offline")).unwrap();
    fs::write(at.join("offline/report.json"), "{}").unwrap();
    assert!(refused(&["good", "offline"], at).contains("an offline report and driven episodes"));
    assert!(refused(&["offline", "--reference", "paper"], at).contains("not for offline reports"));
    fs::write(at.join("poor/report.json"), "{}").unwrap();
    assert!(refused(&["poor"], at).contains("both report.json and episodes.parquet"));
    // A dataset has a file of the same name, of recorded drives.
    fs::create_dir(at.join("dataset")).unwrap();
    write_episodes(&at.join("dataset").join(results::FILE), &[]).unwrap();
    assert!(refused(&["dataset"], at).contains("no driven episodes"));
}
