//! `pmp-stats merge`, `drop` and `resplit` as processes, held against ingests of the same logs.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fs,
    os::unix::fs::MetadataExt as _,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use pmp::{
    dataset::{
        manifest::{Change, Manifest},
        open::Dataset,
        split::Split,
    },
    frame::Frame,
};

use crate::{
    clocks::with_a_jump,
    fixtures::DriveLog,
    ingest::{Said, frames, ingest, into, run, same_trees, text, tree},
};

fn stats(arguments: &[&str]) -> Said {
    run(env!("CARGO_BIN_EXE_pmp-stats"), arguments)
}

/// Short logs, each another drive; enough for both sides.
fn logs(folder: &Path) -> Vec<PathBuf> {
    let log = |i| {
        let mut log =
            DriveLog { seconds: 0.5, speed_mps: 3.0 + 0.01 * f64::from(i), ..DriveLog::default() };
        let town = if i % 3 == 0 { "Town02" } else { "Town01" };
        log.layout.conditions = BTreeMap::from([("town".to_string(), town.to_string())]);
        log.write(folder, &format!("log-{i:02}.mcap"))
    };
    (0..14).map(log).collect()
}

/// The logs, and datasets of the first eight, the others, and all.
#[derive(Clone)]
struct Sets {
    folder: Arc<tempfile::TempDir>,
    /// Keeps them there.
    _originals: Arc<tempfile::TempDir>,
    logs: Vec<PathBuf>,
    first: PathBuf,
    others: PathBuf,
    all: PathBuf,
}

fn made(out: &Path, logs: &[PathBuf]) {
    let logs: Vec<&Path> = logs.iter().map(PathBuf::as_path).collect();
    let said = into(out, &logs);
    assert_eq!(said.code, 0, "{}", said.err);
}

/// Made once, and only read; the folder for what comes of them is each test's own.
fn sets() -> Sets {
    static SETS: OnceLock<Sets> = OnceLock::new();
    let folder = Arc::new(tempfile::tempdir().unwrap());
    Sets { folder, ..SETS.get_or_init(make_sets).clone() }
}

fn make_sets() -> Sets {
    let folder = Arc::new(tempfile::tempdir().unwrap());
    let logs = logs(folder.path());
    let [first, others, all] = ["first", "others", "all"].map(|name| folder.path().join(name));
    made(&first, &logs[..8]);
    made(&others, &logs[8..]);
    made(&all, &logs);
    Sets { _originals: folder.clone(), folder, logs, first, others, all }
}

impl Sets {
    fn out(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

/// The frames and the table of episodes are those of an ingest, and so is all that the manifest
/// says of logs.
#[track_caller]
fn same_data(edited: &Path, ingested: &Path) {
    same_trees(&edited.join("frames"), &ingested.join("frames"));
    let table = |dataset: &Path| fs::read(dataset.join("episodes.parquet")).unwrap();
    assert!(table(edited) == table(ingested));
    let (edited, ingested) = (Manifest::read(edited).unwrap(), Manifest::read(ingested).unwrap());
    assert_eq!(
        (edited.logs, edited.config, edited.frames),
        (ingested.logs, ingested.config, ingested.frames)
    );
}

#[track_caller]
fn done(arguments: &[&str], out: &Path) -> Manifest {
    let arguments = arguments.iter().copied().chain(["--out", text(out)]);
    let said = stats(&arguments.collect::<Vec<_>>());
    assert_eq!(said.code, 0, "{}", said.err);
    let manifest = Manifest::read(out).unwrap();
    assert_eq!(said.out, format!("{}\n", manifest.identity()));
    manifest
}

#[track_caller]
fn refused(arguments: &[&str], out: &Path, what: &str, hint: &str) {
    let arguments = arguments.iter().copied().chain(["--out", text(out)]);
    let said = stats(&arguments.collect::<Vec<_>>());
    assert_eq!((said.code, said.out.as_str()), (1, ""), "{}", said.err);
    assert!(said.err.starts_with("error: ") && said.err.contains(what), "{}", said.err);
    assert!(said.err.split("\nhint: ").nth(1).is_some_and(|h| h.contains(hint)), "{}", said.err);
}

/// Levels and codes of what `pmp-stats check` finds, every picture and checksum looked at.
fn findings(dataset: &Path) -> Vec<String> {
    let said = stats(&["check", text(dataset), "--json", "--decode"]);
    let verdict: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    let findings = verdict["findings"].as_array().unwrap().iter();
    let words = findings.flat_map(|f| [&f["level"], &f["code"]]);
    words.map(|word| word.as_str().unwrap().to_string()).collect()
}

#[test]
fn datasets_put_together_are_what_one_ingest_of_all_logs_makes() {
    let sets = sets();
    let (before, parts) = (tree(&sets.first), [text(&sets.first), text(&sets.others)]);
    let (out, other) = (sets.out("merged"), sets.out("turned"));
    let manifest = done(&["merge", parts[0], parts[1]], &out);
    same_data(&out, &sets.all);
    assert_eq!(manifest.identity(), Manifest::read(&sets.all).unwrap().identity());
    let edit = manifest.edit.unwrap();
    assert_eq!(edit.change, Change::Merge);
    let mut wanted = [&sets.first, &sets.others].map(|set| Manifest::read(set).unwrap().identity());
    wanted.sort();
    assert_eq!(edit.of.iter().map(|origin| origin.identity.clone()).collect::<Vec<_>>(), wanted);

    done(&["merge", parts[1], parts[0]], &other);
    same_trees(&out, &other);
    assert!(tree(&sets.first) == before, "the originals stay as they are");
    let opened = Dataset::open(&out).unwrap();
    assert_eq!((opened.train.len() + opened.val.len()) as u64, manifest.frames);
    assert_eq!(findings(&out), findings(&sets.all));

    // Made of what was made of others: all ancestors are named.
    let dropped = done(&["drop", text(&out), "--log", "log-03.mcap"], &sets.out("less"));
    assert_eq!(dropped.edit.unwrap().of[0].edit.as_deref(), Some(&edit));
}

#[test]
fn a_dataset_without_logs_is_what_an_ingest_of_the_others_makes() {
    let sets = sets();
    let (wanted, out) = (sets.out("wanted"), sets.out("less"));
    let left: Vec<PathBuf> = sets
        .logs
        .iter()
        .enumerate()
        .filter(|(i, _)| *i != 2 && *i != 9)
        .map(|(_, l)| l.clone())
        .collect();
    made(&wanted, &left);
    let all = Manifest::read(&sets.all).unwrap();
    let by_id = all.logs.iter().find(|log| log.source_log == "log-09.mcap").unwrap();
    let arguments = ["drop", text(&sets.all), "--log", "log-02.mcap", "--episode", &by_id.episode];
    let manifest = done(&arguments, &out);
    same_data(&out, &wanted);
    let Change::Drop { episodes } = manifest.edit.unwrap().change else { panic!() };
    assert_eq!(episodes.len(), 2);
    assert!(episodes.contains(&by_id.episode));
}

#[test]
fn of_a_log_with_several_episodes_the_sums_are_of_those_that_stay() {
    let folder = tempfile::tempdir().unwrap();
    let log = with_a_jump(folder.path(), "jump.mcap");
    let other = DriveLog { seconds: 1.0, ..DriveLog::default() }.write(folder.path(), "other.mcap");
    let dataset = folder.path().join("data");
    assert_eq!(into(&dataset, &[&log, &other]).code, 0);
    let before = Manifest::read(&dataset).unwrap();
    let of_log = before.logs.iter().find(|log| log.source_log == "jump.mcap").unwrap();
    assert!(of_log.episodes.len() > 1, "the fixture's clock jumps back");
    let kept = frames(&dataset);
    for gone in 0..of_log.episodes.len() {
        let id = of_log.episodes[gone].id.clone();
        let out = folder.path().join(format!("without-{gone}"));
        let manifest = done(&["drop", text(&dataset), "--episode", &id], &out);
        let log = manifest.logs.iter().find(|log| log.source_log == "jump.mcap").unwrap();
        let wanted: Vec<&(String, Frame)> = kept.iter().filter(|(name, _)| *name != id).collect();
        let found = frames(&out);
        assert!(found.iter().eq(wanted.iter().copied()));
        let of_log = found.iter().filter(|(name, _)| log.episodes.iter().any(|e| e.id == *name));
        let of_log: Vec<&Frame> = of_log.map(|(_, frame)| frame).collect();
        assert_eq!(log.frames as usize, of_log.len());
        assert_eq!(log.skews.image.unwrap().frames as usize, of_log.len());
        let full = of_log.iter().filter(|frame| frame.future.len == 30).count();
        assert_eq!(log.frames_with_full_future as usize, full);
        let camera = log.topics.iter().find(|t| t.used_as.as_deref() == Some("camera")).unwrap();
        assert_eq!(camera.used as usize, of_log.len());
        assert_eq!(camera.read, camera.used + camera.left_out.values().sum::<u64>());
        assert_eq!(log.start_ns, log.episodes[0].start_ns);
        assert!(!findings(&out).contains(&"error".to_string()), "the sums are right");
    }
}

#[test]
fn episodes_are_dealt_out_by_each_rule_and_back() {
    let sets = sets();
    let all = Manifest::read(&sets.all).unwrap();
    let judges = |manifest: &Manifest| -> Vec<String> {
        let judges = manifest.logs.iter().filter(|log| log.split == Split::Val);
        judges.map(|log| log.source_log.clone()).collect()
    };
    let data = text(&sets.all);
    let id = &all.logs[3].episode;
    let one = done(&["resplit", data, "--val", id], &sets.out("one"));
    assert_eq!(judges(&one), [all.logs[3].source_log.clone()]);
    assert_ne!(one.identity(), all.identity(), "other frames are trained on");
    let opened = Dataset::open(&sets.out("one")).unwrap();
    assert_eq!((opened.val.episodes, opened.val.len() as u64), (1, all.logs[3].frames));

    let named = ["resplit", data, "--val-log", "log-01.mcap", "log-11.mcap"];
    let mut named = judges(&done(&named, &sets.out("named")));
    named.sort();
    assert_eq!(named, ["log-01.mcap", "log-11.mcap"]);

    let town = done(&["resplit", data, "--val-town", "Town02"], &sets.out("town"));
    assert_eq!(judges(&town).len(), 5);
    assert!(town.logs.iter().all(|log| {
        (log.conditions.town.as_deref() == Some("Town02")) == (log.split == Split::Val)
    }));

    // Half of each town: 2 or 3 of 5, 4 or 5 of 9.
    let half = done(&["resplit", data, "--val-share", "0.5"], &sets.out("half"));
    let of_town = |name: &str| {
        let of = half.logs.iter().filter(|log| log.conditions.town.as_deref() == Some(name));
        of.filter(|log| log.split == Split::Val).count()
    };
    let counts = [of_town("Town01"), of_town("Town02")];
    assert!([[4, 3], [5, 2]].contains(&counts) && judges(&half).len() == 7, "{counts:?}");

    let back = done(&["resplit", text(&sets.out("half")), "--by-hash"], &sets.out("back"));
    same_data(&sets.out("back"), &sets.all);
    assert_eq!(back.identity(), all.identity());
    let Change::Resplit { rule, moved } = back.edit.unwrap().change else { panic!() };
    let differ = half.logs.iter().zip(&all.logs).filter(|(half, all)| half.split != all.split);
    assert_eq!((rule.as_str(), moved.len()), ("--by-hash", differ.count()));
}

#[test]
fn a_killed_edit_is_unfinished_and_the_same_command_finishes_it() {
    let sets = sets();
    let (whole, killed) = (sets.out("whole"), sets.out("killed"));
    let arguments = ["merge", text(&sets.first), text(&sets.others)];
    done(&arguments, &whole);
    done(&arguments, &killed);
    // As after a kill amid the second file.
    fs::remove_file(Manifest::path(&killed)).unwrap();
    let train = killed.join("frames/split=train/several-00000.parquet");
    fs::rename(&train, train.with_extension("parquet.unfinished")).unwrap();
    let left = killed.join("frames/split=val/ep-of-another-attempt.parquet");
    fs::write(left, "half").unwrap();
    let new = sets.out("new");
    let said = stats(&["export", text(&killed), "--format", "lerobot", "--out", text(&new)]);
    assert_eq!(said.code, 1);
    assert!(said.err.contains("an unfinished dataset"), "{}", said.err);
    assert!(said.err.contains("give the same `pmp-stats` command again"), "{}", said.err);
    // Neither another edit nor an ingest goes on with it.
    let other = ["drop", text(&sets.all), "--log", "log-03.mcap"];
    refused(&other, &killed, "will not overwrite", "the folder has a dataset with other settings");
    let said = ingest(&["--out", text(&killed), text(&sets.logs[0])]);
    assert_eq!(said.code, 1, "{}", said.err);
    done(&arguments, &killed);
    same_trees(&whole, &killed);
    // And once more, when it is finished.
    done(&arguments, &killed);
    same_trees(&whole, &killed);
}

#[test]
fn what_does_not_go_together_is_refused_with_what_to_do() {
    let sets = sets();
    let (first, out) = (text(&sets.first), sets.out("new"));
    refused(&["merge", first, text(&sets.all)], &out, "and 7 more is in", "pmp-stats drop");
    let refuse_set = |name: &str, arguments: &[&str], what: &str, hint: &str| {
        let set = sets.out(name);
        let all = [&["--out", text(&set), text(&sets.logs[9])], arguments].concat();
        assert_eq!(ingest(&all).code, 0);
        refused(&["merge", first, text(&set)], &out, what, hint);
        set
    };
    refuse_set("faster", &["--rate", "20"], "another rate (20 Hz, not 10 Hz)", "--rate");
    let profile = |name: &str, content: &str| {
        let path = sets.out(name);
        fs::write(&path, content).unwrap();
        path
    };
    let small = profile("small.toml", "[camera]\nwidth = 300\nheight = 124\n");
    let what = "another picture size (300 x 124, not 600 x 250 pixels)";
    refuse_set("small", &["--profile", text(&small)], what, "the profile of the other");
    let strict = profile("strict.toml", "[tolerance_ms]\ncamera = 20.0\n");
    let what = "another profile (profile.tolerance_ms.camera)";
    let set = refuse_set("strict", &["--profile", text(&strict)], what, "--mixed");
    assert!(!out.exists(), "what is refused leaves nothing behind");
    let mixed = done(&["merge", first, text(&set), "--mixed"], &out);
    assert_eq!(mixed.edit.unwrap().of.len(), 2);

    let data = text(&sets.all);
    let what = "a folder that is not empty";
    refused(&["drop", data, "--log", "log-00.mcap"], &sets.first, what, "another --out");
    let inside = sets.all.join("frames/split=train/new");
    refused(&["drop", data, "--log", "log-00.mcap"], &inside, "a folder in a dataset", "another");
    let new = sets.out("not-made");
    refused(&["drop", data, "--episode", "ep-0"], &new, "no episode `ep-0`", "episodes.parquet");
    refused(&["drop", data, "--log", "other.mcap"], &new, "no log `other.mcap`", "source_log");
    refused(&["resplit", data, "--val-share", "1.5"], &new, "1.5 is not between", "0.125");
    refused(&["resplit", data, "--val-share", "0.01"], &new, "none judges", "each side needs one");
    refused(&["resplit", data, "--val-town", "Town09"], &new, "no episode of `Town09`", "lists");
    for misused in [&["drop", data][..], &["resplit", data], &["merge"], &[]] {
        let arguments = misused.iter().copied().chain(["--out", text(&new)]);
        assert_eq!(stats(&arguments.collect::<Vec<_>>()).code, 2, "{misused:?}");
    }
    assert_eq!(stats(&[]).code, 2);
    assert!(!new.exists());
}

#[test]
fn a_file_that_is_not_what_its_manifest_says_is_named_and_nothing_looks_whole() {
    let sets = sets();
    let file = "frames/split=train/several-00000.parquet";
    let damaged = sets.out("all");
    for (name, bytes) in tree(&sets.all) {
        fs::create_dir_all(damaged.join(&name).parent().unwrap()).unwrap();
        fs::write(damaged.join(&name), bytes).unwrap();
    }
    let path = damaged.join(file);
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).unwrap();
    for (name, arguments) in [
        ("taken apart", &["drop", text(&damaged), "--log", "log-00.mcap"][..]),
        ("copied", &["resplit", text(&damaged), "--by-hash"]),
    ] {
        let out = sets.out(name);
        refused(arguments, &out, file, "copy the dataset again");
        assert!(!Manifest::path(&out).exists());
    }
}

#[test]
fn files_that_stay_as_they_are_can_be_links() {
    let sets = sets();
    let (copied, linked) = (sets.out("copied"), sets.out("linked"));
    let arguments = ["resplit", text(&sets.all), "--by-hash"];
    done(&arguments, &copied);
    done(&[&arguments[..], &["--link"]].concat(), &linked);
    same_trees(&copied, &linked);
    let file = "frames/split=train/several-00000.parquet";
    let inode = |dataset: &Path| fs::metadata(dataset.join(file)).unwrap().ino();
    assert_eq!(inode(&linked), inode(&sets.all));
    assert_ne!(inode(&copied), inode(&sets.all));
}
