//! The way ahead, and the command that goes with it.

use crate::{
    dataset::ego::wrap_angle,
    frame::{Command, FUTURE_STEPS, ROUTE_POINTS, ROUTE_SPACING_M},
    stats::check::{
        digest::{Digest, SHORT_ROUTE, sum},
        finding::{Check, Count, Finding, Hits, Level, Needs, Place, percent},
        motion::{Motion, TELLING_MPS},
        track::Track,
    },
};

/// A lane's width: a car off by more is not on this route, m.
const START_M: f64 = 3.5;
const START_SHARE: f64 = 0.01;

pub static ROUTE_START: Check = Check {
    code: "R01",
    name: "route-start",
    level: Level::Error,
    needs: Needs::Columns,
    what: "in more than 1 % of an episode's frames the first waypoint is more than 3.5 m from the car",
    why: "the route is of another place, time or frame: the strongest input of the network is wrong",
    remedy: "look at the frame of the route topic and at the transform between map and odometry",
};

/// Of the mean distance of a frame's waypoints.
const SPACING_OFF_M: f64 = 0.05;

pub static ROUTE_SPACING: Check = Check {
    code: "R02",
    name: "route-spacing",
    level: Level::Error,
    needs: Needs::Columns,
    what: "the waypoints of a frame are, on average, not 0.35 to 0.45 m apart",
    why: "the network reads distance from the index: at another spacing every junction is elsewhere",
    remedy: "ingest the log again; resample routes at 0.4 m of arc length",
};

pub static ROUTE_PADDING: Check = Check {
    code: "R03",
    name: "route-padding",
    level: Level::Error,
    needs: Needs::Columns,
    what: "route_len is 0 or above 130, or what lies behind it does not repeat the last waypoint",
    why: "zeros behind the end are a route that jumps back to the car",
    remedy: "ingest the log again; repeat the last waypoint",
};

/// Frames with less than 10 m of route.
const SHORT_SHARE: f64 = 0.2;

pub static ROUTE_SHORT: Check = Check {
    code: "R04",
    name: "route-short",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "more than 20 % of all frames have less than 10 m of route",
    why: "the policy does not see its next turn, and learns to brake where routes end",
    remedy: "record longer routes, or drives that go on; driven routes end where the log does",
};

/// The waypoint that must lie ahead, and how far behind it may be, m.
const AHEAD: usize = 10;
const BEHIND_M: f32 = -1.0;
const BEHIND_SHARE: f64 = 0.05;

pub static ROUTE_BACKWARDS: Check = Check {
    code: "R05",
    name: "route-backwards",
    level: Level::Error,
    needs: Needs::Columns,
    what: "in more than 5 % of an episode's frames of forward driving the route's tenth waypoint (4 m on) lies behind the car",
    why: "the route is in the wrong order, frame or turned around",
    remedy: "look at the frame of the route topic; routes are in the ego frame, x forward",
};

/// A lane change is 3.5 m.
const OFF_ROUTE_M: f64 = 5.0;
const OFF_ROUTE_SHARE: f64 = 0.02;

pub static OFF_ROUTE: Check = Check {
    code: "R06",
    name: "off-route",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "in more than 2 % of an episode's frames with a planned route the car is, 3 s later, more than 5 m off it",
    why: "the driver went elsewhere: input and label contradict each other, and the net learns to ignore routes",
    remedy: "drop the stretch, or let pmp-ingest use driven routes for the log (no route topic)",
};

/// One in a hundred is no mixture but an exception.
const MIXED_SHARE: f64 = 0.01;

pub static ROUTE_MIXED: Check = Check {
    code: "R07",
    name: "route-mixed",
    level: Level::Warning,
    needs: Needs::Columns,
    what: "some frames have planned routes and others (more than 1 %) driven ones",
    why: "a driven route runs exactly where the car goes, a planned one along the lane: the policy meets only planned ones",
    remedy: "drop one kind, or judge them apart (column route_source)",
};

pub static ROUTE_DRIVEN: Check = Check {
    code: "R08",
    name: "route-driven",
    level: Level::Note,
    needs: Needs::Columns,
    what: "no frame has a planned route",
    why: "a driven route gives the lateral answer away, so offline steering errors look better than driving will be",
    remedy: "record the navigator's route; until then trust closed-loop numbers only",
};

/// Turns of the route that tell left from right, rad; how many frames of a side tell; how many may
/// disagree.
const TURN_RAD: f64 = std::f64::consts::FRAC_PI_4;
const ENOUGH_TURNS: u64 = 20;
const OTHER_SIDE_SHARE: f64 = 0.5;

pub static COMMAND_SIDE: Check = Check {
    code: "R09",
    name: "command-side",
    level: Level::Error,
    needs: Needs::Columns,
    what: "of an episode's frames on a route that turns by 45 degrees, more than half of those that say left and of those that say right turn to the other side",
    why: "CIL switches its branch by the command: left and right are swapped",
    remedy: "look at how the commands are numbered in the log",
};

pub static COMMAND_WORD: Check = Check {
    code: "R10",
    name: "command-word",
    level: Level::Error,
    needs: Needs::Columns,
    what: "a command is none of follow, left, right, straight",
    why: "a training stops at the frame",
    remedy: "ingest the log again, or write one of the four words",
};

pub static ALL: [&Check; 10] = [
    &ROUTE_START,
    &ROUTE_SPACING,
    &ROUTE_PADDING,
    &ROUTE_SHORT,
    &ROUTE_BACKWARDS,
    &OFF_ROUTE,
    &ROUTE_MIXED,
    &ROUTE_DRIVEN,
    &COMMAND_SIDE,
    &COMMAND_WORD,
];

/// The routes of an episode.
pub fn check(track: &Track, motion: &Motion) -> Vec<Finding> {
    let found = [
        starts(track),
        spacings(track),
        paddings(track),
        backwards(track, motion),
        off_route(track),
        command_sides(track),
        command_words(track),
    ];
    found.into_iter().flatten().collect()
}

/// Waypoints before the padding, x and y in turn; empty where the length makes no sense.
fn waypoints(track: &Track, row: usize) -> &[f32] {
    let len = usize::from(track.route_len[row]);
    if len > ROUTE_POINTS { &[] } else { &track.route_of(row)[..2 * len] }
}

/// A finding of more than a share of an episode's frames.
fn of_share(
    track: &Track,
    check: &'static Check,
    hits: Option<Hits>,
    limit: f64,
    sentence: impl Fn(&Hits, String) -> String,
) -> Option<Finding> {
    let hits = hits?;
    let share = hits.count as f64 / track.len() as f64;
    let frames = format!("{} ({})", Count(hits.count, "frame"), percent(share));
    let place = hits.of_episode(&track.episode);
    (share > limit).then(|| check.found(place, hits.worst, sentence(&hits, frames)))
}

fn starts(track: &Track) -> Option<Finding> {
    let apart_m = (0..track.len()).map(|row| {
        let route = track.route_of(row);
        (track.frame[row], f64::from(route[0]).hypot(f64::from(route[1])))
    });
    let hits = Hits::of(apart_m.filter(|(_, apart_m)| *apart_m > START_M));
    of_share(track, &ROUTE_START, hits, START_SHARE, |hits, frames| {
        format!("{frames} whose route starts up to {:.1} m from the car", hits.worst)
    })
}

fn spacings(track: &Track) -> Option<Finding> {
    let off_m = |row: usize| {
        let points = waypoints(track, row);
        let spacings = points.len() / 2;
        if spacings < 2 {
            return None;
        }
        let square = |at: usize| {
            let (dx, dy) = (points[at + 2] - points[at], points[at + 3] - points[at + 1]);
            (dx * dx + dy * dy).sqrt()
        };
        let sum_m: f32 = (0..points.len() - 2).step_by(2).map(square).sum();
        let mean_m = f64::from(sum_m) / (spacings - 1) as f64;
        let off_m = (mean_m - ROUTE_SPACING_M).abs();
        (off_m > SPACING_OFF_M).then_some((track.frame[row], off_m))
    };
    let hits = Hits::of((0..track.len()).filter_map(off_m))?;
    let frames = Count(hits.count, "frame");
    let sentence = format!("{frames} with waypoints up to {:.2} m off their 0.4 m", hits.worst);
    Some(ROUTE_SPACING.found(hits.of_episode(&track.episode), hits.worst, sentence))
}

fn paddings(track: &Track) -> Option<Finding> {
    let is_broken = |row: &usize| {
        let len = usize::from(track.route_len[*row]);
        if len == 0 || len > ROUTE_POINTS {
            return true;
        }
        let route = track.route_of(*row);
        let last = [route[2 * len - 2], route[2 * len - 1]];
        // What is not finite is another finding, and equal to nothing.
        let differs = |point: &[f32]| (0..2).any(|i| (point[i] - last[i]).abs() > 0.0);
        route[2 * len..].chunks_exact(2).any(differs)
    };
    let rows = (0..track.len()).filter(is_broken);
    let hits = Hits::of(rows.map(|row| (track.frame[row], f64::from(track.route_len[row]))))?;
    let frames = Count(hits.count, "frame");
    let sentence = format!("{frames} whose route does not end as its length says");
    Some(ROUTE_PADDING.found(hits.of_episode(&track.episode), hits.worst, sentence))
}

fn backwards(track: &Track, motion: &Motion) -> Option<Finding> {
    let behind = (0..track.len()).filter_map(|row| {
        let x = *waypoints(track, row).get(2 * AHEAD)?;
        let is_behind = x < BEHIND_M && motion.speed_mps[row] > TELLING_MPS;
        is_behind.then(|| (track.frame[row], f64::from(-x)))
    });
    of_share(track, &ROUTE_BACKWARDS, Hits::of(behind), BEHIND_SHARE, |hits, frames| {
        format!("{frames} whose route runs backwards, up to {:.1} m behind", hits.worst)
    })
}

fn off_route(track: &Track) -> Option<Finding> {
    let off = (0..track.len()).filter(|row| track.is_planned[*row]).filter_map(|row| {
        let len = usize::from(track.future_len[row]).min(FUTURE_STEPS).checked_sub(1)?;
        let at = 2 * (row * FUTURE_STEPS + len);
        let (x, y) = (track.future_xy_m[at], track.future_xy_m[at + 1]);
        let points = waypoints(track, row);
        let square = |point: &[f32]| (point[0] - x).powi(2) + (point[1] - y).powi(2);
        let nearest = points.chunks_exact(2).map(square).fold(f32::INFINITY, f32::min);
        // Beyond the end of the route nothing can be said.
        let end = points.rchunks_exact(2).next().map(square)?;
        let off_m = f64::from(nearest).sqrt();
        (off_m > OFF_ROUTE_M && end > nearest).then_some((track.frame[row], off_m))
    });
    of_share(track, &OFF_ROUTE, Hits::of(off), OFF_ROUTE_SHARE, |hits, frames| {
        format!("{frames} that leave the planned route within 3 s, by up to {:.1} m", hits.worst)
    })
}

/// By how much a route turns from its first two metres to its last two, rad, left positive.
fn turn_rad(points: &[f32]) -> Option<f64> {
    const SPAN: usize = 5;
    let heading = |from: usize| {
        let (dx, dy) = (
            points[2 * (from + SPAN)] - points[2 * from],
            points[2 * (from + SPAN) + 1] - points[2 * from + 1],
        );
        f64::from(dy).atan2(f64::from(dx))
    };
    let last = (points.len() / 2).checked_sub(SPAN + 1)?;
    Some(wrap_angle(heading(last) - heading(0)))
}

/// Both sides have to be wrong: on the way into a roundabout a route may lead left although the
/// turn is to the right.
fn command_sides(track: &Track) -> Option<Finding> {
    // By side, left and right: frames that tell, and those that turn to the other one.
    let (mut telling, mut turned) = ([0_u64; 2], [0_u64; 2]);
    let mut others = Vec::new();
    for row in 0..track.len() {
        let (side, sign) = match track.command[row] {
            Some(Command::Left) => (0, 1.0),
            Some(Command::Right) => (1, -1.0),
            _ => continue,
        };
        let Some(turn) = turn_rad(waypoints(track, row)).filter(|turn| turn.abs() > TURN_RAD)
        else {
            continue;
        };
        telling[side] += 1;
        if turn * sign < 0.0 {
            turned[side] += 1;
            others.push((track.frame[row], turn.abs()));
        }
    }
    let hits = Hits::of(others)?;
    let share = hits.count as f64 / telling.iter().sum::<u64>() as f64;
    let sentence =
        format!("{} of the commands left and right are for the other side", percent(share));
    let is_swapped = telling.into_iter().zip(turned).all(|(telling, turned)| {
        telling >= ENOUGH_TURNS && turned as f64 > OTHER_SIDE_SHARE * telling as f64
    });
    is_swapped.then(|| COMMAND_SIDE.found(hits.of_episode(&track.episode), share, sentence))
}

fn command_words(track: &Track) -> Option<Finding> {
    let rows = (0..track.len()).filter(|row| track.command[*row].is_none());
    let hits = Hits::of(rows.map(|row| (track.frame[row], 1.0)))?;
    let sentence = format!("{} with a word that is no command", Count(hits.count, "frame"));
    Some(COMMAND_WORD.found(hits.of_episode(&track.episode), None, sentence))
}

/// Routes over the whole dataset.
pub fn over_all(digests: &[Digest]) -> Vec<Finding> {
    let frames = sum(digests, |digest| digest.frames) as f64;
    let short = sum(digests, |digest| digest.short_routes) as f64 / frames;
    let planned = sum(digests, |digest| digest.planned) as f64 / frames;
    let mut findings = Vec::new();
    if short > SHORT_SHARE {
        let metres = f64::from(SHORT_ROUTE) * ROUTE_SPACING_M;
        let sentence =
            format!("{} of all frames have less than {metres} m of route", percent(short));
        findings.push(ROUTE_SHORT.found(Place::dataset(), short, sentence));
    }
    if planned == 0.0 {
        let sentence = "all routes are driven: where the car went".to_string();
        findings.push(ROUTE_DRIVEN.found(Place::dataset(), None, sentence));
    } else if (MIXED_SHARE..1.0 - MIXED_SHARE).contains(&planned) {
        let sentence = format!(
            "{} of all frames have planned routes, the others driven ones",
            percent(planned)
        );
        findings.push(ROUTE_MIXED.found(Place::dataset(), planned, sentence));
    }
    findings
}
