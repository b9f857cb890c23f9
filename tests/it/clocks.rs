//! Clocks that differ, jump back or are not set: what an ingest makes of them, as a process.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use pmp::{
    dataset::{account::LeftOut, manifest::Manifest, open::Dataset},
    log::{
        clock::{Clock, instant_text, parse_clock, parse_offset},
        jumps::{self, Course, JUMP_NS},
    },
};
use proptest::prelude::*;

use crate::{
    fixtures::{DriveLog, Layout, Recorded, mcap_bytes, ns},
    ingest::{Said, frames, ingest, into, same_trees, text},
};

const CAMERA: &str = "/camera/front/image/compressed";

fn short() -> DriveLog {
    DriveLog { seconds: 2.0, ..DriveLog::default() }
}

/// A drive whose messages of one topic are stamped by a clock that is ahead by so much.
fn with_ahead(topic: &str, ahead_ns: i64) -> Vec<Recorded> {
    let right = short().messages().into_iter().filter(|message| message.topic != topic);
    let ahead = DriveLog { start_ns: short().start_ns + ahead_ns, ..short() };
    let moved = ahead.messages().into_iter().filter(|message| message.topic == topic);
    let logged = moved.map(|m| Recorded { log_time_ns: m.log_time_ns - ahead_ns, ..m });
    let mut messages: Vec<Recorded> = right.chain(logged).collect();
    messages.sort_by_key(|message| message.log_time_ns);
    messages
}

/// Ingest messages into a dataset beside them, with more arguments.
fn made(folder: &Path, name: &str, messages: &[Recorded], arguments: &[&str]) -> Said {
    let log = folder.join(format!("{name}.mcap"));
    fs::write(&log, mcap_bytes(messages, &Layout::default())).unwrap();
    let dataset = folder.join(name);
    ingest(&[&["--out", text(&dataset), text(&log)], arguments].concat())
}

/// Messages whose log times go on while their stamps begin anew at `start_ns`, and what follows.
fn again(first: Vec<Recorded>, start_ns: i64) -> Vec<Recorded> {
    let logged_ns = first.iter().map(|message| message.log_time_ns).max().unwrap() + ns(0.1);
    let second = DriveLog { start_ns, ..short() }.messages();
    let later = |m: Recorded| Recorded { log_time_ns: m.log_time_ns - start_ns + logged_ns, ..m };
    first.into_iter().chain(second.into_iter().map(later)).collect()
}

/// A log whose clock begins anew in the middle: two episodes.
#[cfg(feature = "checks")]
pub(crate) fn with_a_jump(folder: &Path, name: &str) -> std::path::PathBuf {
    let messages = again(short().messages(), short().start_ns - ns(30.0));
    let log = folder.join(name);
    fs::write(&log, mcap_bytes(&messages, &Layout::default())).unwrap();
    log
}

#[test]
fn an_offset_puts_a_clock_right_and_so_do_the_log_times() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let whole = made(folder, "whole", &short().messages(), &[]);
    assert_eq!(whole.code, 0, "{}", whole.err);
    let whole = frames(&folder.join("whole"));
    for (topic, ahead_ns) in
        [("/odom", ns(66.14)), ("/lidar", ns(-9.5)), (CAMERA, -short().start_ns)]
    {
        let messages = with_ahead(topic, ahead_ns);
        let name = topic.replace('/', "_");
        let refused = made(folder, &name, &messages, &[]);
        assert_eq!(refused.code, 1, "{topic}: {}", refused.err);
        assert!(refused.err.contains("do not overlap"), "{}", refused.err);
        let range = format!("{} ... ", instant_text(short().start_ns + ahead_ns));
        assert!(refused.err.contains(&range), "{range}: {}", refused.err);
        assert!(refused.err.contains("2023-11-14 22:13:20.000 UTC ... "), "{}", refused.err);
        for hint in ["--offset", "--clock"] {
            assert!(refused.err.contains(hint), "{}", refused.err);
        }
        let back = format!("{topic}={}ns", -ahead_ns);
        let by_offset = made(folder, &format!("{name}-offset"), &messages, &["--offset", &back]);
        assert_eq!(by_offset.code, 0, "{topic}: {}", by_offset.err);
        let by_log = format!("{topic}=log");
        let by_log = made(folder, &format!("{name}-log"), &messages, &["--clock", &by_log]);
        assert_eq!(by_log.code, 0, "{topic}: {}", by_log.err);
        let without_id = |name: String| {
            let all = frames(&folder.join(name)).into_iter();
            all.map(|(_, frame)| frame).collect::<Vec<_>>()
        };
        let expected: Vec<_> = whole.iter().map(|(_, frame)| frame.clone()).collect();
        assert!(without_id(format!("{name}-offset")) == expected, "{topic}");
        assert!(without_id(format!("{name}-log")) == expected, "{topic}");
    }
}

#[test]
fn a_clock_that_is_off_by_less_than_the_drive_is_told_with_the_offset_that_puts_it_right() {
    let folder = tempfile::tempdir().unwrap();
    let said = made(folder.path(), "a", &with_ahead("/odom", ns(1.5)), &[]);
    assert!(said.err.contains("`--offset /odom=-1.50s`"), "{}", said.err);
}

#[test]
fn a_profile_says_of_clocks_what_flags_say() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let messages = with_ahead("/odom", ns(66.14));
    let profile = folder.join("p.toml");
    let clocks = "[clock.topics]\n\"/camera/front/image/compressed\" = \"log\"\n[clock.offset_s]\n\
                  \"/odom\" = -66.14\n";
    fs::write(&profile, clocks).unwrap();
    let by_profile = made(folder, "a", &messages, &["--profile", text(&profile)]);
    assert_eq!(by_profile.code, 0, "{}", by_profile.err);
    let log = folder.join("a.mcap");
    let (clock, offset) = (format!("{CAMERA}=log"), "/odom=-66140ms");
    let flags = ["--clock", clock.as_str(), "--offset", offset];
    let b = folder.join("b");
    assert_eq!(ingest(&[&["--out", text(&b), text(&log)][..], &flags].concat()).code, 0);
    same_trees(&folder.join("a"), &b);
    let notes = &Manifest::read(&b).unwrap().logs[0].notes;
    assert!(notes.contains(&"clock: -66.14 s are added to the stamps of /odom".to_string()));
    assert!(notes.contains(&format!("clock: {CAMERA} is stamped by its log times")), "{notes:?}");

    let unknown = made(folder, "c", &short().messages(), &["--offset", "/gps=3s"]);
    assert!(unknown.err.contains("clock: /gps is named and not in this log"), "{}", unknown.err);
    for wrong in ["/gps=3", "/gps", "=3s", "/gps=s", "/gps=3h"] {
        let said = made(folder, "d", &short().messages(), &["--offset", wrong]);
        assert_eq!(said.code, 2, "{wrong}: {}", said.err);
    }
}

#[test]
fn flags_are_read_with_their_units() {
    for (offset, seconds) in
        [("/a=-66.14s", -66.14), ("/a=5ms", 5e-3), ("/a=5us", 5e-6), ("/a=1e3ns", 1e-6)]
    {
        let (topic, got) = parse_offset(offset).unwrap();
        assert!(topic == "/a" && (got - seconds).abs() < 1e-15, "{offset}: {got}");
    }
    assert_eq!(parse_clock("/a=publish"), Ok(("/a".to_string(), Clock::Publish)));
    assert!(parse_clock("/a=wall").is_err());
}

#[test]
fn instants_are_dates_where_they_can_be() {
    for (stamp_ns, told) in [
        (0, "0.000 s"),
        (-ns(2.5), "-2.500 s"),
        (951_782_400_250_000_000, "2000-02-29 00:00:00.250 UTC"),
        (1_767_225_599_999_000_000, "2025-12-31 23:59:59.999 UTC"),
        (4_107_542_400_000_000_000, "2100-03-01 00:00:00.000 UTC"),
    ] {
        assert_eq!(instant_text(stamp_ns), told);
    }
}

#[test]
fn times_beyond_all_calendars_are_no_overflow() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = short().messages();
    for message in messages.iter_mut().step_by(3) {
        message.log_time_ns = -1;
    }
    // Written as u64 that is later than any i64.
    let said = made(folder.path(), "a", &messages, &[]);
    assert_eq!(said.code, 0, "{}", said.err);
    let by_log = format!("{CAMERA}=log");
    let said = made(folder.path(), "b", &messages, &["--clock", &by_log]);
    assert!([0, 1, 3].contains(&said.code), "{}", said.err);
}

#[test]
fn log_times_that_stand_in_for_zero_stamps_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let log = DriveLog { has_header_stamps: false, ..short() }.messages();
    let said = made(folder.path(), "a", &log, &[]);
    let note = "note: clock: /odom has no header stamps, so log times stand in for them\n";
    assert!(said.code == 0 && said.err.contains(note), "{}", said.err);
}

#[test]
fn a_stamp_that_nobody_set_is_left_out_and_one_of_a_clock_that_begins_at_zero_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let unset = DriveLog { has_header_stamps: false, ..short() }.messages();
    let mut messages = short().messages();
    for (message, unset) in messages.iter_mut().zip(unset) {
        if message.topic == CAMERA
            && (ns(0.45)..ns(0.75)).contains(&(message.log_time_ns - short().start_ns))
        {
            *message = unset;
        }
    }
    let said = made(folder, "unset", &messages, &[]);
    assert_eq!(said.code, 3, "{}", said.err);
    let log = &Manifest::read(&folder.join("unset")).unwrap().logs[0];
    let camera = log.topics.iter().find(|account| account.topic == CAMERA).unwrap();
    assert_eq!((camera.read, camera.used, camera.left_out[&LeftOut::NoStamp]), (21, 18, 3));
    assert_eq!((log.frames, log.episodes.len()), (18, 1));

    let from_zero = DriveLog { start_ns: 0, ..short() }.messages();
    assert_eq!(made(folder, "zero", &from_zero, &[]).code, 0);
    assert_eq!(Manifest::read(&folder.join("zero")).unwrap().frames, 21);
}

#[test]
fn where_clocks_jump_back_a_new_episode_begins_with_what_was_told_before() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let first = short().messages();
    // A loop, a simulator that starts at zero, and three runs.
    let cases = [
        ("loop", again(first.clone(), short().start_ns), vec![short().start_ns; 2]),
        ("zero", again(first.clone(), 0), vec![short().start_ns, 0]),
        (
            "back",
            again(first.clone(), short().start_ns - ns(30.0)),
            vec![short().start_ns, short().start_ns - ns(30.0)],
        ),
        (
            "three",
            again(again(first, ns(100.0)), ns(99.0)),
            vec![short().start_ns, ns(100.0), ns(99.0)],
        ),
    ];
    for (name, mut messages, starts) in cases {
        // Mounts are told once.
        let mut mounts = 0;
        messages.retain(|message| {
            mounts += usize::from(message.topic == "/tf_static");
            message.topic != "/tf_static" || mounts == 1
        });
        let said = made(folder, name, &messages, &[]);
        assert_eq!(said.code, 0, "{name}: {}", said.err);
        assert!(said.err.contains(&format!("{CAMERA}: its clock jumped back")), "{}", said.err);
        assert!(said.err.contains(&format!("\n{} episodes, ", starts.len())), "{}", said.err);
        let dataset = folder.join(name);
        let manifest = Manifest::read(&dataset).unwrap();
        let log = &manifest.logs[0];
        let ids: Vec<&str> = log.episodes.iter().map(|episode| episode.id.as_str()).collect();
        let expected: Vec<String> = (1..=starts.len())
            .map(|n| if n == 1 { log.episode.clone() } else { format!("{}-{n}", log.episode) })
            .collect();
        assert_eq!(ids, expected, "{name}");
        let begun: Vec<i64> = log.episodes.iter().map(|episode| episode.start_ns).collect();
        assert_eq!(begun, starts, "{name}");
        assert_eq!(log.clock_jumps[CAMERA], starts.len() as u64 - 1);
        assert_eq!(log.frames, 21 * starts.len() as u64, "{name}");
        // The car is where the second run says, and every episode has its lidar.
        let frames = frames(&dataset);
        for (index, (episode, frame)) in frames.iter().enumerate() {
            assert_eq!(*episode, ids[index / 21], "{name}");
            let [x, y, _] = short().pose((index % 21) as f64 / 10.0);
            assert!((frame.position_m[0] - x).abs() + (frame.position_m[1] - y).abs() < 1e-9);
            assert!(frame.lidar.is_some() && frame.radar.is_some(), "{name}");
        }
        let inspected = ingest(&["inspect", text(&folder.join(format!("{name}.mcap")))]);
        let parts = format!("\nclocks jump back: the log has {} parts\n", starts.len());
        assert!(inspected.out.contains(&parts), "{}", inspected.out);
        let opened = Dataset::open(&dataset).unwrap();
        assert_eq!((opened.train.episodes, opened.val.episodes), (starts.len(), starts.len()));
        assert_eq!(opened.val.len(), 7 * starts.len());
    }
}

#[test]
fn topics_that_follow_a_jump_late_do_not_make_more_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = again(short().messages(), ns(50.0));
    let jump =
        messages.iter().position(|message| message.log_time_ns > short().start_ns + ns(2.05));
    let jump_ns = messages[jump.unwrap()].log_time_ns;
    // The odometry goes on for 0.2 s and is silent for 0.1 s, and the control jumps 0.3 s before
    // the camera does.
    messages.retain(|message| {
        let since_jump_ns = message.log_time_ns - jump_ns;
        match message.topic {
            "/odom" => !(0..ns(0.3)).contains(&since_jump_ns),
            "/control" => !(-ns(0.35)..-ns(0.01)).contains(&since_jump_ns),
            _ => true,
        }
    });
    for message in &mut messages {
        let since_jump_ns = message.log_time_ns - jump_ns;
        match message.topic {
            "/odom" if (-ns(0.2)..0).contains(&since_jump_ns) => message.log_time_ns += ns(0.2),
            "/control" if since_jump_ns >= -ns(0.01) => message.log_time_ns -= ns(0.3),
            _ => {}
        }
    }
    messages.sort_by_key(|message| message.log_time_ns);
    let said = made(folder.path(), "a", &messages, &[]);
    assert_eq!(said.code, 0, "{}", said.err);
    let log = &Manifest::read(&folder.path().join("a")).unwrap().logs[0];
    let frames: Vec<u64> = log.episodes.iter().map(|episode| episode.frames).collect();
    assert_eq!(frames, [21, 18]);
    assert_eq!(log.clock_jumps.values().sum::<u64>(), 6, "{:?}", log.clock_jumps);
}

#[test]
fn neither_strays_nor_shuffled_nor_late_written_messages_begin_an_episode() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let long = DriveLog { seconds: 8.0, ..short() };
    assert_eq!(made(folder, "whole", &long.messages(), &[]).code, 0);
    let whole: Vec<_> = frames(&folder.join("whole")).into_iter().map(|(_, frame)| frame).collect();
    let reversed: Vec<Recorded> = long.messages().into_iter().rev().collect();
    let mut halves = long.messages();
    let middle = halves.len() / 2;
    halves.rotate_left(middle);
    let mut shuffled = long.messages();
    // By a multiplier that has no factor in common with the count.
    let count = shuffled.len();
    shuffled = (0..count).map(|i| shuffled[i * 7919 % count].clone()).collect();
    for (name, messages) in [("reversed", reversed), ("halves", halves), ("shuffled", shuffled)] {
        let said = made(folder, name, &messages, &[]);
        assert_eq!(said.code, 0, "{name}: {}", said.err);
        let log = &Manifest::read(&folder.join(name)).unwrap().logs[0];
        assert_eq!((log.episodes.len(), log.clock_jumps.len()), (1, 0), "{name}");
        let frames: Vec<_> = frames(&folder.join(name)).into_iter().map(|(_, f)| f).collect();
        assert!(frames == whole, "{name}");
    }
    let mut stray = long.messages();
    for second in [1.5, 6.0] {
        let other = DriveLog { start_ns: long.start_ns - ns(second), ..short() }.messages();
        let at = stray.len() / 2;
        let log_time_ns = stray[at].log_time_ns;
        let old = other.into_iter().find(|message| message.topic == "/odom").unwrap();
        stray.insert(at, Recorded { log_time_ns, ..old });
    }
    assert_eq!(made(folder, "stray", &stray, &[]).code, 0);
    assert_eq!(Manifest::read(&folder.join("stray")).unwrap().logs[0].episodes.len(), 1);
}

#[test]
fn all_episodes_of_a_log_are_on_one_side_and_a_part_without_frames_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for start_s in 0..8 {
        let name = format!("log-{start_s}");
        let messages = again(short().messages(), ns(100.0 + f64::from(start_s)));
        made(folder, &name, &messages, &[]);
        let log = &Manifest::read(&folder.join(&name)).unwrap().logs[0];
        let side = format!("frames/split={}/", log.split.name());
        assert_eq!((log.episodes.len(), log.shards.len()), (2, 2));
        assert!(log.shards.iter().all(|shard| shard.path.starts_with(&side)));
    }
    let mut blind = again(short().messages(), ns(100.0));
    let jump_ns = short().start_ns + ns(2.05);
    blind.retain(|message| message.topic != CAMERA || message.log_time_ns < jump_ns);
    let said = made(folder, "blind", &blind, &[]);
    assert_eq!(said.code, 3, "{}", said.err);
    assert!(said.err.contains("left out: part 2 of 2 of the log: no camera"), "{}", said.err);
    let log = &Manifest::read(&folder.join("blind")).unwrap().logs[0];
    assert_eq!(log.episodes.len(), 1);
    let odometry = log.topics.iter().find(|account| account.topic == "/odom").unwrap();
    assert_eq!((odometry.used, odometry.left_out[&LeftOut::NoFrame]), (101, 101));
    assert_eq!(log.topics.iter().map(|account| account.read).sum::<u64>(), log.messages);
    assert_eq!(into(&folder.join("blind"), &[&folder.join("blind.mcap")]).code, 3);
}

#[test]
fn what_is_left_out_of_a_later_episode_is_told_from_its_own_start() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = again(short().messages(), ns(100.0));
    let jump_ns = short().start_ns + ns(2.1);
    messages.retain(|message| {
        let since_jump_ns = message.log_time_ns - jump_ns;
        message.topic != CAMERA || !(ns(0.75)..ns(1.25)).contains(&since_jump_ns)
    });
    let said = made(folder.path(), "a", &messages, &[]);
    assert_eq!(said.code, 3, "{}", said.err);
    let log = &Manifest::read(&folder.path().join("a")).unwrap().logs[0];
    let id = &log.episodes[1].id;
    let line = format!("  5 ticks left out: image_gap, first 0.8 s after the start of {id}\n");
    assert!(said.err.contains(&line), "{}", said.err);
    assert_eq!((log.drops.total(), log.episodes[0].drops.total()), (5, 0));
}

/// Where a topic with these stamps, logged at these times, jumps back: the index of the message.
fn jumps_of(messages: &[(i64, i64)]) -> Vec<usize> {
    let mut course = Course::default();
    for (index, (stamp_ns, log_time_ns)) in messages.iter().enumerate() {
        let mark = course.steps_back(*stamp_ns).then_some(index);
        course.take(*stamp_ns, *log_time_ns, mark);
    }
    let courses = [("/a".to_string(), &course)].into();
    let found = jumps::beginnings(&courses, &|_, mark| Some(messages[mark.max(1) - 1].0));
    assert!(found.iter().all(|beginning| beginning.jumped["/a"] == beginning.mark));
    found.into_iter().map(|beginning| beginning.mark).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn every_restart_of_a_clock_is_found_and_no_jitter_is_taken_for_one(
        runs in prop::collection::vec((10_usize..60, 0_i64..1000), 1..6),
        jitter in prop::collection::vec(-45_i64..45, 300),
    ) {
        let mut messages = Vec::new();
        let mut expected = Vec::new();
        for (index, (count, start_s)) in runs.iter().enumerate() {
            let begins_before = messages.last().is_some_and(|(last_ns, _): &(i64, i64)| {
                start_s * ns(1.0) < last_ns - JUMP_NS - ns(0.05)
            });
            if index > 0 && !begins_before {
                continue;
            }
            if index > 0 {
                expected.push(messages.len());
            }
            for i in 0..*count {
                let jitter_ns = jitter[messages.len() % 300] * 1_000_000;
                let stamp_ns = start_s * ns(1.0) + i as i64 * ns(0.1) + jitter_ns;
                messages.push((stamp_ns, messages.len() as i64 * ns(0.1)));
            }
        }
        prop_assert_eq!(jumps_of(&messages), expected);
    }
}
