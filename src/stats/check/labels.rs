//! The future that frames are to predict, against the frames that follow.

use crate::{
    dataset::ego::wrap_angle,
    frame::{FUTURE_STEP_S, FUTURE_STEPS},
    stats::check::{
        digest::{Digest, sum},
        finding::{Check, Count, Finding, Hits, Level, Needs, Place, percent},
        motion::Motion,
        track::Track,
    },
};

/// Steps of the future that are looked up among later frames: 0.5, 1, 2 and 3 s.
const HORIZONS: [usize; 4] = [5, 10, 20, 30];

/// Frames that may be off: interpolation across a jerk, a pose at the edge of a gap.
const OFF_SHARE: f64 = 0.01;

/// Twice the error of a usable localisation, m.
const POSITION_OFF_M: f64 = 0.5;

pub static FUTURE_POSITION: Check = Check {
    code: "L01",
    name: "future-position",
    level: Level::Error,
    needs: Needs::Columns,
    what: "in more than 1 % of an episode's frames future_xy is more than 0.5 m from where the car is 0.5, 1, 2 or 3 s later",
    why: "ADE and FDE are measured against these numbers, and motion is learnt from them",
    remedy: "ingest the log again; if you changed poses or frames afterwards, compute the future anew",
};

/// A second of gentle acceleration, m/s.
const SPEED_OFF_MPS: f64 = 1.0;

pub static FUTURE_SPEED: Check = Check {
    code: "L02",
    name: "future-speed",
    level: Level::Error,
    needs: Needs::Columns,
    what: "in more than 1 % of an episode's frames future_speed is more than 1 m/s from the speed 0.5, 1, 2 or 3 s later",
    why: "the motion head learns this speed, and the car is driven by it",
    remedy: "ingest the log again; look for a shift by some frames, or another unit",
};

/// 6 degrees.
const YAW_OFF_RAD: f64 = 0.1;

pub static FUTURE_YAW: Check = Check {
    code: "L03",
    name: "future-yaw",
    level: Level::Error,
    needs: Needs::Columns,
    what: "in more than 1 % of an episode's frames future_yaw is more than 0.1 rad from the change of yaw 0.5, 1, 2 or 3 s later",
    why: "the motion head learns to steer by it: a wrong sign turns the car into the oncoming lane",
    remedy: "ingest the log again; look at sign, unit and wrapping",
};

pub static FUTURE_MASK: Check = Check {
    code: "L04",
    name: "future-mask",
    level: Level::Error,
    needs: Needs::Columns,
    what: "future_len is more than 30, or what lies behind it is not zero",
    why: "the mask is what keeps invented steps out of the loss",
    remedy: "ingest the log again; write zeros behind future_len",
};

/// Fewer frames than this with all of the future: the motion head starves.
const WHOLE_SHARE: f64 = 0.7;

pub static FUTURE_SHORT: Check = Check {
    code: "L05",
    name: "future-short",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "less than 70 % of all frames have the whole 3 s of future",
    why: "the motion loss sees few frames, and those are the calm middles of long drives",
    remedy: "record longer drives, and mend what makes gaps in the ego motion",
};

pub static LABEL_NOT_FINITE: Check = Check {
    code: "L06",
    name: "label-not-finite",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a future or a route has a value that is not finite",
    why: "one NaN in a batch makes every weight NaN",
    remedy: "ingest the log again; find the pose that is not finite",
};

/// Frames whose future may end before the frames do.
const CUT_SHARE: f64 = 0.05;

pub static FUTURE_CUT: Check = Check {
    code: "L07",
    name: "future-cut",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "in more than 5 % of an episode's frames the future ends although frames without a gap follow for 3 s",
    why: "labels that could be had are masked away",
    remedy: "raise the tolerance of the pose source: its samples are further apart than it allows",
};

pub static ALL: [&Check; 7] = [
    &FUTURE_POSITION,
    &FUTURE_SPEED,
    &FUTURE_YAW,
    &FUTURE_MASK,
    &FUTURE_SHORT,
    &LABEL_NOT_FINITE,
    &FUTURE_CUT,
];

/// The labels of an episode.
pub fn check(track: &Track, motion: &Motion) -> Vec<Finding> {
    let mut findings = against_later_frames(track, motion);
    findings.extend(masks(track));
    findings.extend(not_finite(track));
    findings.extend(cut(track, motion));
    findings
}

/// How far a label is from what came.
type Off = fn(&Track, &Motion, usize, usize, usize) -> f64;

fn against_later_frames(track: &Track, motion: &Motion) -> Vec<Finding> {
    let checks: [(&'static Check, f64, Off, &str); 3] = [
        (&FUTURE_POSITION, POSITION_OFF_M, position_off_m, "m"),
        (&FUTURE_SPEED, SPEED_OFF_MPS, speed_off_mps, "m/s"),
        (&FUTURE_YAW, YAW_OFF_RAD, yaw_off_rad, "rad"),
    ];
    let found = |(check, limit, off, unit): (&'static Check, f64, Off, &str)| {
        let worst = |row: usize| {
            let off = horizons(track, motion, row)
                .map(|(step, later)| off(track, motion, row, step, later));
            off.fold(None, |worst: Option<f64>, off| {
                Some(worst.map_or(off, |worst| worst.max(off)))
            })
        };
        let known = (0..track.len()).filter_map(|row| Some((track.frame[row], worst(row)?)));
        let known: Vec<(u32, f64)> = known.collect();
        let hits = Hits::of(known.iter().copied().filter(|(_, off)| *off > limit))?;
        let share = hits.count as f64 / known.len() as f64;
        let sentence = format!(
            "{}: {} ({}) up to {:.2} {unit} from what came",
            check.name.replace('-', "_").replace("position", "xy"),
            Count(hits.count, "frame"),
            percent(share),
            hits.worst
        );
        let place = hits.of_episode(&track.episode);
        (share > OFF_SHARE).then(|| check.found(place, hits.worst, sentence))
    };
    checks.into_iter().filter_map(found).collect()
}

/// Known steps of a row's future with the rows that they are of.
fn horizons<'t>(
    track: &'t Track,
    motion: &'t Motion,
    row: usize,
) -> impl Iterator<Item = (usize, usize)> + 't {
    let known = usize::from(track.future_len[row]).min(FUTURE_STEPS);
    HORIZONS.into_iter().filter(move |steps| *steps <= known).filter_map(move |steps| {
        let ticks = motion.ticks_in(steps as f64 * FUTURE_STEP_S)?;
        ((motion.run[row] as usize) > ticks).then_some((steps - 1, row + ticks))
    })
}

fn position_off_m(track: &Track, _: &Motion, row: usize, step: usize, later: usize) -> f64 {
    let (from, to) = (track.position_of(row), track.position_of(later));
    let (x, y) = (to[0] - from[0], to[1] - from[1]);
    let (sin, cos) = track.yaw_rad[row].sin_cos();
    let at = 2 * (row * FUTURE_STEPS + step);
    let (label_x, label_y) = (track.future_xy_m[at], track.future_xy_m[at + 1]);
    (x * cos + y * sin - f64::from(label_x)).hypot(y * cos - x * sin - f64::from(label_y))
}

fn speed_off_mps(track: &Track, motion: &Motion, row: usize, step: usize, later: usize) -> f64 {
    let label = f64::from(track.future_speed_mps[row * FUTURE_STEPS + step]);
    (motion.speed_mps[later] - label).abs()
}

fn yaw_off_rad(track: &Track, _: &Motion, row: usize, step: usize, later: usize) -> f64 {
    let label = f64::from(track.future_yaw_rad[row * FUTURE_STEPS + step]);
    let off = wrap_angle(track.yaw_rad[later] - track.yaw_rad[row] - label).abs();
    // Not finite is another finding.
    if off.is_finite() { off } else { 0.0 }
}

fn masks(track: &Track) -> Option<Finding> {
    let is_broken = |row: &usize| {
        let len = usize::from(track.future_len[*row]);
        let rest = |values: &[f32], width: usize| {
            let of_row = &values[width * FUTURE_STEPS * row..][..width * FUTURE_STEPS];
            of_row[width * len.min(FUTURE_STEPS)..].iter().any(|value| *value != 0.0)
        };
        len > FUTURE_STEPS
            || rest(&track.future_speed_mps, 1)
            || rest(&track.future_yaw_rad, 1)
            || rest(&track.future_xy_m, 2)
    };
    let rows = (0..track.len()).filter(is_broken);
    let hits = Hits::of(rows.map(|row| (track.frame[row], f64::from(track.future_len[row]))))?;
    let frames = Count(hits.count, "frame");
    let sentence = format!("{frames} with values behind future_len, or with one above 30");
    Some(FUTURE_MASK.found(hits.of_episode(&track.episode), hits.worst, sentence))
}

fn not_finite(track: &Track) -> Option<Finding> {
    // A sum is finite if its terms are, but for overflow, and much faster than looking at each.
    let is_finite = |values: &[f32]| values.iter().map(|value| value * 0.0).sum::<f32>() == 0.0;
    let future = |values: &[f32], width: usize, row: usize| {
        is_finite(&values[width * FUTURE_STEPS * row..][..width * FUTURE_STEPS])
    };
    let is_broken = |row: &usize| {
        !is_finite(track.route_of(*row))
            || !future(&track.future_speed_mps, 1, *row)
            || !future(&track.future_yaw_rad, 1, *row)
            || !future(&track.future_xy_m, 2, *row)
    };
    let rows = (0..track.len()).filter(is_broken);
    let hits = Hits::of(rows.map(|row| (track.frame[row], 0.0)))?;
    let frames = Count(hits.count, "frame");
    let sentence = format!("{frames} with a future or route that is not finite");
    Some(LABEL_NOT_FINITE.found(hits.of_episode(&track.episode), None, sentence))
}

fn cut(track: &Track, motion: &Motion) -> Option<Finding> {
    let ticks = motion.ticks_in(FUTURE_STEPS as f64 * FUTURE_STEP_S)?;
    let could = (0..track.len()).filter(|row| motion.run[*row] as usize > ticks);
    let could: Vec<usize> = could.collect();
    let lacks = |row: usize| FUTURE_STEPS.saturating_sub(usize::from(track.future_len[row]));
    let lacking = could.iter().filter(|row| lacks(**row) > 0);
    let hits = Hits::of(lacking.map(|row| (track.frame[*row], lacks(*row) as f64)))?;
    let share = hits.count as f64 / could.len() as f64;
    let sentence =
        format!("{} of the frames with 3 s of frames after them lack future", percent(share));
    let place = hits.of_episode(&track.episode);
    (share > CUT_SHARE).then(|| FUTURE_CUT.found(place, share, sentence))
}

/// How many frames have all of their future.
pub fn over_all(digests: &[Digest]) -> Option<Finding> {
    let frames = sum(digests, |digest| digest.frames);
    let share = sum(digests, |digest| digest.full_future) as f64 / frames as f64;
    let sentence = format!("{} of the frames have the whole 3 s of future", percent(share));
    (share < WHOLE_SHARE).then(|| FUTURE_SHORT.found(Place::dataset(), share, sentence))
}
