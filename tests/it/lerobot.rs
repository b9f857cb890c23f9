//! `pmp-stats export --format lerobot`, opened by the packages that LeRobot reads with, and by
//! LeRobot itself where it is installed.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use pmp::frame::Frame;
use serde_json::{Value as Json, json};

use crate::{
    fixtures::DriveLog,
    ingest::{Said, frames, into, run, same_trees, text},
    writers::python,
};

fn stats(arguments: &[&str]) -> Said {
    run(env!("CARGO_BIN_EXE_pmp-stats"), arguments)
}

fn export(dataset: &Path, out: &Path) -> Said {
    stats(&["export", text(dataset), "--format", "lerobot", "--out", text(out)])
}

/// What the peers find; `None` where a package is absent.
pub(crate) fn peer(script: &str, packages: &str, arguments: &[&str]) -> Option<Json> {
    let has = Command::new(python()).args(["-c", &format!("import {packages}")]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: {} has not all of {packages}", python());
        return None;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers").join(script);
    let mut command = Command::new(python());
    command.env("HF_HUB_OFFLINE", "1").env("HF_HUB_DISABLE_TELEMETRY", "1");
    let output = command.arg(script).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(serde_json::from_slice(&output.stdout).unwrap())
}

/// A dataset of two drives, of which one has a gap, and what is exported of it.
struct Exported {
    folder: tempfile::TempDir,
    dataset: PathBuf,
    out: PathBuf,
    /// By stretches without a gap, those that train first.
    stretches: Vec<Vec<Frame>>,
}

fn exported() -> Exported {
    let folder = tempfile::tempdir().unwrap();
    let gap = DriveLog { seconds: 4.0, camera_gap_s: Some((1.5, 2.5)), ..DriveLog::default() };
    let logs = [
        gap.write(folder.path(), "gap.mcap"),
        DriveLog { seconds: 2.0, speed_mps: 7.0, ..DriveLog::default() }
            .write(folder.path(), "whole.mcap"),
    ];
    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&logs[0], &logs[1]]);
    assert_eq!(said.code, 3, "{}", said.err);
    let mut by_episode: BTreeMap<String, Vec<Frame>> = BTreeMap::new();
    for (episode, frame) in frames(&dataset) {
        by_episode.entry(episode).or_default().push(frame);
    }
    let manifest = pmp::dataset::manifest::Manifest::read(&dataset).unwrap();
    let mut ids: Vec<_> = manifest.logs.iter().map(|log| (log.split, &log.episode)).collect();
    ids.sort();
    let mut stretches = Vec::new();
    for (_, id) in ids {
        let cut = by_episode[id].chunk_by(|a, b| b.index == a.index + 1);
        stretches.extend(cut.map(<[Frame]>::to_vec));
    }
    let out = folder.path().join("lerobot");
    let said = export(&dataset, &out);
    assert_eq!((said.code, said.out.as_str()), (0, ""), "{}", said.err);
    let frames: usize = stretches.iter().map(Vec::len).sum();
    let wanted = format!("{frames} frames in 3 episodes, cut from 2 where frames are missing\n");
    assert!(said.err.ends_with(&wanted), "{}", said.err);
    assert_eq!(stretches.len(), 3);
    Exported { folder, dataset, out, stretches }
}

fn action(frame: &Frame) -> [f32; 3] {
    let action = &frame.action;
    [action.steer.unwrap(), action.throttle.unwrap(), action.brake.unwrap()]
}

#[track_caller]
fn near(what: &str, ours: &Json, theirs: &Json, tolerance: f64) {
    fn flat(value: &Json, numbers: &mut Vec<f64>) {
        match value {
            Json::Array(items) => items.iter().for_each(|item| flat(item, numbers)),
            number => numbers.push(number.as_f64().unwrap()),
        }
    }
    let (mut a, mut b) = (Vec::new(), Vec::new());
    flat(ours, &mut a);
    flat(theirs, &mut b);
    assert!(!a.is_empty() && a.len() == b.len(), "{what}: {} and {} numbers", a.len(), b.len());
    for (ours, theirs) in a.into_iter().zip(b) {
        assert!((ours - theirs).abs() <= tolerance, "{what}: {ours}, and numpy says {theirs}");
    }
}

#[test]
fn what_is_exported_has_the_documented_layout_and_our_numbers() {
    let Exported { folder: _folder, out, stretches, .. } = &exported();
    let packages = "numpy, PIL, pandas, pyarrow, datasets";
    let Some(found) = peer("lerobot_layout.py", packages, &["layout", text(out)]) else { return };
    let lengths: Vec<usize> = stretches.iter().map(Vec::len).collect();
    let total: usize = lengths.iter().sum();
    let info = &found["info"];
    assert_eq!(info["codebase_version"], "v3.0");
    assert_eq!((&info["fps"], &info["total_frames"]), (&json!(10), &json!(total)));
    assert_eq!((&info["total_episodes"], &info["total_tasks"]), (&json!(3), &json!(4)));
    assert_eq!(info["features"]["observation.images.front"]["shape"], json!([250, 600, 3]));
    assert_eq!(info["features"]["action"]["names"], json!(["steer", "throttle", "brake"]));
    assert_eq!(found["shapes"], json!([[250, 600, 3]]));
    assert_eq!(found["features"]["observation.images.front"], "Image");
    assert_eq!(found["tasks"]["follow the road"], 0);

    let rows = found["rows"].as_array().unwrap();
    let (mut index, mut from) = (0, 0);
    for (number, stretch) in stretches.iter().enumerate() {
        let episode = &found["episodes"][number];
        assert_eq!(episode["episode_index"], number);
        assert_eq!(
            (&episode["length"], &episode["pmp/first_frame"]),
            (&json!(stretch.len()), &json!(stretch[0].index))
        );
        assert_eq!(episode["dataset_from_index"], from);
        assert_eq!(episode["dataset_to_index"], from + stretch.len());
        assert_eq!(episode["tasks"], json!(["follow the road"]));
        from += stretch.len();
        for (place, frame) in stretch.iter().enumerate() {
            let row = &rows[index];
            assert_eq!((&row["index"], &row["frame_index"]), (&json!(index), &json!(place)));
            assert_eq!(row["episode_index"], number);
            near("timestamp", &row["timestamp"], &json!(place as f64 / 10.0), 1e-6);
            near("action", &json!(action(frame)), &row["action"], 0.0);
            near("state", &json!(frame.velocity_mps), &row["observation.state"], 0.0);
            near("route", &json!(frame.route.waypoints_m.to_vec()), &row["observation.route"], 0.0);
            index += 1;
        }
    }
    assert_eq!(rows.len(), index);

    for (column, peer) in [("action", "action"), ("observation.state", "state")] {
        for (name, theirs) in found[peer].as_object().unwrap() {
            near(name, &found["stats"][column][name], theirs, 1e-6);
        }
        assert_eq!(found["stats"][column]["count"], json!([total]));
    }
    for (name, theirs) in found["colours"].as_object().unwrap() {
        // Two decoders of JPEG may differ by a step or two.
        near(name, &found["stats"]["observation.images.front"][name], theirs, 2.5 / 255.0);
    }
    assert_eq!(found["first_stats"]["stats/action/count"], json!([lengths[0]]));
}

#[test]
fn lerobot_itself_reads_what_is_exported() {
    let Exported { folder: _folder, out, stretches, .. } = &exported();
    let packages = "lerobot.datasets.lerobot_dataset";
    let Some(found) = peer("lerobot_layout.py", packages, &["reader", text(out)]) else { return };
    let all: Vec<&Frame> = stretches.iter().flatten().collect();
    assert_eq!((&found["episodes"], &found["frames"]), (&json!(3), &json!(all.len())));
    assert_eq!(found["shapes"], json!([[3, 250, 600]]));
    let mut index = 0;
    for stretch in stretches {
        for (place, frame) in stretch.iter().enumerate() {
            assert_eq!(found["tasks"][index], "follow the road");
            near("state", &json!(frame.velocity_mps), &found["states"][index], 0.0);
            // Now and the next two, padded at the end of the stretch.
            for ahead in 0..3 {
                let is_padded = place + ahead >= stretch.len();
                assert_eq!(found["padded"][index][ahead], is_padded);
                let then = &stretch[(place + ahead).min(stretch.len() - 1)];
                near("action", &json!(action(then)), &found["actions"][index][ahead], 0.0);
            }
            index += 1;
        }
    }
}

#[test]
fn an_export_is_the_same_each_time_and_overwrites_nothing() {
    let Exported { folder, dataset, out, .. } = &exported();
    let again = folder.path().join("again");
    assert_eq!(export(dataset, &again).code, 0);
    same_trees(out, &again);
    let said = export(dataset, &again);
    assert_eq!(said.code, 1);
    assert!(said.err.contains("a folder that is not empty"), "{}", said.err);
    assert!(said.err.contains("\nhint: "), "{}", said.err);
    assert_eq!(stats(&["export", text(dataset), "--out", text(&again)]).code, 2);
}

#[test]
fn frames_without_an_action_are_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let without = DriveLog { seconds: 1.0, has_control: false, ..DriveLog::default() };
    let without = without.write(folder.path(), "without.mcap");
    let with = DriveLog { seconds: 1.0, ..DriveLog::default() }.write(folder.path(), "with.mcap");
    let [both, none] = ["both", "none"].map(|name| folder.path().join(name));
    into(&both, &[&without, &with]);
    into(&none, &[&without]);
    let said = export(&both, &folder.path().join("lerobot"));
    assert_eq!(said.code, 3, "{}", said.err);
    assert!(said.err.contains("11 frames in 1 episodes, cut from 2"), "{}", said.err);
    assert!(said.err.contains("left out: 11 frames whose action lacks a channel"), "{}", said.err);
    let out = folder.path().join("nothing");
    let said = export(&none, &out);
    assert_eq!(said.code, 1);
    assert!(said.err.contains("no frame has steering, throttle or brake"), "{}", said.err);
    assert!(!out.exists());
    let info = fs::read_to_string(folder.path().join("lerobot/meta/info.json")).unwrap();
    assert!(info.contains("\"total_frames\": 11"), "{info}");
}
