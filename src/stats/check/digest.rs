//! What is kept of an episode when its columns are gone: enough to compare episodes and to count
//! over all of them.

use std::collections::BTreeMap;

use crate::{
    dataset::{
        manifest::LogRecord,
        split::Split,
        traits::{Trait, Traits},
    },
    frame::{Command, FUTURE_STEPS},
    stats::check::{motion::Motion, track::Track},
};

/// Slower than this a car stands, m/s.
pub const STANDING_MPS: f64 = 0.1;

/// Waypoints before the padding below which a route is short: 10 m, a second at 36 km/h.
pub const SHORT_ROUTE: u8 = 25;

/// Less than this of steering follows the lane (the second edge of the loader's balance).
const TURNING: f32 = 0.1;

/// Where the car was, once a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waymark {
    pub stamp_ns: i64,
    /// World frame, seen from above, m.
    pub position_m: [f64; 2],
    pub yaw_rad: f64,
    pub speed_mps: f64,
}

/// An episode, in numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Digest {
    pub episode: String,
    pub split: Split,
    /// Index in the manifest.
    pub log: usize,
    pub frames: u64,
    /// First and last stamp.
    pub span_ns: Option<(i64, i64)>,
    pub waymarks: Vec<Waymark>,
    /// Frames that have a sample of each sensor, in the order of [`Track::skew_ns`].
    pub sensed: [u64; 4],
    /// Frames that have steer, throttle, brake.
    pub acted: [u64; 3],
    pub braking: u64,
    pub turning: u64,
    pub starting: u64,
    pub standing: u64,
    /// In the order of [`Command::ALL`].
    pub commands: [u64; 4],
    /// Sum of speeds and of their squares.
    pub speed_sums: [f64; 2],
    pub planned: u64,
    pub short_routes: u64,
    pub perturbed: u64,
    pub full_future: u64,
    /// Frames by word; the columns in the order of [`Track::conditions`].
    pub conditions: [BTreeMap<Option<String>, u64>; 4],
}

impl Digest {
    pub fn of(track: &Track, motion: &Motion, log: usize, record: &LogRecord) -> Digest {
        let rows = 0..track.len();
        let count = |is: &dyn Fn(usize) -> bool| rows.clone().filter(|row| is(*row)).count() as u64;
        let traits: Vec<Traits> = rows
            .clone()
            .map(|row| {
                let action = [0, 1, 2].map(|channel: usize| track.action[channel][row]);
                let command = track.command[row].unwrap_or(Command::Follow);
                Traits::new(action, command, track.velocity_of(row))
            })
            .collect();
        let has = |which: Trait| count(&|row| traits[row].kind(which) == 1);
        let every = (1.0 / motion.tick_s).round().max(1.0) as usize;
        let waymark = |row: usize| {
            let [x, y, _] = track.position_of(row);
            let (stamp_ns, speed_mps) = (track.stamp_ns[row], motion.speed_mps[row].abs());
            Waymark { stamp_ns, position_m: [x, y], yaw_rad: track.yaw_rad[row], speed_mps }
        };
        let speeds = || motion.speed_mps.iter().filter(|speed| speed.is_finite());
        let steer = &track.action[0];
        let words = |words: &crate::stats::check::track::Words| {
            let mut counts = vec![0; words.known.len()];
            words.rows.iter().for_each(|row| counts[usize::from(*row)] += 1);
            words.known.iter().cloned().zip(counts).collect()
        };
        Digest {
            episode: track.episode.clone(),
            split: record.split,
            log,
            frames: track.len() as u64,
            span_ns: track.stamp_ns.iter().min().copied().zip(track.stamp_ns.iter().max().copied()),
            waymarks: rows.clone().step_by(every).map(waymark).collect(),
            sensed: [0, 1, 2, 3].map(|sensor: usize| {
                track.skew_ns[sensor].iter().filter(|skew| skew.is_some()).count() as u64
            }),
            acted: [0, 1, 2].map(|channel: usize| {
                track.action[channel].iter().filter(|value| value.is_some()).count() as u64
            }),
            braking: has(Trait::Brake),
            turning: count(&|row| steer[row].is_some_and(|steer| steer.abs() >= TURNING)),
            starting: has(Trait::Start),
            standing: count(&|row| motion.speed_mps[row].abs() < STANDING_MPS),
            commands: Command::ALL.map(|command| count(&|row| track.command[row] == Some(command))),
            speed_sums: [speeds().map(|v| v.abs()).sum(), speeds().map(|v| v * v).sum()],
            planned: count(&|row| track.is_planned[row]),
            short_routes: count(&|row| track.route_len[row] < SHORT_ROUTE),
            perturbed: count(&|row| track.perturbed[row]),
            full_future: count(&|row| usize::from(track.future_len[row]) >= FUTURE_STEPS),
            conditions: [0, 1, 2, 3].map(|column: usize| words(&track.conditions[column])),
        }
    }
}

/// A sum over episodes.
pub fn sum(digests: &[Digest], pick: impl Fn(&Digest) -> u64) -> u64 {
    digests.iter().map(pick).sum()
}
