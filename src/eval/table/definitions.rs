//! What every number of a closed-loop table is: one list. Nothing else spells a metric's key or unit.

use self::{
    Better::{Higher, Lower, Neither},
    Measure::{Ratio, Share},
};
use crate::{closed_loop::row::EpisodeRow, eval::statistics::ratio::Term};

/// How near to the goal a car that ran out of time has to be, to have stopped just before it.
const JUST_BEFORE_M: f64 = 10.0;

/// Least time to a collision of an episode in which nothing would have touched: how far ahead the
/// simulator looks.
const TTC_HORIZON_S: f64 = 3.0;

/// What CARLA's leaderboard leaves of a route's score for a contact with each.
const PENALTIES: [(&str, f64); 3] =
    [("collision-pedestrian", 0.5), ("collision-vehicle", 0.6), ("collision-static", 0.65)];

/// Reason of an episode that ended in an error, which is no failure to drive.
pub const CRASHED: &str = "crashed";

/// What an episode's reason may be.
pub const REASONS: [&str; 7] = [
    "goal",
    "collision-vehicle",
    "collision-pedestrian",
    "collision-static",
    "timeout",
    "off-route",
    CRASHED,
];

/// Which way a metric is good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    Lower,
    Higher,
    /// It describes, and does not judge.
    Neither,
}

impl Better {
    /// As written in tables.
    pub fn text(self) -> &'static str {
        match self {
            Better::Lower => "lower",
            Better::Higher => "higher",
            Better::Neither => "neither",
        }
    }
}

/// How episodes become one number.
#[derive(Clone, Copy, Debug)]
pub enum Measure {
    /// k of n, in per cent of the episodes that the question is for.
    Share(fn(&EpisodeRow) -> Option<bool>),
    /// The first's sum over the episodes by the second's, times `scale`.
    Ratio { scale: f64, of: fn(&EpisodeRow) -> Term },
}

impl Measure {
    /// What an episode adds, before `scale`.
    pub fn term(&self, row: &EpisodeRow) -> Term {
        match self {
            Share(asked) => asked(row).map(|yes| [f64::from(u8::from(yes)), 1.0]),
            Ratio { of, .. } => of(row),
        }
    }

    /// What the ratio of sums is multiplied by.
    pub fn scale(&self) -> f64 {
        match self {
            Share(_) => 100.0,
            Ratio { scale, .. } => *scale,
        }
    }
}

/// One row of [`METRICS`].
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Name in JSON and CSV.
    pub key: &'static str,
    pub title: &'static str,
    /// `1` for a number without unit.
    pub unit: &'static str,
    pub better: Better,
    /// Digits behind the point where people read.
    pub digits: usize,
    pub definition: &'static str,
    pub measure: Measure,
}

/// Groups of the paper's table, in its order.
pub const TABLE_I: [&str; 4] = ["sr", "wl", "ovsp", "ovsp_success"];

/// What an action is made of: shown by condition.
pub const INSIDE: [&str; 6] = [
    "lambda",
    "variance",
    "attention_camera",
    "attention_ralidar",
    "attention_route",
    "attention_velocity",
];

/// What two systems are compared on beside success, and for several seeds of one also success.
pub const COMPARED: [&str; 6] =
    ["sr", "wl", "ovsp", "route_completion", "driving_score", "infractions_per_km"];

/// Every metric, in the order of tables.
#[rustfmt::skip]
pub const METRICS: &[Metric] = &[
    Metric { key: "sr",                   title: "SR",                        unit: "%",    better: Higher,  digits: 1, measure: Share(|e| Some(e.success)),                  definition: "success rate: episodes that reached the goal in time without any contact" },
    Metric { key: "wl",                   title: "WL",                        unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.wrong_lane_s)),      definition: "time in a wrong lane by time driven, sum by sum over the episodes" },
    Metric { key: "ovsp",                 title: "OVSP, all",                 unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.overspeed_s)),       definition: "time above the limit (20 km/h in junctions, 50 km/h elsewhere) by time driven, sum by sum over all episodes" },
    Metric { key: "ovsp_success",         title: "OVSP, successes",           unit: "%",    better: Lower,   digits: 2, measure: percent(|e| if_success(e, of_time(e, e.overspeed_s))), definition: "the same over successful episodes alone, `--` without one, as the paper evidently has it" },
    Metric { key: "wl_mean",              title: "WL, mean of episodes",      unit: "%",    better: Lower,   digits: 2, measure: percent(|e| each(of_time(e, e.wrong_lane_s))), definition: "mean over episodes of each one's share of time in a wrong lane" },
    Metric { key: "wl_way",               title: "WL by way",                 unit: "%",    better: Lower,   digits: 2, measure: percent(|e| Some([e.wrong_lane_m, e.driven_m])), definition: "metres in a wrong lane by metres driven, sum by sum" },
    Metric { key: "wl_strict",            title: "WL, strict",                unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.wrong_lane_strict_s)), definition: "time on no lane of the route by time driven, sum by sum" },
    Metric { key: "ovsp_mean",            title: "OVSP, all, mean of episodes", unit: "%",  better: Lower,   digits: 2, measure: percent(|e| each(of_time(e, e.overspeed_s))), definition: "mean over all episodes of each one's share of time above the limit" },
    Metric { key: "ovsp_success_mean",    title: "OVSP, successes, mean of episodes", unit: "%", better: Lower, digits: 2, measure: percent(|e| if_success(e, each(of_time(e, e.overspeed_s)))), definition: "the same over successful episodes alone" },
    Metric { key: "ovsp_way",             title: "OVSP by way",               unit: "%",    better: Lower,   digits: 2, measure: percent(|e| Some([e.overspeed_m, e.driven_m])), definition: "metres above the limit by metres driven, sum by sum over all episodes" },
    Metric { key: "route_completion",     title: "Route completion",          unit: "%",    better: Higher,  digits: 1, measure: percent(|e| Some([completion(e), 1.0])),      definition: "mean share of the route that was driven; 100 % for a success" },
    Metric { key: "driving_score",        title: "Driving score",             unit: "%",    better: Higher,  digits: 1, measure: percent(|e| Some([completion(e) * penalty(e), 1.0])), definition: "mean of route completion times 0.5 after a contact with a pedestrian, 0.6 with a vehicle, 0.65 with anything else (CARLA leaderboard's formula; a contact ends an episode, so there is at most one, and lights, stop signs and the part off the road are not in it)" },
    Metric { key: "infractions_per_km",   title: "Infractions per km",        unit: "1/km", better: Lower,   digits: 3, measure: ratio(|e| Some([one(contact(e) || e.reason == "off-route"), km(e)])), definition: "contacts and departures from the route by km driven, sum by sum" },
    Metric { key: "km_between_failures",  title: "Way between failures",      unit: "km",   better: Higher,  digits: 3, measure: ratio(|e| Some([km(e), one(!e.success)])),    definition: "km driven by episodes that failed for whatever reason, sum by sum; `--` without a failure" },
    Metric { key: "contact_pedestrian",   title: "Contact with a pedestrian", unit: "%",    better: Lower,   digits: 1, measure: Share(|e| Some(e.reason == "collision-pedestrian")), definition: "episodes that ended so" },
    Metric { key: "contact_vehicle",      title: "Contact with a vehicle",    unit: "%",    better: Lower,   digits: 1, measure: Share(|e| Some(e.reason == "collision-vehicle")), definition: "episodes that ended so, bicycles and motorcycles included" },
    Metric { key: "contact_static",       title: "Contact with what stands",  unit: "%",    better: Lower,   digits: 1, measure: Share(|e| Some(e.reason == "collision-static")), definition: "episodes that ended at a wall, tree, pole or the like" },
    Metric { key: "off_route",            title: "Left the route",            unit: "%",    better: Lower,   digits: 1, measure: Share(|e| Some(e.reason == "off-route")),     definition: "episodes that ended far from the route" },
    Metric { key: "timeout",              title: "Timeout",                   unit: "%",    better: Lower,   digits: 1, measure: Share(|e| Some(e.reason == "timeout" && !just_before(e))), definition: "episodes that ran out of time more than 10 m from the goal" },
    Metric { key: "stopped_before_goal",  title: "Stopped before the goal",   unit: "%",    better: Lower,   digits: 1, measure: Share(|e| Some(just_before(e))),              definition: "episodes that ran out of time within 10 m of the goal" },
    Metric { key: "at_fault",             title: "Contacts at fault",         unit: "%",    better: Lower,   digits: 1, measure: Share(|e| e.at_fault),                       definition: "contacts that the ego vehicle caused, of all contacts" },
    Metric { key: "impact",               title: "Speed of impact",           unit: "m/s",  better: Lower,   digits: 2, measure: ratio(|e| Some([e.impact_mps?, 1.0])),        definition: "mean over contacts of the length of the difference of both velocities" },
    Metric { key: "least_ttc",            title: "Least time to collision",   unit: "s",    better: Higher,  digits: 2, measure: ratio(|e| Some([e.least_ttc_s.map_or(TTC_HORIZON_S, |s| s.min(TTC_HORIZON_S)), 1.0])), definition: "mean over episodes of the least time to a collision at constant velocities; 3 s where nothing would have touched within 3 s" },
    Metric { key: "short_ttc",            title: "Time to collision < 0.95 s", unit: "%",   better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.short_ttc_s)),       definition: "time with a collision less than 0.95 s away at constant velocities, by time driven, sum by sum" },
    Metric { key: "discomfort",           title: "Discomfort, any",           unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.uncomfortable_s)),   definition: "time outside at least one of nuPlan's bounds of comfort by time driven, sum by sum" },
    Metric { key: "discomfort_longitudinal", title: "Longitudinal acceleration", unit: "%", better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.uncomfortable_longitudinal_s)), definition: "share of time outside -4.05 to 2.40 m/s2" },
    Metric { key: "discomfort_lateral",   title: "Lateral acceleration",      unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.uncomfortable_lateral_s)), definition: "share of time above 4.89 m/s2" },
    Metric { key: "discomfort_yaw_rate",  title: "Yaw rate",                  unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.uncomfortable_yaw_rate_s)), definition: "share of time above 0.95 rad/s" },
    Metric { key: "discomfort_yaw_acceleration", title: "Yaw acceleration",   unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.uncomfortable_yaw_acceleration_s)), definition: "share of time above 1.93 rad/s2" },
    Metric { key: "discomfort_longitudinal_jerk", title: "Longitudinal jerk", unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.uncomfortable_longitudinal_jerk_s)), definition: "share of time above 4.13 m/s3" },
    Metric { key: "discomfort_jerk",      title: "Jerk",                      unit: "%",    better: Lower,   digits: 2, measure: percent(|e| of_time(e, e.uncomfortable_jerk_s)), definition: "share of time above 8.37 m/s3" },
    Metric { key: "jerk",                 title: "Mean longitudinal jerk",    unit: "m/s3", better: Lower,   digits: 2, measure: ratio(|e| of_time(e, e.longitudinal_jerk_mps2)), definition: "mean over time of the absolute longitudinal jerk" },
    Metric { key: "steering",             title: "Steering travel",           unit: "1/s",  better: Lower,   digits: 3, measure: ratio(|e| of_time(e, e.steering_travel)),     definition: "changes of steering by time driven; 1 is from the middle to the end" },
    Metric { key: "speed",                title: "Mean speed",                unit: "km/h", better: Neither, digits: 1, measure: Ratio { scale: 3.6, of: |e| of_time(e, e.driven_m) }, definition: "way driven by time driven" },
    Metric { key: "standing",             title: "Standing",                  unit: "%",    better: Neither, digits: 1, measure: percent(|e| of_time(e, e.standing_s)),        definition: "share of time standing" },
    Metric { key: "lambda",               title: "Lambda",                    unit: "1",    better: Neither, digits: 3, measure: ratio(|e| fused(e, e.lambda_sum)), definition: "mean weight of the planned motion's action in what was done (the paper's eq. (3)), over decisions fused of two actions" },
    Metric { key: "variance",             title: "S",                         unit: "1",    better: Neither, digits: 4, measure: ratio(|e| fused(e, e.variance_sum)), definition: "mean of the planned motion's summed variance, from which lambda follows" },
    Metric { key: "attention_camera",     title: "Attention, camera",         unit: "1",    better: Neither, digits: 3, measure: ratio(|e| attended(e, e.attention_camera_sum)), definition: "mean share of attention" },
    Metric { key: "attention_ralidar",    title: "Attention, lidar and radar", unit: "1",   better: Neither, digits: 3, measure: ratio(|e| attended(e, e.attention_ralidar_sum)), definition: "mean share of attention" },
    Metric { key: "attention_route",      title: "Attention, route",          unit: "1",    better: Neither, digits: 3, measure: ratio(|e| attended(e, e.attention_route_sum)), definition: "mean share of attention" },
    Metric { key: "attention_velocity",   title: "Attention, velocity",       unit: "1",    better: Neither, digits: 3, measure: ratio(|e| attended(e, e.attention_velocity_sum)), definition: "mean share of attention" },
];

/// The metric of that key.
pub fn metric(key: &str) -> Option<&'static Metric> {
    METRICS.iter().find(|metric| metric.key == key)
}

const fn percent(of: fn(&EpisodeRow) -> Term) -> Measure {
    Ratio { scale: 100.0, of }
}

const fn ratio(of: fn(&EpisodeRow) -> Term) -> Measure {
    Ratio { scale: 1.0, of }
}

fn of_time(episode: &EpisodeRow, above: f64) -> Term {
    Some([above, episode.duration_s])
}

/// A term that weighs as much as that of any other episode.
fn each(term: Term) -> Term {
    let [above, below] = term?;
    (below > 0.0).then(|| [above / below, 1.0])
}

fn if_success(episode: &EpisodeRow, term: Term) -> Term {
    term.filter(|_| episode.success)
}

fn fused(episode: &EpisodeRow, sum: f64) -> Term {
    (episode.fused > 0).then_some([sum, episode.fused as f64])
}

fn attended(episode: &EpisodeRow, sum: f64) -> Term {
    (episode.attended > 0).then_some([sum, episode.attended as f64])
}

fn one(yes: bool) -> f64 {
    f64::from(u8::from(yes))
}

fn km(episode: &EpisodeRow) -> f64 {
    episode.driven_m / 1000.0
}

fn contact(episode: &EpisodeRow) -> bool {
    episode.reason.starts_with("collision-")
}

fn just_before(episode: &EpisodeRow) -> bool {
    episode.reason == "timeout" && episode.goal_m <= JUST_BEFORE_M
}

/// Share of the route; the goal's circle begins before the route's end.
fn completion(episode: &EpisodeRow) -> f64 {
    match episode.success {
        true => 1.0,
        false if episode.route_m > 0.0 => (episode.progress_m / episode.route_m).clamp(0.0, 1.0),
        false => 0.0,
    }
}

fn penalty(episode: &EpisodeRow) -> f64 {
    let of_reason = PENALTIES.iter().find(|(reason, _)| *reason == episode.reason);
    of_reason.map_or(1.0, |(_, penalty)| *penalty)
}
