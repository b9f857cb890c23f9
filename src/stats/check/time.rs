//! Time within episodes, and between those of one log.

use crate::{
    dataset::manifest::Manifest,
    stats::check::{
        digest::Digest,
        finding::{Check, Count, Finding, Hits, Level, Needs, Place, percent},
        track::{SENSORS, Track},
    },
};

pub static TIME_ORDER: Check = Check {
    code: "T01",
    name: "time-order",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a frame's stamp or number is not after that of the row before",
    why: "a frame that is there twice weighs twice, and a sequence read in order goes back in time",
    remedy: "ingest the log again; if you joined shards yourself, sort by stamp and drop what is there twice",
};

/// Frames of the grid are stamped to the nanosecond; a millisecond is 3 cm at 110 km/h.
const OFF_GRID_NS: f64 = 1e6;

pub static OFF_GRID: Check = Check {
    code: "T02",
    name: "off-grid",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a stamp is more than 1 ms from first stamp + frame number / rate",
    why: "futures, speeds and accelerations assume equal steps: jitter becomes noise in every label",
    remedy: "resample to the grid: ingest the log again rather than writing recorded times into the frames",
};

/// A hole this long is no hiccup of a sensor, s.
const GAP_S: f64 = 1.0;

pub static GAP: Check = Check {
    code: "T03",
    name: "gap",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "more than 1 s of frames is missing within an episode",
    why: "futures end at the gap and what happened in it is never learnt; sequences across it jump",
    remedy: "see in the report which sensor was silent; cut the drive in two if it happens often",
};

/// More than this of an episode's ticks missing in small holes thins it out.
const MISSING_SHARE: f64 = 0.05;

pub static FRAMES_MISSING: Check = Check {
    code: "T04",
    name: "frames-missing",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "more than 5 % of the ticks between an episode's first and last frame have none",
    why: "few windows of 3 s are whole, so most frames lose their motion label",
    remedy: "widen the tolerance of the sensor that drops out, or make it optional",
};

/// A sample further than this share of a tick from its frame belongs to a neighbour. Half a tick
/// is the most that the nearest sample of a sensor at the grid's rate can be away.
const SKEW_TICKS: f64 = 0.6;

/// Frames of an episode that may be so.
const SKEWED_SHARE: f64 = 0.01;

pub static SKEW: Check = Check {
    code: "T05",
    name: "skew",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "more than 1 % of an episode's frames have a sample of a sensor further than 0.6 ticks away",
    why: "picture, returns and action are of different moments: at 50 km/h 60 ms are 0.8 m",
    remedy: "mend the clocks (an offset per topic in the profile) or lower the tolerance",
};

/// Frames that may show the picture of the frame before.
const REUSED_SHARE: f64 = 0.02;

pub static PICTURE_REUSED: Check = Check {
    code: "T06",
    name: "picture-reused",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "more than 2 % of an episode's frames show the same recorded picture as the frame before",
    why: "one picture with two different labels teaches their mean; frames are fewer than they seem",
    remedy: "lower --rate to the camera's, or the camera's tolerance below half its period",
};

/// Frames that may repeat the sample of a slow sensor.
const SLOW_SHARE: f64 = 0.1;

pub static SENSOR_SLOW: Check = Check {
    code: "T07",
    name: "sensor-slow",
    level: Level::Note,
    needs: Needs::Columns,
    what: "more than 10 % of an episode's frames have the same lidar, radar or control sample as the frame before",
    why: "the sensor is slower than the grid or drops messages; its input lags by up to a period",
    remedy: "lower --rate, or accept it: the skew columns say how old each sample is",
};

pub static OVERLAP: Check = Check {
    code: "T08",
    name: "episodes-overlap",
    level: Level::Error,
    needs: Needs::Columns,
    what: "two episodes of one log share a stretch of time",
    why: "the same moments are trained on twice, and in two splits they leak",
    remedy: "ingest the log again",
};

/// Shorter than this an episode has hardly a frame with 3 s before and after it, s.
const SHORT_S: f64 = 5.0;

pub static SHORT_EPISODE: Check = Check {
    code: "T09",
    name: "short-episode",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "an episode spans less than 5 s",
    why: "most of its frames have no 3 s of future; as an episode of the split that judges it weighs like a long one",
    remedy: "drop it, or see why the log broke off or was cut",
};

pub static ALL: [&Check; 9] = [
    &TIME_ORDER,
    &OFF_GRID,
    &GAP,
    &FRAMES_MISSING,
    &SKEW,
    &PICTURE_REUSED,
    &SENSOR_SLOW,
    &OVERLAP,
    &SHORT_EPISODE,
];

const NS_PER_S: f64 = 1e9;

/// The time of an episode.
pub fn check(track: &Track, rate_hz: f64) -> Vec<Finding> {
    if track.is_empty() {
        return Vec::new();
    }
    let mut findings = Vec::new();
    findings.extend(order(track));
    findings.extend(off_grid(track, rate_hz));
    findings.extend(gaps(track, rate_hz));
    findings.extend(missing(track));
    findings.extend(skews(track, rate_hz));
    findings.extend(reuse(track));
    findings.extend(short(track));
    findings
}

fn order(track: &Track) -> Option<Finding> {
    let is_late = |row: &usize| {
        track.stamp_ns[*row] <= track.stamp_ns[*row - 1]
            || track.frame[*row] <= track.frame[*row - 1]
    };
    let back_s = |row: usize| {
        let back_ns = track.stamp_ns[row - 1].saturating_sub(track.stamp_ns[row]);
        (track.frame[row], back_ns as f64 / NS_PER_S)
    };
    let hits = Hits::of((1..track.len()).filter(is_late).map(back_s))?;
    let sentence =
        format!("{} not after the row before, by up to {:.1} s", is_are(hits.count), hits.worst);
    Some(TIME_ORDER.found(hits.of_episode(&track.episode), hits.worst, sentence))
}

fn is_are(count: u64) -> String {
    format!("{} {}", Count(count, "frame"), if count == 1 { "is" } else { "are" })
}

fn off_grid(track: &Track, rate_hz: f64) -> Option<Finding> {
    let (first, start_ns) = (i64::from(*track.frame.first()?), *track.stamp_ns.first()?);
    let tick_ns = NS_PER_S / rate_hz;
    let off_ns = |row: usize| {
        let since_ns = track.stamp_ns[row].wrapping_sub(start_ns) as f64;
        (since_ns - (i64::from(track.frame[row]) - first) as f64 * tick_ns).abs()
    };
    let off = (0..track.len()).map(|row| (track.frame[row], off_ns(row)));
    let hits = Hits::of(off.filter(|(_, off_ns)| *off_ns > OFF_GRID_NS))?;
    let worst_ms = hits.worst / 1e6;
    let sentence = format!("{} off the grid, by up to {worst_ms:.1} ms", is_are(hits.count));
    Some(OFF_GRID.found(hits.of_episode(&track.episode), worst_ms, sentence))
}

fn gaps(track: &Track, rate_hz: f64) -> Option<Finding> {
    let gap = |pair: &[u32]| (pair[0], (f64::from(pair[1]) - f64::from(pair[0]) - 1.0) / rate_hz);
    let gaps = track.frame.windows(2).map(gap);
    let hits = Hits::of(gaps.filter(|(_, gap_s)| *gap_s > GAP_S))?;
    let sentence =
        format!("{} without frames, the longest {:.1} s", Count(hits.count, "gap"), hits.worst);
    Some(GAP.found(hits.of_episode(&track.episode), hits.worst, sentence))
}

fn missing(track: &Track) -> Option<Finding> {
    let (first, last) = (track.frame.iter().min()?, track.frame.iter().max()?);
    let ticks = f64::from(last - first) + 1.0;
    let share = 1.0 - track.len() as f64 / ticks;
    let sentence = format!("{} of the ticks between its ends have no frame", percent(share));
    let place = Place::episode(&track.episode);
    (share > MISSING_SHARE).then(|| FRAMES_MISSING.found(place, share, sentence))
}

fn skews(track: &Track, rate_hz: f64) -> Vec<Finding> {
    let limit_ns = SKEW_TICKS * NS_PER_S / rate_hz;
    let of_sensor = |(name, skews): (&&str, &Vec<Option<i32>>)| {
        let apart = track.frame.iter().zip(skews);
        let apart = apart.filter_map(|(frame, skew)| Some((*frame, f64::from((*skew)?).abs())));
        let hits = Hits::of(apart.filter(|(_, apart_ns)| *apart_ns > limit_ns))?;
        let share = hits.count as f64 / track.len() as f64;
        let worst_ms = hits.worst / 1e6;
        let sentence = format!(
            "{name}: {} with a sample further than {:.0} ms away, up to {worst_ms:.0} ms",
            Count(hits.count, "frame"),
            limit_ns / 1e6
        );
        let place = hits.of_episode(&track.episode);
        (share > SKEWED_SHARE).then(|| SKEW.found(place, worst_ms, sentence))
    };
    SENSORS.iter().zip(&track.skew_ns).filter_map(of_sensor).collect()
}

fn reuse(track: &Track) -> Vec<Finding> {
    let of_sensor = |(sensor, skews): (usize, &Vec<Option<i32>>)| {
        let sampled_ns = |row: usize| Some(track.stamp_ns[row] + i64::from(skews[row]?));
        // A row that repeats the one before is another fault.
        let repeats = |row: &usize| {
            sampled_ns(*row).is_some()
                && sampled_ns(*row) == sampled_ns(*row - 1)
                && track.frame[*row] > track.frame[*row - 1]
        };
        let rows = (1..track.len()).filter(repeats);
        let hits = Hits::of(rows.map(|row| (track.frame[row], 1.0)))?;
        let share = hits.count as f64 / track.len() as f64;
        let (check, limit) = match sensor {
            0 => (&PICTURE_REUSED, REUSED_SHARE),
            _ => (&SENSOR_SLOW, SLOW_SHARE),
        };
        let sentence = format!(
            "{}: {} of the frames repeat the sample of the frame before",
            SENSORS[sensor],
            percent(share)
        );
        let place = hits.of_episode(&track.episode);
        (share > limit).then(|| check.found(place, share, sentence))
    };
    track.skew_ns.iter().enumerate().filter_map(of_sensor).collect()
}

fn short(track: &Track) -> Option<Finding> {
    let (first, last) = (track.stamp_ns.iter().min()?, track.stamp_ns.iter().max()?);
    let seconds = last.saturating_sub(*first) as f64 / NS_PER_S;
    let sentence = format!("is {seconds:.1} s long");
    let place = Place::episode(&track.episode);
    (seconds < SHORT_S).then(|| SHORT_EPISODE.found(place, seconds, sentence))
}

/// Episodes of one log that share a stretch of time.
pub fn overlaps(manifest: &Manifest, digests: &[Digest]) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (log, record) in manifest.logs.iter().enumerate() {
        let of_log = digests.iter().filter(|digest| digest.log == log);
        let spans = of_log.filter_map(|digest| Some((digest.span_ns?, &digest.episode)));
        let mut spans: Vec<_> = spans.collect();
        spans.sort();
        for pair in spans.windows(2) {
            let [((_, end_ns), one), ((start_ns, _), other)] = pair else { continue };
            if start_ns <= end_ns {
                let seconds = (end_ns - start_ns) as f64 / NS_PER_S;
                let name = &record.source_log;
                let sentence = format!("shares {seconds:.1} s of {name} with {one}");
                findings.push(OVERLAP.found(Place::episode(other), seconds, sentence));
            }
        }
    }
    findings
}
