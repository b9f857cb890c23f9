//! Lidar and radar returns of the frames that are looked at, and how many frames have any.

use std::collections::BTreeMap;

use half::f16;

use crate::stats::check::{
    digest::{Digest, sum},
    finding::{Check, Count, Finding, Hits, Level, Needs, Place, percent},
    glimpse::{LidarReturns, RadarReturns, Sight},
    motion::median,
    track::SENSORS,
};

/// Frames that may lack a sensor which others have.
const GONE_SHARE: f64 = 0.05;

pub static SENSOR_GONE: Check = Check {
    code: "P01",
    name: "sensor-gone",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "some frames have lidar or radar, and more than 5 % of all have none",
    why: "a batch mixes frames with and without the input; zeros then mean both `nothing there` and `no sensor`",
    remedy: "require the sensor in the profile, drop the logs without it, or train with sensor drop-out",
};

/// Of the frames that are looked at.
const EMPTY_SHARE: f64 = 0.05;

pub static LIDAR_EMPTY: Check = Check {
    code: "P02",
    name: "lidar-empty",
    level: Level::Warning,
    needs: Needs::Frames,
    what: "more than 5 % of an episode's lidar turns that were looked at have no point on the picture",
    why: "the input is blank: the extrinsics look elsewhere, or the lidar was covered",
    remedy: "look at the transform between lidar and camera (pmp-ingest inspect)",
};

/// Scans that must be empty before it is told; a radar without targets is no fault.
const ENOUGH_SCANS: usize = 8;

pub static RADAR_EMPTY: Check = Check {
    code: "P03",
    name: "radar-empty",
    level: Level::Warning,
    needs: Needs::Frames,
    what: "none of the dataset's radar scans that were looked at (8 and more) has a return on the picture",
    why: "the fourth channel is zero everywhere: the network has a radar in name only",
    remedy: "look at the transform between radar and camera, and at the topic",
};

pub static PIXEL_RANGE: Check = Check {
    code: "P04",
    name: "pixel-range",
    level: Level::Error,
    needs: Needs::Frames,
    what: "a lidar or radar pixel lies outside the picture",
    why: "building the ralidar image fails, or writes into another row",
    remedy: "ingest the log again; pixel is row x width + column of the stored size",
};

pub static PIXEL_ORDER: Check = Check {
    code: "P05",
    name: "pixel-order",
    level: Level::Error,
    needs: Needs::Frames,
    what: "lidar or radar pixels are not ascending, each once",
    why: "of two returns of a pixel the later one wins, which need not be the nearest",
    remedy: "ingest the log again; sort by pixel and keep the nearest",
};

pub static RETURN_NOT_FINITE: Check = Check {
    code: "P06",
    name: "return-not-finite",
    level: Level::Error,
    needs: Needs::Frames,
    what: "a lidar coordinate or radar speed is not finite",
    why: "one NaN in a batch makes every weight NaN; half floats overflow beyond 65 504",
    remedy: "leave returns without a finite place out",
};

pub static RETURN_LENGTHS: Check = Check {
    code: "P07",
    name: "return-lengths",
    level: Level::Error,
    needs: Needs::Frames,
    what: "the lists of pixels, coordinates or speeds of a frame have different lengths",
    why: "values land on other pixels than their own",
    remedy: "ingest the log again",
};

/// Half floats move a point by up to a third of a pixel at the edge of the picture.
const OFF_PIXELS: f64 = 3.0;
const OFF_SHARE: f64 = 0.05;

pub static PROJECTION: Check = Check {
    code: "P08",
    name: "lidar-projection",
    level: Level::Error,
    needs: Needs::Frames,
    what: "more than 5 % of a frame's lidar points lie, by the calibration, more than 3 pixels from the pixel that they are stored at",
    why: "the coordinates are in another frame (y and z swapped, metres and feet), or the calibration changed",
    remedy: "ingest the log again; coordinates are in the camera's optical frame, x right, y down, z forward",
};

/// Frames of a moving car whose returns must all stand still before it is told.
const ENOUGH_MOVING: usize = 5;
const MOVING_MPS: f32 = 3.0;

pub static RADAR_MOTIONLESS: Check = Check {
    code: "P09",
    name: "radar-motionless",
    level: Level::Warning,
    needs: Needs::Frames,
    what: "all radar speeds are zero in an episode's frames of a car that drives faster than 3 m/s (5 frames and more with returns)",
    why: "speeds relative to the ego vehicle cannot be zero while it drives past houses: the field is not filled, or compensated",
    remedy: "look at the radar's speed field; give speeds relative to the car",
};

/// Receding by as much, while the car drives forward: the world does not do that.
const RECEDING_MPS: f64 = 1.0;

pub static RADAR_SIGN: Check = Check {
    code: "P10",
    name: "radar-sign",
    level: Level::Error,
    needs: Needs::Frames,
    what: "while the car drives forward faster than 3 m/s the returns in front of it recede, by 1 m/s in the middle (5 frames and more)",
    why: "approaching is negative here; with both signs in a dataset the channel says nothing",
    remedy: "set closing_speed in the profile's radar rule",
};

pub static ALL: [&Check; 10] = [
    &SENSOR_GONE,
    &LIDAR_EMPTY,
    &RADAR_EMPTY,
    &PIXEL_RANGE,
    &PIXEL_ORDER,
    &RETURN_NOT_FINITE,
    &RETURN_LENGTHS,
    &PROJECTION,
    &RADAR_MOTIONLESS,
    &RADAR_SIGN,
];

/// What was seen of one frame's returns.
pub struct Look {
    episode: usize,
    frame: u32,
    is_forward: bool,
    lidar_points: Option<usize>,
    radar_points: Option<usize>,
    /// Largest pixel that is too large.
    beyond: Option<u32>,
    is_unordered: bool,
    is_not_finite: bool,
    has_lengths: bool,
    /// Share of the lidar points that are elsewhere.
    astray: Option<f64>,
    /// Median radar speed, and whether all are zero.
    radar_mps: Option<(f64, bool)>,
}

/// Look at the returns of a frame.
pub fn look(sight: &Sight) -> Look {
    let pixels = (sight.size.0 * sight.size.1) as u32;
    let (lidar, radar) = (sight.lidar.as_ref(), sight.radar.as_ref());
    let lists = [lidar.map(|lidar| &lidar.pixel), radar.map(|radar| &radar.pixel)];
    let lists = || lists.iter().flatten();
    let all = |radar: &RadarReturns| radar.speed_mps.iter().flatten().all(|v| v.is_finite());
    let radar_mps = radar.and_then(|radar| {
        let speeds = radar.speed_mps.as_ref()?.iter().map(|v| v.to_f64());
        let speeds: Vec<f64> = speeds.filter(|v| v.is_finite()).collect();
        let all_zero = speeds.iter().all(|v| *v == 0.0);
        Some((median(speeds)?, all_zero))
    });
    Look {
        episode: sight.episode,
        frame: sight.frame,
        is_forward: sight.forward_mps > MOVING_MPS,
        lidar_points: lidar.map(|lidar| lidar.pixel.len()),
        radar_points: radar.map(|radar| radar.pixel.len()),
        beyond: lists().flat_map(|list| list.iter()).copied().filter(|p| *p >= pixels).max(),
        is_unordered: lists().any(|list| list.windows(2).any(|pair| pair[0] >= pair[1])),
        is_not_finite: lidar.is_some_and(|lidar| !is_finite(lidar)) || !radar.is_none_or(all),
        has_lengths: lidar.is_none_or(has_lengths)
            && radar.is_none_or(|radar| {
                radar.speed_mps.as_ref().is_none_or(|v| v.len() == radar.pixel.len())
            }),
        astray: lidar.and_then(|lidar| astray(lidar, sight)),
        radar_mps,
    }
}

fn is_finite(lidar: &LidarReturns) -> bool {
    [&lidar.x, &lidar.y, &lidar.z].into_iter().flatten().all(|value: &f16| value.is_finite())
}

fn has_lengths(lidar: &LidarReturns) -> bool {
    [&lidar.x, &lidar.y, &lidar.z].iter().all(|axis| axis.len() == lidar.pixel.len())
}

/// Share of the points that do not lie at their pixels; of sound lists only.
fn astray(lidar: &LidarReturns, sight: &Sight) -> Option<f64> {
    let camera = sight.camera.filter(|camera| (camera.width, camera.height) == sight.size)?;
    if !has_lengths(lidar) || !is_finite(lidar) || lidar.pixel.is_empty() {
        return None;
    }
    let is_astray = |at: &usize| {
        let point = [&lidar.x, &lidar.y, &lidar.z].map(|axis| axis[*at].to_f64());
        let column = lidar.pixel[*at] as usize % camera.width;
        let row = lidar.pixel[*at] as usize / camera.width;
        // At the edge the rounding of half floats may put a point off the picture.
        let edge = OFF_PIXELS as usize;
        let is_inner = (edge..camera.width.saturating_sub(edge)).contains(&column)
            && (edge..camera.height.saturating_sub(edge)).contains(&row);
        match camera.project(point) {
            None => is_inner,
            Some([u, v]) => (u - column as f64 - 0.5).hypot(v - row as f64 - 0.5) > OFF_PIXELS,
        }
    };
    let count = (0..lidar.pixel.len()).filter(is_astray).count();
    Some(count as f64 / lidar.pixel.len() as f64)
}

/// What the looks say; `episodes` are the ids of the manifest's.
pub fn judge(looks: &[Look], episodes: &[&str]) -> Vec<Finding> {
    let mut by_episode: BTreeMap<usize, Vec<&Look>> = BTreeMap::new();
    looks.iter().for_each(|look| by_episode.entry(look.episode).or_default().push(look));
    let mut findings = Vec::new();
    for (episode, looks) in by_episode {
        findings.extend(of_episode(&looks, episodes[episode]));
    }
    let scans: Vec<usize> = looks.iter().filter_map(|look| look.radar_points).collect();
    if scans.len() >= ENOUGH_SCANS && scans.iter().all(|points| *points == 0) {
        let sentence = format!("none of {} has a return", Count(scans.len() as u64, "radar scan"));
        findings.push(RADAR_EMPTY.found(Place::dataset(), scans.len() as f64, sentence));
    }
    findings
}

fn of_episode(looks: &[&Look], id: &str) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut add = |check: &'static Check, is: &dyn Fn(&Look) -> Option<f64>, what: &str| {
        let hits = Hits::of(looks.iter().filter_map(|look| Some((look.frame, is(look)?))))?;
        let sentence = format!("{} {what}", Count(hits.count, "frame"));
        findings.push(check.found(hits.of_episode(id), hits.worst, sentence));
        Some(())
    };
    let flag = |is: bool| is.then_some(1.0);
    add(&PIXEL_RANGE, &|look| look.beyond.map(f64::from), "with pixels outside the picture");
    add(&PIXEL_ORDER, &|look| flag(look.is_unordered), "with pixels that do not ascend");
    add(&RETURN_NOT_FINITE, &|look| flag(look.is_not_finite), "with returns that are not finite");
    add(&RETURN_LENGTHS, &|look| flag(!look.has_lengths), "with lists of different lengths");
    let astray = |look: &Look| look.astray.filter(|share| *share > OFF_SHARE);
    add(&PROJECTION, &astray, "whose lidar points lie elsewhere than at their pixels");

    let turns = looks.iter().filter_map(|look| Some((look.frame, look.lidar_points?)));
    let turns: Vec<(u32, usize)> = turns.collect();
    let empty = turns.iter().filter(|(_, points)| *points == 0).map(|(frame, _)| (*frame, 0.0));
    if let Some(hits) = Hits::of(empty) {
        let share = hits.count as f64 / turns.len() as f64;
        if share > EMPTY_SHARE {
            let sentence = format!(
                "{} of {} have no point",
                hits.count,
                Count(turns.len() as u64, "lidar turn")
            );
            findings.push(LIDAR_EMPTY.found(hits.of_episode(id), share, sentence));
        }
    }
    let moving = looks.iter().filter(|look| look.is_forward).filter_map(|look| look.radar_mps);
    let moving: Vec<(f64, bool)> = moving.collect();
    if moving.len() >= ENOUGH_MOVING {
        let middle = median(moving.iter().map(|(speed, _)| *speed).collect()).unwrap_or(0.0);
        if moving.iter().all(|(_, all_zero)| *all_zero) {
            let frames = Count(moving.len() as u64, "frame");
            let sentence = format!("all radar speeds of {frames} of a driving car are zero");
            findings.push(RADAR_MOTIONLESS.found(Place::episode(id), 0.0, sentence));
        } else if middle > RECEDING_MPS {
            let sentence =
                format!("radar returns recede by {middle:.1} m/s from a car that drives forward");
            findings.push(RADAR_SIGN.found(Place::episode(id), middle, sentence));
        }
    }
    findings
}

/// Sensors that only some frames have.
pub fn over_all(digests: &[Digest]) -> Vec<Finding> {
    let frames = sum(digests, |digest| digest.frames);
    let of_sensor = |sensor: usize| {
        let having = sum(digests, |digest| digest.sensed[sensor]);
        let share = 1.0 - having as f64 / frames as f64;
        let name = SENSORS[sensor];
        let sentence = format!("{} of all frames have no {name}, others have", percent(share));
        let is_gone = having > 0 && share > GONE_SHARE;
        is_gone.then(|| SENSOR_GONE.found(Place::dataset(), share, sentence))
    };
    [1, 2].into_iter().filter_map(of_sensor).collect()
}
