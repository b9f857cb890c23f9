//! `pmp-ingest` as a process, on made logs: exit codes, wording, bytes, and what a kill leaves.
#![allow(clippy::unwrap_used)]

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    process::{Command as Process, Output, Stdio},
    thread,
    time::{Duration, Instant},
};

use assert_cmd::Command;
use mcap::Compression;
use pmp::{
    dataset::{
        manifest::{LogRecord, Manifest},
        shard::ShardReader,
    },
    drops::Reason,
    frame::{Command as Heading, Frame, RouteSource},
};

use crate::fixtures::{DriveLog, Layout, mcap_bytes};

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_pmp-ingest");

/// What a run said and how it ended.
pub(crate) struct Said {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

pub(crate) fn ingest(arguments: &[&str]) -> Said {
    run(PROGRAM, arguments)
}

/// What a program says.
pub(crate) fn run(program: &str, arguments: &[&str]) -> Said {
    let Output { status, stdout, stderr } = Command::new(program).args(arguments).output().unwrap();
    Said {
        code: status.code().unwrap(),
        out: String::from_utf8(stdout).unwrap(),
        err: String::from_utf8(stderr).unwrap(),
    }
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Ingest some logs into a folder.
pub(crate) fn into(dataset: &Path, logs: &[&Path]) -> Said {
    let logs = logs.iter().map(|log| text(log));
    ingest(&["--out", text(dataset)].into_iter().chain(logs).collect::<Vec<_>>())
}

/// All frames of a dataset, by episode and index.
pub(crate) fn frames(dataset: &Path) -> Vec<(String, Frame)> {
    let manifest = Manifest::read(dataset).unwrap();
    let mut frames = Vec::new();
    for shard in manifest.logs.iter().flat_map(|log| &log.shards) {
        let reader = ShardReader::open(dataset, shard).unwrap();
        for group in 0..reader.ticks().unwrap().len() {
            frames.extend(reader.frames(group).unwrap());
        }
    }
    frames
}

/// Every file below a folder with its bytes.
pub(crate) fn tree(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn walk(folder: &Path, root: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => walk(&path, root, found),
                false => {
                    let name = path.strip_prefix(root).unwrap().to_path_buf();
                    found.insert(name, fs::read(&path).unwrap());
                }
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(folder, folder, &mut found);
    found
}

#[track_caller]
pub(crate) fn same_trees(a: &Path, b: &Path) {
    let (a, b) = (tree(a), tree(b));
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, bytes) in a {
        assert!(b[&name] == bytes, "{} differs", name.display());
    }
}

fn short() -> DriveLog {
    DriveLog { seconds: 1.0, ..DriveLog::default() }
}

/// Three logs of different drives in a folder, and the folder for what comes of them.
pub(crate) fn three_logs(seconds: f64) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().unwrap();
    let logs = (0..3)
        .map(|i| {
            let log = DriveLog { seconds, speed_mps: 4.0 + f64::from(i), ..DriveLog::default() };
            log.write(folder.path(), &format!("drive-{i}.mcap"))
        })
        .collect();
    (folder, logs)
}

#[test]
fn a_made_drive_gives_the_frames_that_its_closed_form_says() {
    let folder = tempfile::tempdir().unwrap();
    let conditions = [("town", "Town07"), ("weather", "rainy")];
    let conditions = conditions.map(|(key, value)| (key.to_string(), value.to_string()));
    let layout = Layout { conditions: BTreeMap::from(conditions), ..Layout::default() };
    let drive = DriveLog { layout, ..DriveLog::default() };
    let log = drive.write(folder.path(), "drive.mcap");
    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&log]);
    assert_eq!((said.code, said.out.as_str()), (0, ""), "{}", said.err);
    assert!(said.err.ends_with("1 episode, 51 frames, 0.00 h\n"), "{}", said.err);
    assert!(said.err.starts_with("drive.mcap: 51 frames (21 with 3 s of future), 5.0 s, 25 m, "));

    let frames = frames(&dataset);
    assert_eq!(frames.len(), 51);
    for (i, (episode, frame)) in frames.iter().enumerate() {
        let t = i as f64 / 10.0;
        let [x, y, yaw] = drive.pose(t);
        assert!(episode.starts_with("ep-") && episode.len() == 19, "{episode}");
        assert_eq!(
            (frame.index as usize, frame.stamp_ns),
            (i, drive.start_ns + i as i64 * 100_000_000)
        );
        assert!((frame.yaw_rad - yaw).abs() < 1e-9);
        assert!((frame.position_m[0] - x).abs() < 1e-9 && (frame.position_m[1] - y).abs() < 1e-9);
        assert_eq!(frame.velocity_mps, [5.0, 0.0]);
        let action = (frame.action.steer, frame.action.throttle, frame.action.brake);
        assert_eq!(action, (Some(-0.5), Some(0.25), Some(0.125)));
        assert_eq!((frame.route.source, frame.command), (RouteSource::Driven, Heading::Follow));
        // The fixture's picture is scaled by ten: focal length 300, principal point (300, 125).
        let lidar = frame.lidar.as_ref().unwrap();
        assert_eq!(lidar.pixel, [125 * 600 + 239, 125 * 600 + 299, 126 * 600 + 239]);
        let z: Vec<f32> = lidar.z.iter().map(|z| z.to_f32()).collect();
        assert_eq!(z, [10.0, 20.0, 10.0]);
        assert!(
            (lidar.x[0].to_f32() + 2.01).abs() < 2e-3 && (lidar.y[2].to_f32() - 0.06).abs() < 1e-3
        );
        let radar = frame.radar.as_ref().unwrap();
        assert_eq!(
            (radar.pixel.as_slice(), radar.speed_mps.as_ref().unwrap()[0].to_f32()),
            ([121 * 600 + 376].as_slice(), -3.5)
        );
        assert_eq!((frame.skew.image_ns, frame.skew.control_ns), (0, Some(0)));
        assert_eq!(frame.conditions.town.as_deref(), Some("Town07"));
        assert_eq!(
            (frame.conditions.weather.as_deref(), &frame.conditions.traffic),
            (Some("rainy"), &None)
        );
        assert!(frame.image.starts_with(&[0xff, 0xd8]));
        assert_eq!(usize::from(frame.future.len), 30.min(50 - i));
    }
}

#[test]
fn the_frames_do_not_depend_on_how_the_file_is_laid_out() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, drive: DriveLog, code: i32| -> Vec<Frame> {
        let log = drive.write(folder.path(), &format!("{name}.mcap"));
        let dataset = folder.path().join(name);
        let said = into(&dataset, &[&log]);
        assert_eq!(said.code, code, "{name}: {}", said.err);
        frames(&dataset).into_iter().map(|(_, frame)| frame).collect()
    };
    let plain = made("plain", short(), 0);
    assert_eq!(plain.len(), 11);
    let with = |layout: Layout| DriveLog { layout, ..short() };
    let zstd = Layout { compression: Some(Compression::Zstd), ..Layout::default() };
    assert!(made("zstd", with(zstd), 0) == plain);
    let lz4 = Layout { compression: Some(Compression::Lz4), ..Layout::default() };
    assert!(made("lz4", with(lz4), 0) == plain);
    let unchunked = Layout { is_chunked: false, ..Layout::default() };
    assert!(made("unchunked", with(unchunked), 0) == plain);
    assert!(made("big-endian", DriveLog { is_big_endian: true, ..short() }, 0) == plain);
    assert!(made("late", DriveLog { is_out_of_order: true, ..short() }, 0) == plain);
    assert!(made("log-times", DriveLog { has_header_stamps: false, ..short() }, 0) == plain);
}

#[test]
fn messages_that_come_late_are_put_in_order_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let log = DriveLog { is_out_of_order: true, ..short() }.write(folder.path(), "late.mcap");
    let said = into(&folder.path().join("data"), &[&log]);
    assert!(
        said.err.contains("\n  /odom: 25 messages came late and were put in order\n"),
        "{}",
        said.err
    );
}

#[test]
fn gaps_and_damaged_pictures_are_left_out_counted_and_end_in_3() {
    let folder = tempfile::tempdir().unwrap();
    let drive = DriveLog {
        seconds: 3.0,
        camera_gap_s: Some((0.5, 1.0)),
        ego_gap_s: Some((1.52, 1.88)),
        bad_pictures: vec![25],
        ..DriveLog::default()
    };
    let log = drive.write(folder.path(), "gaps.mcap");
    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&log]);
    assert_eq!(said.code, 3, "{}", said.err);
    let lines = [
        "  5 ticks left out: image_gap, first 0.5 s after the start\n",
        "  1 ticks left out: image_damaged, first 2.5 s after the start (neither JPEG, PNG nor WebP: \
         it begins with [6e, 6f, 20, 70])\n",
        "  3 ticks left out: ego_gap, first 1.6 s after the start\n",
    ];
    for line in lines {
        assert!(said.err.contains(line), "no {line:?} in {}", said.err);
    }
    let manifest = Manifest::read(&dataset).unwrap();
    let log = &manifest.logs[0];
    assert_eq!((log.frames, log.drops.count(Reason::ImageGap)), (22, 5));
    let indices: Vec<u32> = frames(&dataset).iter().map(|(_, frame)| frame.index).collect();
    let expected: Vec<u32> =
        (0..=30).filter(|i| ![5, 6, 7, 8, 9, 16, 17, 18, 25].contains(i)).collect();
    assert_eq!(indices, expected);
}

#[test]
fn one_thread_and_two_write_the_same_bytes() {
    let (folder, logs) = three_logs(8.0);
    for (name, logs) in [("one", &logs[..1]), ("three", &logs[..])] {
        let datasets = ["1", "2"].map(|jobs| {
            let dataset = folder.path().join(format!("{name}-{jobs}"));
            let logs = logs.iter().map(|log| text(log));
            let arguments = ["--out", text(&dataset), "--jobs", jobs].into_iter().chain(logs);
            assert_eq!(ingest(&arguments.collect::<Vec<_>>()).code, 0);
            dataset
        });
        same_trees(&datasets[0], &datasets[1]);
    }
}

#[test]
fn a_killed_run_given_again_ends_with_the_bytes_of_an_uninterrupted_one() {
    let (folder, logs) = three_logs(30.0);
    let logs: Vec<&Path> = logs.iter().map(PathBuf::as_path).collect();
    let (whole, killed) = (folder.path().join("whole"), folder.path().join("killed"));
    assert_eq!(into(&whole, &logs).code, 0);

    let is_amid_second = |tree: &[String]| {
        let records = tree.iter().filter(|name| name.starts_with("logs/")).count();
        records >= 1 && tree.iter().any(|name| name.ends_with(".parquet.unfinished"))
    };
    let is_amid_first = |tree: &[String]| tree.iter().any(|n| n.ends_with(".parquet.unfinished"));
    for moment in [&is_amid_first as &dyn Fn(&[String]) -> bool, &is_amid_second] {
        let mut child = Process::new(PROGRAM)
            .args(["--jobs", "1", "--out", text(&killed)])
            .args(&logs)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begun = Instant::now();
        while !moment(&names(&killed)) {
            assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
            assert!(begun.elapsed() < Duration::from_secs(60), "nothing is being written");
            thread::sleep(Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(!killed.join("manifest.json").exists());
        let error = Manifest::read(&killed).unwrap_err();
        assert!(error.to_string().starts_with("an unfinished dataset"), "{error}");
    }
    assert_eq!(into(&killed, &logs).code, 0);
    same_trees(&whole, &killed);
}

/// Names of the files below a folder that may change while it is read.
pub(crate) fn names(folder: &Path) -> Vec<String> {
    fn walk(folder: &Path, root: &Path, found: &mut Vec<String>) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            found.push(path.strip_prefix(root).unwrap().to_string_lossy().into_owned());
            walk(&path, root, found);
        }
    }
    let mut found = Vec::new();
    walk(folder, folder, &mut found);
    found.retain(|name| name.contains('.'));
    found
}

#[test]
fn the_same_command_on_a_finished_dataset_changes_nothing_and_ends_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let whole = short().write(folder.path(), "whole.mcap");
    let gap = DriveLog { camera_gap_s: Some((0.3, 0.6)), ..short() };
    let gap = gap.write(folder.path(), "gap.mcap");
    for (name, log, code) in [("a", &whole, 0), ("b", &gap, 3)] {
        let dataset = folder.path().join(name);
        let first = into(&dataset, &[log]);
        let before = tree(&dataset);
        let second = into(&dataset, &[log]);
        assert_eq!((first.code, second.code), (code, code));
        assert_eq!(first.err, second.err);
        assert!(before == tree(&dataset));
    }
}

#[test]
fn a_dataset_is_never_changed_into_another() {
    let folder = tempfile::tempdir().unwrap();
    let log = short().write(folder.path(), "a.mcap");
    let other = DriveLog { speed_mps: 7.0, ..short() }.write(folder.path(), "b.mcap");
    let dataset = folder.path().join("data");
    assert_eq!(into(&dataset, &[&log]).code, 0);
    let before = tree(&dataset);
    let said = into(&dataset, &[&log, &other]);
    let expected =
        format!("error: a finished dataset, without {}: {}\n", other.display(), dataset.display());
    assert!(said.code == 1 && said.err.starts_with(&expected), "{}", said.err);
    let said = ingest(&["--out", text(&dataset), "--rate", "5", text(&log)]);
    let expected = format!(
        "error: a dataset made with another configuration: {}\n\n\
         hint: choose another --out: a dataset is never changed\n",
        dataset.display()
    );
    assert_eq!((said.code, said.err), (1, expected));
    assert!(before == tree(&dataset));

    let shard = before.keys().find(|name| name.starts_with("frames")).unwrap();
    let mut bytes = before[shard].clone();
    bytes[1000] ^= 1;
    fs::write(dataset.join(shard), bytes).unwrap();
    let said = into(&dataset, &[&log]);
    assert!(said.code == 1 && said.err.contains("is missing or damaged"), "{}", said.err);
}

#[test]
fn a_folder_of_something_else_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let log = short().write(folder.path(), "a.mcap");
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    fs::write(other.join("notes.txt"), "mine").unwrap();
    let said = into(&other, &[&log]);
    let expected = format!(
        "error: a folder that is not empty and no dataset: {}\n\nhint: choose another --out\n",
        other.display()
    );
    assert_eq!((said.code, said.err), (1, expected));
    assert_eq!(names(&other), ["notes.txt"]);
}

#[test]
fn logs_that_give_nothing_leave_nothing_that_looks_like_a_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let no_camera = DriveLog { camera_gap_s: Some((-1.0, 9.0)), ..short() };
    let no_transforms = DriveLog { has_transforms: false, ..short() };
    let all_bad = DriveLog { bad_pictures: (0..=10).collect(), ..short() };
    let cases = [
        (file("empty.mcap", b""), "the file is empty (byte 0) in "),
        (file("text.mcap", b"not a log"), "this is not an MCAP file"),
        (file("silent.mcap", &mcap_bytes(&[], &Layout::default())), "the log has no messages in "),
        (file("blind.mcap", &no_camera.bytes()), "no camera in "),
        (file("loose.mcap", &no_transforms.bytes()), "no transform from `lidar` to `camera`"),
        (file("bad.mcap", &all_bad.bytes()), "none of the 11 pictures of "),
    ];
    for (log, what) in cases {
        let dataset = folder.path().join("data");
        let said = into(&dataset, &[&log]);
        assert_eq!(said.code, 1, "{what}");
        assert!(said.err.starts_with(&format!("error: {what}")), "{}", said.err);
        assert!(said.err.contains("\n\nhint: "), "{}", said.err);
        assert!(!dataset.exists(), "{what}: {:?}", names(&dataset));
    }
}

#[test]
fn one_bad_log_among_several_costs_that_log_and_ends_in_3() {
    let (folder, mut logs) = three_logs(1.0);
    let bad = folder.path().join("bad.mcap");
    fs::write(&bad, b"not a log").unwrap();
    logs.push(bad);
    let dataset = folder.path().join("data");
    let said = ingest(&["--out", text(&dataset), text(folder.path())]);
    assert_eq!(said.code, 3, "{}", said.err);
    assert!(said.err.contains("\nbad.mcap: failed: this is not an MCAP file"), "{}", said.err);
    assert!(
        said.err.ends_with("3 episodes, 33 frames, 0.00 h; 1 log gave nothing\n"),
        "{}",
        said.err
    );
    let manifest = Manifest::read(&dataset).unwrap();
    assert_eq!((manifest.logs.len(), manifest.frames, manifest.failed.len()), (3, 33, 1));
    assert_eq!(frames(&dataset).len(), 33);
    let again = ingest(&["--out", text(&dataset), text(folder.path())]);
    assert_eq!(again.code, 3, "{}", again.err);
}

#[test]
fn a_log_that_fails_late_leaves_no_frames_beside_those_of_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let good = short().write(folder.path(), "good.mcap");
    let bad = DriveLog { bad_pictures: (0..=10).collect(), ..short() };
    let bad = bad.write(folder.path(), "bad.mcap");
    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&good, &bad]);
    assert_eq!(said.code, 3, "{}", said.err);
    let manifest = Manifest::read(&dataset).unwrap();
    let shards: Vec<&str> = manifest.logs[0].shards.iter().map(|s| s.path.as_str()).collect();
    let found: Vec<String> =
        names(&dataset).into_iter().filter(|name| name.starts_with("frames/")).collect();
    assert_eq!(found, shards);
}

#[test]
fn a_log_given_under_two_names_is_used_once_and_told() {
    let folder = tempfile::tempdir().unwrap();
    let log = short().write(folder.path(), "a.mcap");
    let copy = short().write(folder.path(), "b.mcap");
    let dataset = folder.path().join("data");
    let said = into(&dataset, &[&log, &copy]);
    assert_eq!(said.code, 3, "{}", said.err);
    assert!(said.err.contains("b.mcap: failed: the same bytes as a.mcap"), "{}", said.err);
    assert_eq!(Manifest::read(&dataset).unwrap().logs.len(), 1);
    // The same name twice is no second log.
    assert_eq!(into(&folder.path().join("once"), &[&log, &log]).code, 0);
}

#[test]
fn episodes_are_split_and_named_by_the_bytes_of_their_log() {
    let (folder, logs) = three_logs(0.5);
    let logs: Vec<&Path> = logs.iter().map(PathBuf::as_path).collect();
    let (all, alone) = (folder.path().join("all"), folder.path().join("alone"));
    assert_eq!(into(&all, &logs).code, 0);
    assert_eq!(into(&alone, &logs[1..2]).code, 0);
    let (all, alone) = (Manifest::read(&all).unwrap(), Manifest::read(&alone).unwrap());
    let record = all.logs.iter().find(|log| log.source_log == "drive-1.mcap").unwrap();
    assert_eq!(LogRecord { shards: alone.logs[0].shards.clone(), ..record.clone() }, alone.logs[0]);
    assert!(all.logs.is_sorted_by_key(|log| &log.episode));
    for log in &all.logs {
        assert_eq!(log.episode, format!("ep-{}", &log.source_sha256[..16]));
        let folder = format!("frames/split={}/", log.split.name());
        assert!(log.shards.iter().all(|shard| shard.path.starts_with(&folder)));
    }
}

#[test]
fn misuse_ends_in_2_and_bad_values_in_1_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let log = short().write(folder.path(), "a.mcap");
    let dataset = folder.path().join("data");
    let (log, dataset) = (text(&log), text(&dataset));
    for arguments in [&[][..], &["--out", dataset], &[log], &["--out", dataset, log, "--fast"]] {
        let said = ingest(arguments);
        assert_eq!(said.code, 2, "{arguments:?}");
        assert!(said.err.contains("Usage: pmp-ingest"), "{}", said.err);
    }
    let fails = |arguments: &[&str], expected: &str| {
        let said = ingest(&[&["--out", dataset], arguments].concat());
        assert_eq!((said.code, said.err.as_str()), (1, expected), "{arguments:?}");
    };
    fails(&[log, "--rate", "0.5"], "error: --rate: 0.5 is not between 1 and 50 Hz\n");
    fails(&[log, "--jobs", "0"], "error: --jobs: at least 1 is needed\n");
    fails(
        &["no-such.mcap"],
        "error: cannot find no-such.mcap: No such file or directory (os error 2)\n",
    );
    fails(
        &[log, "--profile", "waymo"],
        "error: --profile: `waymo` is not a profile\n\nhint: built-in profiles are auto, \
         carla-ros-bridge, nuscenes2mcap, kitti, autoware, pmp, comma; a profile of your own is a FILE.toml\n",
    );
    let empty = folder.path().join("empty");
    fs::create_dir(&empty).unwrap();
    fails(
        &[text(&empty)],
        "error: LOG: no .mcap file in the folders given\n\n\
         hint: give MCAP files, or folders that hold some\n",
    );
    assert!(!Path::new(dataset).exists());
}

#[test]
fn a_profile_names_topics_crops_and_requires() {
    let folder = tempfile::tempdir().unwrap();
    let log = short().write(folder.path(), "a.mcap");
    let with = |name: &str, profile: &str| {
        let path = folder.path().join(format!("{name}.toml"));
        fs::write(&path, profile).unwrap();
        let dataset = folder.path().join(name);
        (ingest(&["--out", text(&dataset), "--profile", text(&path), text(&log)]), dataset)
    };
    let crop =
        "[camera]\ncrop = { x = 15, y = 5, width = 30, height = 15 }\nwidth = 120\nheight = 60";
    let (said, dataset) = with("crop", &format!("{crop}\n[topics]\nignore = [\"/radar/front\"]"));
    assert_eq!(said.code, 0, "{}", said.err);
    let (_, frame) = &frames(&dataset)[0];
    // Four times as large after (15, 5) is cut off: (29.985, 12.515) falls on (59.94, 30.06).
    assert!(frame.lidar.as_ref().unwrap().pixel.contains(&(30 * 120 + 59)));
    assert_eq!(frame.radar, None);

    let (said, _) = with("unknown", "[topics]\nlidars = \"/lidar\"");
    assert!(said.code == 1 && said.err.contains("unknown field `lidars`"), "{}", said.err);
    let (said, _) = with("absent", "[topics]\nlidar = \"/velodyne\"");
    assert!(said.code == 1, "{}", said.err);
    assert!(said.err.contains("hint: topics that could be the lidar: /lidar\n"), "{}", said.err);
    let (said, _) = with("outside", "[camera]\ncrop = { x = 50, y = 0, width = 30, height = 15 }");
    assert!(said.code == 1 && said.err.contains("camera.crop: 30 x 15 at (50, 0)"), "{}", said.err);
}

#[test]
fn inspect_shows_topics_rates_and_what_they_would_be() {
    let folder = tempfile::tempdir().unwrap();
    let log = DriveLog::default().write(folder.path(), "a.mcap");
    let said = ingest(&["inspect", text(&log)]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let line = |topic: &str| {
        let line = said.out.lines().find(|line| line.split_whitespace().next() == Some(topic));
        line.unwrap().split_whitespace().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(line("/odom"), "/odom nav_msgs/msg/Odometry 251 50.0 ego pose");
    assert_eq!(line("/lidar"), "/lidar sensor_msgs/msg/PointCloud2 51 10.0 lidar");
    assert!(said.out.contains("\nno route: the driven path stands in for it\n"));
    assert!(
        said.out
            .contains("transforms: base_link -> camera, base_link -> lidar, base_link -> radar")
    );

    let said = ingest(&["inspect", "--json", text(&log)]);
    let report: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!((said.code, &report["mapping"]["lidar"]), (0, &serde_json::json!("/lidar")));
    assert_eq!(report["messages"], 251 + 51 * 4 + 101 + 1);
    assert_eq!(report["topics"].as_array().unwrap().len(), 7);
}

#[test]
fn inspect_of_what_is_no_log_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    fs::write(&path, b"").unwrap();
    let said = ingest(&["inspect", text(&path)]);
    assert_eq!((said.code, said.out.as_str()), (1, ""));
    assert!(said.err.starts_with("error: the file is empty"), "{}", said.err);
}
