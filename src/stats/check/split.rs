//! Whether what judges was never trained on, and is enough to judge by.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    dataset::{ego::wrap_angle, manifest::Manifest, split::Split},
    stats::check::{
        digest::{Digest, Waymark, sum},
        finding::{Check, Finding, Level, Needs, Place, percent},
        motion::TELLING_MPS,
        track::CONDITIONS,
    },
};

pub static IN_BOTH: Check = Check {
    code: "D01",
    name: "in-both-splits",
    level: Level::Error,
    needs: Needs::Records,
    what: "an episode id, or a log with the same SHA-256, is in both splits",
    why: "the policy is judged on what it learnt by heart",
    remedy: "ingest into an empty folder: the split goes by the log, so a log cannot be on both sides",
};

/// Waymarks of the judging drive that must lie on a training drive's track, and how many.
const SAME_SHARE: f64 = 0.8;
const ENOUGH_MARKS: usize = 15;

/// How near a place, speed and heading must be to be the same: half a lane, a slow change, 11 degrees.
const BESIDE_M: f64 = 1.5;
const ALONG_M: f64 = 15.0;
const SAME_SPEED_MPS: f64 = 0.75;
const SAME_YAW_RAD: f64 = 0.2;

pub static NEAR_DUPLICATE: Check = Check {
    code: "D02",
    name: "near-duplicate",
    level: Level::Error,
    needs: Needs::Columns,
    what: "80 % of a judging episode's waymarks (one a second, 15 and more, driving) lie within 1.5 m of one training episode's track, at its speed, and one time difference fits all",
    why: "the same drive, cut or converted twice: the policy is judged on what it learnt by heart",
    remedy: "drop one of the two",
};

pub static LOG_TWICE: Check = Check {
    code: "D03",
    name: "log-twice",
    level: Level::Warning,
    needs: Needs::Records,
    what: "two logs of one split have the same SHA-256",
    why: "the drive weighs twice",
    remedy: "remove the copy of the log and ingest again",
};

pub static SIDE_EMPTY: Check = Check {
    code: "D04",
    name: "split-empty",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "no frame trains, or none judges",
    why: "pmp-train then sets the smallest id apart, or cuts a lone drive in time: weak evidence",
    remedy: "ingest more logs; one in eight judges, by a hash",
};

/// Fewer judging frames than this (1 in 8 is meant), of datasets large enough to have them.
const VAL_SHARE: f64 = 0.05;

pub static VAL_SMALL: Check = Check {
    code: "D05",
    name: "val-small",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "less than 5 % of the frames judge",
    why: "differences between runs drown in the noise of a few minutes",
    remedy: "ingest more logs, or split anew",
};

/// A word of so many training frames should be judged, too.
const JUDGED_SHARE: f64 = 0.05;

pub static VAL_LACKS: Check = Check {
    code: "D06",
    name: "val-lacks-condition",
    level: Level::Note,
    needs: Needs::Columns,
    what: "a town, weather, illumination or traffic of more than 5 % of the training frames is never judged",
    why: "validation cannot tell how the policy does in it",
    remedy: "ingest more drives in it, or split anew",
};

pub static ALL: [&Check; 6] =
    [&IN_BOTH, &NEAR_DUPLICATE, &LOG_TWICE, &SIDE_EMPTY, &VAL_SMALL, &VAL_LACKS];

/// What the manifest says of its logs.
pub fn records(manifest: &Manifest) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut by_hash: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (log, record) in manifest.logs.iter().enumerate() {
        if !record.source_sha256.is_empty() {
            by_hash.entry(&record.source_sha256).or_default().push(log);
        }
    }
    for logs in by_hash.values().filter(|logs| logs.len() > 1) {
        let records: Vec<_> = logs.iter().map(|log| &manifest.logs[*log]).collect();
        let sides: BTreeSet<Split> = records.iter().map(|record| record.split).collect();
        let names: Vec<&str> = records.iter().map(|record| record.source_log.as_str()).collect();
        let sentence = format!("{} are the same log", names.join(", "));
        let place = Place { places: logs.len() as u64, ..Place::episode(&records[0].episode) };
        let check = if sides.len() > 1 { &IN_BOTH } else { &LOG_TWICE };
        findings.push(check.found(place, None, sentence));
    }
    let mut sides: BTreeMap<&str, BTreeSet<Split>> = BTreeMap::new();
    for record in &manifest.logs {
        for episode in &record.episodes {
            sides.entry(&episode.id).or_default().insert(record.split);
        }
    }
    for (id, _) in sides.iter().filter(|(_, sides)| sides.len() > 1) {
        findings.push(IN_BOTH.found(Place::episode(id), None, format!("{id} trains and judges")));
    }
    findings
}

/// The sides against each other.
pub fn check(digests: &[Digest]) -> Vec<Finding> {
    let mut findings: Vec<Finding> = sizes(digests).into_iter().collect();
    findings.extend(near_duplicates(digests));
    findings.extend(conditions(digests));
    findings
}

fn of_side(digests: &[Digest], side: Split) -> impl Iterator<Item = &Digest> {
    digests.iter().filter(move |digest| digest.split == side)
}

fn sizes(digests: &[Digest]) -> Option<Finding> {
    let frames = |side| of_side(digests, side).map(|digest| digest.frames).sum::<u64>();
    let (train, val) = (frames(Split::Train), frames(Split::Val));
    if train + val == 0 {
        return None;
    }
    let share = val as f64 / (train + val) as f64;
    if train == 0 || val == 0 {
        let what = if val == 0 { "no frame judges" } else { "no frame trains" };
        return Some(SIDE_EMPTY.found(Place::dataset(), share, what));
    }
    let sentence = format!("{} of the frames judge", percent(share));
    (share < VAL_SHARE).then(|| VAL_SMALL.found(Place::dataset(), share, sentence))
}

fn conditions(digests: &[Digest]) -> Vec<Finding> {
    let counts = |side, column: usize| {
        let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
        for digest in of_side(digests, side) {
            for (word, frames) in &digest.conditions[column] {
                if let Some(word) = word {
                    *counts.entry(word).or_default() += frames;
                }
            }
        }
        counts
    };
    let train = sum(digests, |d| if d.split == Split::Train { d.frames } else { 0 }) as f64;
    if of_side(digests, Split::Val).all(|digest| digest.frames == 0) {
        return Vec::new();
    }
    let mut findings = Vec::new();
    for (column, name) in CONDITIONS.iter().enumerate() {
        let judged = counts(Split::Val, column);
        let lacking = counts(Split::Train, column).into_iter().filter(|(word, frames)| {
            *frames as f64 / train > JUDGED_SHARE && !judged.contains_key(word)
        });
        let lacking: Vec<&str> = lacking.map(|(word, _)| word).collect();
        // A column that nothing judges at all is another finding.
        if !lacking.is_empty() && !judged.is_empty() {
            let sentence = format!("{name} {} is trained on and never judged", lacking.join(", "));
            let place = Place { places: lacking.len() as u64, ..Place::dataset() };
            findings.push(VAL_LACKS.found(place, None, sentence));
        }
    }
    findings
}

/// Side of the squares by which neighbours are found, m.
const CELL_M: f64 = ALONG_M;

type Cell = (i64, i64);

fn cell(position_m: [f64; 2]) -> Cell {
    ((position_m[0] / CELL_M).floor() as i64, (position_m[1] / CELL_M).floor() as i64)
}

fn drives(mark: &&Waymark) -> bool {
    mark.speed_mps > TELLING_MPS && mark.position_m.iter().all(|x| x.is_finite())
}

/// Judging drives that are a training drive.
fn near_duplicates(digests: &[Digest]) -> Vec<Finding> {
    let mut by_cell: BTreeMap<Cell, Vec<(usize, &Waymark)>> = BTreeMap::new();
    for (at, digest) in digests.iter().enumerate().filter(|(_, d)| d.split == Split::Train) {
        for mark in digest.waymarks.iter().filter(drives) {
            by_cell.entry(cell(mark.position_m)).or_default().push((at, mark));
        }
    }
    of_side(digests, Split::Val)
        .filter_map(|digest| near_duplicate(digest, digests, &by_cell))
        .collect()
}

fn near_duplicate(
    digest: &Digest,
    digests: &[Digest],
    by_cell: &BTreeMap<Cell, Vec<(usize, &Waymark)>>,
) -> Option<Finding> {
    // By training episode and whole seconds between the two: which waymarks fit.
    let mut fits: BTreeMap<(usize, i64), BTreeSet<usize>> = BTreeMap::new();
    let marks: Vec<&Waymark> = digest.waymarks.iter().filter(drives).collect();
    for (at, mark) in marks.iter().enumerate() {
        let (x, y) = cell(mark.position_m);
        let around = (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| (x, y)));
        for (other, there) in around.filter_map(|cell| by_cell.get(&cell)).flatten() {
            if let Some(apart_s) = apart_s(mark, there) {
                // Either neighbour, so that rounding does not tear them apart.
                for second in [apart_s.floor() as i64, apart_s.ceil() as i64] {
                    fits.entry((*other, second)).or_default().insert(at);
                }
            }
        }
    }
    let ((other, _), fitting) = fits.iter().max_by_key(|(_, marks)| marks.len())?;
    let share = fitting.len() as f64 / marks.len() as f64;
    let sentence = format!(
        "{} of its way is that of {} in the training split, at the same speeds",
        percent(share),
        digests[*other].episode
    );
    let is_same = marks.len() >= ENOUGH_MARKS && share >= SAME_SHARE;
    let place = Place::episode(&digest.episode);
    is_same.then(|| NEAR_DUPLICATE.found(place, share, sentence))
}

/// Seconds between two cars at one place, if they drive alike there.
fn apart_s(mark: &Waymark, there: &Waymark) -> Option<f64> {
    let (sin, cos) = there.yaw_rad.sin_cos();
    let [x, y] = [0, 1].map(|i: usize| mark.position_m[i] - there.position_m[i]);
    let (along_m, beside_m) = (x * cos + y * sin, y * cos - x * sin);
    let is_alike = along_m.abs() < ALONG_M
        && beside_m.abs() < BESIDE_M
        && (mark.speed_mps - there.speed_mps).abs() < SAME_SPEED_MPS
        && wrap_angle(mark.yaw_rad - there.yaw_rad).abs() < SAME_YAW_RAD;
    let stamps_s = mark.stamp_ns.wrapping_sub(there.stamp_ns) as f64 * 1e-9;
    is_alike.then(|| stamps_s - along_m / there.speed_mps)
}
