//! What the driver did, against what the car did.
//!
//! Frames that were disturbed on purpose hold what the expert wanted, not what moved the car:
//! whatever holds actions against motion leaves them out, with a second on either side.

use crate::{
    dataset::manifest::Manifest,
    stats::check::{
        digest::{Digest, sum},
        finding::{Check, Count, Finding, Hits, Level, Needs, Place, percent},
        motion::{Motion, TELLING_MPS, correlation},
        track::{CHANNELS, Track},
    },
};

pub static ACTION_RANGE: Check = Check {
    code: "A01",
    name: "action-range",
    level: Level::Error,
    needs: Needs::Columns,
    what: "steer lies outside -1 ... 1, or throttle or brake outside 0 ... 1, or is not finite",
    why: "heads end in tanh and sigmoid: they can never say it, and L1 pulls them into saturation",
    remedy: "scale the channel in the profile: degrees, percent and radians are common",
};

/// Frames that may lack a channel which others have.
const MISSING_SHARE: f64 = 0.05;

pub static ACTION_MISSING: Check = Check {
    code: "A02",
    name: "action-missing",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "steer, throttle or brake is null in more than 5 % of all frames",
    why: "the action loss leaves these frames out; what no log has is not learnt at all",
    remedy: "name the topic of the channel in the profile, or drop the logs without it",
};

/// Correlation of steering with curvature, from which on it has a sign, and below which it has none.
const RELATED: f64 = 0.5;
const UNRELATED: f64 = 0.3;

/// Least pairs of an episode for a correlation, and the least spreads that tell: 0.005 1/m is a
/// bend of 200 m radius; 0.3 m/s2 is lifting off; 0.01 of a channel is a visible movement.
const ENOUGH: usize = 100;
const CURVATURE_SPREAD_1PM: f64 = 0.005;
const ACCELERATION_SPREAD_MPS2: f64 = 0.3;
const CHANNEL_SPREAD: f64 = 0.01;

pub static STEER_SIGN: Check = Check {
    code: "A03",
    name: "steer-sign",
    level: Level::Error,
    needs: Needs::Columns,
    what: "steering to the right goes with turning to the left in an episode (correlation below -0.5)",
    why: "a policy trained on a mix of both signs goes straight on; on one of them it leaves the road",
    remedy: "set the sign of the steering in the profile: pmp has positive = right, as CARLA",
};

pub static STEER_UNRELATED: Check = Check {
    code: "A04",
    name: "steer-unrelated",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "steering has nothing to do with how the car turns in an episode with bends (correlation within 0.3 of zero at every lag up to 1 s)",
    why: "the label is noise: another signal, another car, or another clock",
    remedy: "look at the topic of the control (pmp-ingest inspect) and at its clock",
};

/// Lags that are tried, s.
const LAGS_S: f64 = 1.0;

/// Motion may come so much before its action (smoothing, stamps of the end of a step) and so much
/// after it: power trains and steering take 0.1 to 0.5 s.
const EARLY_S: f64 = 0.15;
const LATE_S: f64 = 0.65;

/// The best lag must be better than a lag that is fine by this.
const CLEARLY: f64 = 0.05;

pub static ACTION_LAG: Check = Check {
    code: "A05",
    name: "action-lag",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "steering fits the turning, or pedals fit the acceleration, best when shifted by more than 0.65 s, or when the motion comes 0.2 s or more before the action",
    why: "labels that come late teach to react late; that costs more than any network gains",
    remedy: "give the control topic its offset in the profile's clock, or use stamps of recording",
};

/// Of both pedals at once: what a resting foot and a filter leave.
const BOTH: f32 = 0.1;
const BOTH_SHARE: f64 = 0.01;

pub static BOTH_PEDALS: Check = Check {
    code: "A06",
    name: "throttle-with-brake",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "throttle and brake are both above 0.1 in more than 1 % of an episode's frames",
    why: "their effects cancel; a policy that learns both at once creeps with smoking brakes",
    remedy: "look whether one channel has an offset, or is the other one's topic",
};

/// A channel at its end in so many moving frames is cut off rather than driven.
const SATURATED: f32 = 0.999;
const SATURATED_SHARES: [f64; 3] = [0.1, 0.5, 0.1];

pub static SATURATED_CHANNEL: Check = Check {
    code: "A07",
    name: "action-saturated",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "steer or brake is at its end in more than 10 % of an episode's moving frames, or throttle in more than 50 %",
    why: "the scale is wrong and everything beyond it was cut off: hard and gentle look the same",
    remedy: "raise the steering lock, or the scale of the pedal, in the profile",
};

/// Steering that does not move to the last bit for so long, while the bend changes by
/// this much, hangs. Bends of the road change over some seconds.
const FROZEN_S: f64 = 5.0;
const FROZEN_BEND_1PM: f64 = 0.02;

/// A pedal that is the same all along an episode of this length, while the car accelerates (throttle)
/// or slows down (brake) by as much over a second, hangs. Downhill and engine braking make less.
const FROZEN_PEDAL_S: f64 = 10.0;
const PEDAL_MPS2: f64 = 1.0;
const BRAKE_MPS2: f64 = 2.0;

pub static FROZEN_CHANNEL: Check = Check {
    code: "A08",
    name: "action-frozen",
    level: Level::Error,
    needs: Needs::Columns,
    what: "steer is the same to the bit for 5 s while the bend changes by 0.02 1/m, or throttle or brake all along an episode while the car accelerates by 1 m/s2 or slows down by 2 m/s2",
    why: "the channel hung, and its value is taught as the answer to everything",
    remedy: "find where the topic stopped; lower the control's tolerance so that the stretch becomes null",
};

pub static PEDALS_AGAINST_MOTION: Check = Check {
    code: "A09",
    name: "pedals-against-motion",
    level: Level::Error,
    needs: Needs::Columns,
    what: "throttle minus brake goes against the acceleration in an episode (correlation below -0.3)",
    why: "throttle and brake are swapped, or one has the wrong sign",
    remedy: "look at the pedals' topics and their mapping in the profile",
};

/// Braking and throttle against the car: hills and drag leave no more than this.
const AGAINST: f64 = 0.3;

pub static ALL: [&Check; 9] = [
    &ACTION_RANGE,
    &ACTION_MISSING,
    &STEER_SIGN,
    &STEER_UNRELATED,
    &ACTION_LAG,
    &BOTH_PEDALS,
    &SATURATED_CHANNEL,
    &FROZEN_CHANNEL,
    &PEDALS_AGAINST_MOTION,
];

/// The actions of an episode.
pub fn check(track: &Track, motion: &Motion) -> Vec<Finding> {
    let mut findings = ranges(track);
    findings.extend(both_pedals(track));
    findings.extend(saturated(track, motion));
    findings.extend(frozen_steer(track, motion));
    findings.extend(frozen_pedals(track, motion));
    findings.extend(steering(track, motion));
    findings.extend(pedals(track, motion));
    findings
}

fn ranges(track: &Track) -> Vec<Finding> {
    let of_channel = |(channel, values): (usize, &Vec<Option<f32>>)| {
        let range = if channel == 0 { -1.0..=1.0 } else { 0.0..=1.0 };
        let known = track.frame.iter().zip(values).filter_map(|(frame, value)| {
            value
                .filter(|value| !range.contains(value))
                .map(|value| (*frame, f64::from(value).abs()))
        });
        let hits = Hits::of(known)?;
        let (name, frames) = (CHANNELS[channel], Count(hits.count, "frame"));
        let sentence =
            format!("{name}: {frames} out of its range, up to {:.2} in size", hits.worst);
        Some(ACTION_RANGE.found(hits.of_episode(&track.episode), hits.worst, sentence))
    };
    track.action.iter().enumerate().filter_map(of_channel).collect()
}

fn both_pedals(track: &Track) -> Option<Finding> {
    let [_, throttle, brake] = &track.action;
    let both = (0..track.len()).filter_map(|row| {
        let less = throttle[row]?.min(brake[row]?);
        (less > BOTH).then_some((track.frame[row], f64::from(less)))
    });
    let hits = Hits::of(both)?;
    let share = hits.count as f64 / track.len() as f64;
    let sentence = format!("{} of the frames have both pedals down", percent(share));
    (share > BOTH_SHARE)
        .then(|| BOTH_PEDALS.found(hits.of_episode(&track.episode), share, sentence))
}

fn saturated(track: &Track, motion: &Motion) -> Vec<Finding> {
    let moves = |row: &usize| motion.speed_mps[*row].abs() > TELLING_MPS;
    let moving: Vec<usize> = (0..track.len()).filter(moves).collect();
    let of_channel = |channel: usize| {
        let at_end = moving.iter().filter_map(|row| {
            let size = track.action[channel][*row]?.abs();
            (size >= SATURATED).then_some((track.frame[*row], f64::from(size)))
        });
        let hits = Hits::of(at_end)?;
        let share = hits.count as f64 / moving.len() as f64;
        let name = CHANNELS[channel];
        let sentence = format!("{name} is at its end in {} of the moving frames", percent(share));
        let is_too_often = share > SATURATED_SHARES[channel] && moving.len() >= ENOUGH;
        let place = hits.of_episode(&track.episode);
        is_too_often.then(|| SATURATED_CHANNEL.found(place, share, sentence))
    };
    (0..CHANNELS.len()).filter_map(of_channel).collect()
}

fn frozen_steer(track: &Track, motion: &Motion) -> Option<Finding> {
    let steer = &track.action[0];
    let (mut found, mut row) = (Vec::new(), 0);
    while row < track.len() {
        let same = |other: &usize| steer[*other] == steer[row] && steer[*other].is_some();
        let end = (row + 1..track.len()).take_while(|r| same(r) && motion.is_step[*r - 1]).last();
        let end = end.unwrap_or(row);
        let seconds = (end - row) as f64 * motion.tick_s;
        let bends = || motion.curvature_1pm[row..end].iter().flatten();
        let (least, most) = bends().fold((f64::MAX, f64::MIN), |(a, b), c| (a.min(*c), b.max(*c)));
        if seconds >= FROZEN_S && most - least > FROZEN_BEND_1PM && is_calm(track, row, end) {
            found.push((track.frame[row], seconds));
        }
        row = end + 1;
    }
    let hits = Hits::of(found)?;
    let sentence = format!("steer hangs for up to {:.1} s while the car turns", hits.worst);
    Some(FROZEN_CHANNEL.found(hits.of_episode(&track.episode), hits.worst, sentence))
}

fn is_calm(track: &Track, first: usize, last: usize) -> bool {
    !track.perturbed[first..=last].contains(&true)
}

fn frozen_pedals(track: &Track, motion: &Motion) -> Vec<Finding> {
    let seconds = track.len() as f64 * motion.tick_s;
    // The mean over a second: a spike of the speed is no pedal.
    let window = ((1.0 / motion.tick_s) as usize).max(1);
    let long = |row: &usize| motion.run[*row] as usize > window;
    let means = (0..track.len()).filter(long).map(|row| {
        (motion.speed_mps[row + window].abs() - motion.speed_mps[row].abs())
            / (window as f64 * motion.tick_s)
    });
    let (least, most) = means.fold((0.0_f64, 0.0_f64), |(a, b), mean| (a.min(mean), b.max(mean)));
    let of_channel = |(channel, moved, limit): (usize, f64, f64)| {
        let values = &track.action[channel];
        let first = values.first().copied().flatten()?;
        let is_one = values.iter().all(|value| *value == Some(first));
        let name = CHANNELS[channel];
        let sentence =
            format!("{name} is {first} all along while the speed changes by {moved:.1} m/s2");
        let hangs = is_one && moved > limit && seconds >= FROZEN_PEDAL_S;
        let place = Place::episode(&track.episode);
        hangs.then(|| FROZEN_CHANNEL.found(place, f64::from(first), sentence))
    };
    let channels = [(1, most, PEDAL_MPS2), (2, -least, BRAKE_MPS2)];
    channels.into_iter().filter_map(of_channel).collect()
}

/// How well an action fits the motion that many ticks later, for every lag.
struct Fit {
    /// Ticks and correlation.
    by_lag: Vec<(isize, f64)>,
    tick_s: f64,
}

impl Fit {
    fn of(
        track: &Track,
        motion: &Motion,
        action: &[Option<f64>],
        answer: &[Option<f64>],
        spread: [f64; 2],
    ) -> Fit {
        let lags = (LAGS_S / motion.tick_s).round() as isize;
        let reach = lags as usize;
        // Rows with a second of undisturbed driving on either side, so that all lags have the same.
        let mut disturbed = vec![0_u32; track.len() + 1];
        for row in 0..track.len() {
            disturbed[row + 1] = disturbed[row] + u32::from(track.perturbed[row]);
        }
        let is_calm = |row: &usize| {
            let (first, last) = (row - reach, row + reach);
            motion.run[first] as usize > 2 * reach && disturbed[last + 1] == disturbed[first]
        };
        let rows: Vec<usize> = (reach..track.len().saturating_sub(reach + 1))
            .filter(is_calm)
            .filter(|row| action[*row].is_some())
            .collect();
        let at = |lag: isize| {
            let pairs = rows
                .iter()
                .filter_map(|row| Some((action[*row]?, answer[row.checked_add_signed(lag)?]?)));
            Some((lag, correlation(pairs, ENOUGH, spread)?))
        };
        Fit { by_lag: (-lags..=lags).filter_map(at).collect(), tick_s: motion.tick_s }
    }

    /// The lag of the strongest correlation, of either sign.
    fn strongest(&self) -> Option<(isize, f64)> {
        self.by_lag.iter().copied().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
    }

    /// A best lag that is not one that cars have.
    fn lag(&self, track: &Track, what: &str) -> Option<Finding> {
        let (lag, best) = self.by_lag.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let seconds = lag as f64 * self.tick_s;
        let fine =
            |(lag, _): &&(isize, f64)| (-EARLY_S..=LATE_S).contains(&(*lag as f64 * self.tick_s));
        let best_fine = self.by_lag.iter().filter(fine).map(|(_, fit)| *fit).fold(-1.0, f64::max);
        let sentence = match seconds < 0.0 {
            true => format!("{what} come {:.1} s after the motion that they cause", -seconds),
            false => format!("{what} come {seconds:.1} s before the motion that they cause"),
        };
        let is_odd = best > RELATED && best > best_fine + CLEARLY;
        is_odd.then(|| ACTION_LAG.found(Place::episode(&track.episode), seconds, sentence))
    }
}

fn steering(track: &Track, motion: &Motion) -> Vec<Finding> {
    let steer: Vec<Option<f64>> = track.action[0].iter().map(|s| s.map(f64::from)).collect();
    let spread = [CHANNEL_SPREAD, CURVATURE_SPREAD_1PM];
    let fit = Fit::of(track, motion, &steer, &motion.curvature_1pm, spread);
    let Some((_, strongest)) = fit.strongest() else { return Vec::new() };
    let place = || Place::episode(&track.episode);
    let mut findings = Vec::new();
    if strongest < -RELATED {
        let sentence = format!("steering goes against the turning: correlation {strongest:.2}");
        findings.push(STEER_SIGN.found(place(), strongest, sentence));
    }
    if strongest.abs() < UNRELATED {
        let sentence = format!("steering and turning have a correlation of {strongest:.2} at best");
        findings.push(STEER_UNRELATED.found(place(), strongest, sentence));
    }
    findings.extend(fit.lag(track, "steering angles"));
    findings
}

fn pedals(track: &Track, motion: &Motion) -> Vec<Finding> {
    let [_, throttle, brake] = &track.action;
    let drive: Vec<Option<f64>> = throttle
        .iter()
        .zip(brake)
        .map(|(throttle, brake)| Some(f64::from((*throttle)?) - f64::from((*brake)?)))
        .collect();
    // At rest the brake is down and nothing moves; in reverse the throttle makes the speed grow as well.
    let answer = |row: usize| {
        (motion.is_step[row] && motion.speed_mps[row].abs() > TELLING_MPS)
            .then(|| motion.acceleration_mps2[row] * motion.speed_mps[row].signum())
    };
    let answer: Vec<Option<f64>> = (0..track.len()).map(answer).collect();
    let spread = [CHANNEL_SPREAD, ACCELERATION_SPREAD_MPS2];
    let fit = Fit::of(track, motion, &drive, &answer, spread);
    let mut findings: Vec<Finding> = fit.lag(track, "pedals").into_iter().collect();
    if let Some((_, strongest)) = fit.strongest().filter(|(_, fit)| *fit < -AGAINST) {
        let sentence = format!("pedals go against the acceleration: correlation {strongest:.2}");
        let place = Place::episode(&track.episode);
        findings.push(PEDALS_AGAINST_MOTION.found(place, strongest, sentence));
    }
    findings
}

/// Channels that many frames lack, and which logs have none.
pub fn missing(manifest: &Manifest, digests: &[Digest]) -> Vec<Finding> {
    let frames = sum(digests, |digest| digest.frames);
    let of_channel = |channel: usize| {
        let share = 1.0 - sum(digests, |digest| digest.acted[channel]) as f64 / frames as f64;
        let without = digests.iter().filter(|d| d.acted[channel] == 0 && d.frames > 0);
        let example = without.clone().next().map(|digest| &manifest.logs[digest.log].source_log);
        let example = example.map(|log| {
            format!("; {} without any, as {log}", Count(without.count() as u64, "episode"))
        });
        let name = CHANNELS[channel];
        let sentence = format!(
            "{name} is null in {} of all frames{}",
            percent(share),
            example.unwrap_or_default()
        );
        (share > MISSING_SHARE).then(|| ACTION_MISSING.found(Place::dataset(), share, sentence))
    };
    (0..CHANNELS.len()).filter_map(of_channel).collect()
}
