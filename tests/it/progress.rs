//! What an ingest tells while it runs, and what of it is seen.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{collections::BTreeMap, fs, process::Command, sync::Mutex};

use pmp::{
    dataset::{
        ingest::ingest,
        ingest_event::{Event, Step},
        logs::find_logs,
        manifest::IngestConfig,
    },
    log::profile::Profile,
    remote::location::Location,
};

use crate::ingest::{PROGRAM, into, text, three_logs};

/// Ingest what lies in a folder; what was told of each log by its number, and the frames made.
fn told(folder: &std::path::Path, out: &std::path::Path) -> (Vec<(String, u64, Vec<Step>)>, u64) {
    let place = Location::from(folder.as_os_str().to_os_string());
    let logs = find_logs(&[place], folder).unwrap();
    let config = IngestConfig::new(Profile::load("auto").unwrap(), 10.0).unwrap();
    let steps: Mutex<BTreeMap<usize, Vec<Step>>> = Mutex::default();
    let begun = Mutex::new(Vec::new());
    let on = |event: Event| match event {
        Event::Begun { logs } => {
            begun.lock().unwrap().extend(logs.iter().map(|log| (log.name(), log.bytes)));
        }
        Event::OfLog { number, step } => {
            steps.lock().unwrap().entry(number).or_default().push(step);
        }
        Event::Sending { .. } | Event::Sent { .. } => panic!("nothing is sent"),
    };
    let manifest = ingest(&logs, out, &config, None, &on).unwrap();
    let steps = steps.into_inner().unwrap();
    let begun = begun.into_inner().unwrap();
    assert_eq!(steps.keys().copied().collect::<Vec<_>>(), (0..begun.len()).collect::<Vec<_>>());
    let logs = begun.into_iter().zip(steps.into_values());
    (logs.map(|((name, bytes), steps)| (name, bytes, steps)).collect(), manifest.frames)
}

#[test]
fn events_are_complete_and_sum_up() {
    let (folder, logs) = three_logs(20.0);
    fs::write(folder.path().join("broken.mcap"), b"no log").unwrap();
    fs::copy(&logs[0], folder.path().join("again.mcap")).unwrap();
    let out = folder.path().join("data");
    let (told_first, frames) = told(folder.path(), &out);
    assert_eq!(told_first.len(), 5);
    let mut sum = 0;
    for (name, bytes, steps) in &told_first {
        assert_eq!(steps.iter().filter(|step| **step == Step::Ended).count(), 1, "{name}");
        assert_eq!(steps.last(), Some(&Step::Ended), "{name}");
        let read: Vec<u64> = steps
            .iter()
            .filter_map(|step| if let Step::Read { bytes } = step { Some(*bytes) } else { None })
            .collect();
        let (mut opened, mut made) = (0, 0);
        for step in steps {
            match step {
                Step::Opened { ticks } => opened += ticks,
                Step::Made { ticks, frames } => {
                    made += ticks;
                    sum += frames;
                }
                _ => {}
            }
        }
        assert_eq!(opened, made, "{name}");
        match name.as_str() {
            "broken.mcap" => assert_eq!(steps[..], [Step::Started, Step::Ended]),
            // Of two with the same bytes the first by name is the log.
            "drive-0.mcap" => {
                assert_eq!(steps[..], [Step::Hashing, Step::Hashed, Step::Ended]);
            }
            _ => {
                assert_eq!(opened, 201, "{name}");
                assert_eq!(read.last(), Some(bytes), "{name}");
                assert!(read.is_sorted(), "{name}: {read:?}");
                assert!(steps.contains(&Step::Started));
            }
        }
    }
    assert_eq!((sum, frames), (603, 603));

    // Given again, there is nothing to make, and still every log ends.
    let (told_again, _) = told(folder.path(), &out);
    for (name, _, steps) in &told_again {
        assert_eq!(steps[..], [Step::Hashing, Step::Hashed, Step::Ended], "{name}");
    }
}

#[test]
fn nothing_is_drawn_where_stderr_is_no_terminal() {
    let (folder, _logs) = three_logs(1.0);
    let said = into(&folder.path().join("data"), &[folder.path()]);
    assert!(said.code == 0 && said.err.starts_with("drive-"), "{}", said.err);
    assert!(!said.err.contains(['\u{1b}', '\r']), "{:?}", said.err);
}

#[test]
fn a_terminal_shows_a_line_for_all_and_one_for_each_log_at_work() {
    let (folder, _logs) = three_logs(20.0);
    let command = format!("{PROGRAM} --jobs 2 --out {0}/data {0}", text(folder.path()));
    // Of util-linux: it runs a command on a pseudo terminal.
    let shown = Command::new("script").args(["-qec", &command, "/dev/null"]).output();
    let Some(shown) = shown.ok().filter(|output| output.status.success()) else {
        println!("skipped: no `script` of util-linux to make a terminal with");
        return;
    };
    let shown = String::from_utf8_lossy(&shown.stdout);
    for part in ["\u{1b}[", "0 of 3 logs, ", "reading", "making frames", "drive-2.mcap", " left"] {
        assert!(shown.contains(part), "no {part:?} in {shown}");
    }
    assert!(shown.trim_end().ends_with("3 episodes, 603 frames, 0.02 h"), "{shown}");
}
