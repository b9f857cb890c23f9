//! What `pmp-sim map` answers, as JSON and as text.

use std::{fmt, path::Path};

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    atomic,
    error::{Error, Result},
    map::{graph::waypoints_m, links::LaneKey, planner::Planner, road_map::RoadMap},
};

/// A map in figures, and answers to what was asked of it.
#[derive(Clone, Debug, Serialize)]
pub struct MapAnswers {
    pub roads: usize,
    pub junctions: usize,
    /// Driving lanes of the file that have a whole half metre of `s`, as CARLA counts.
    pub driving_lanes: usize,
    /// Sum over the driving lanes, each from its first to its last half metre, as CARLA counts.
    pub driving_lane_length_m: f64,
    pub driving_lane_length_in_junctions_m: f64,
    /// Nearest driving lanes; null in a map without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<Option<PointAnswer>>>,
    /// Cheapest ways; null where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub routes: Option<Vec<Option<RouteAnswer>>>,
}

/// The nearest driving lane to a place.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PointAnswer {
    pub road: RoadName,
    pub section: usize,
    pub lane: i32,
    /// Of the nearest point of the lane's centre line.
    pub s_m: f64,
    /// Of the place, from the road's reference line, positive left in the direction of `s`.
    pub t_m: f64,
    /// Direction of traffic, counter-clockwise from x, in (-pi, pi].
    pub heading_rad: f64,
    pub in_junction: bool,
}

impl PointAnswer {
    fn text(&self) -> String {
        let PointAnswer { road, section, lane, s_m, t_m, heading_rad, in_junction } = self;
        let junction = if *in_junction { ", in a junction" } else { "" };
        let heading = heading_rad.to_degrees();
        format!(
            "{road}/{section}/{lane} at s {s_m:.2} m, t {t_m:.2} m, heading {heading:.1} deg{junction}\n"
        )
    }
}

/// A road's id: a number where it is one, as in nearly all maps, else its text.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum RoadName {
    Number(u64),
    Text(String),
}

impl RoadName {
    fn new(id: &str) -> Self {
        match id.parse::<u64>() {
            Ok(number) if number.to_string() == id => RoadName::Number(number),
            _ => RoadName::Text(id.to_string()),
        }
    }
}

impl fmt::Display for RoadName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            RoadName::Number(number) => number.fmt(out),
            RoadName::Text(text) => text.fmt(out),
        }
    }
}

/// A way from lane start to lane start.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RouteAnswer {
    pub cost_m: f64,
    /// `road/section/lane`, from the start to the goal.
    pub lanes: Vec<String>,
}

impl RouteAnswer {
    fn text(&self) -> String {
        format!("{:.1} m: {}\n", self.cost_m, self.lanes.join(" -> "))
    }
}

/// A way that is asked for.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RouteQuestion {
    pub start: String,
    pub goal: String,
    /// What a lane change costs, m.
    #[serde(default)]
    pub lane_change_m: f64,
}

impl MapAnswers {
    /// The figures of a map.
    pub fn new(map: &RoadMap) -> Self {
        let lanes = map.graph().lanes();
        let roads = &map.opendrive().roads;
        let has_waypoint =
            |key: &LaneKey| waypoints_m(&roads[key.road], key.section).next().is_some();
        let in_junctions = lanes.iter().filter(|lane| lane.in_junction);
        MapAnswers {
            roads: roads.len(),
            junctions: map.opendrive().junctions.len(),
            driving_lanes: map.graph().keys().filter(has_waypoint).count(),
            driving_lane_length_m: lanes.iter().map(|lane| lane.waypoint_length_m).sum(),
            driving_lane_length_in_junctions_m: in_junctions
                .map(|lane| lane.waypoint_length_m)
                .sum(),
            points: None,
            routes: None,
        }
    }

    /// The JSON that the command prints.
    pub fn json(&self) -> String {
        // Numbers and texts alone: nothing that JSON could refuse.
        let text = serde_json::to_string_pretty(self).unwrap_or_default();
        text + "\n"
    }

    /// A short summary for people.
    pub fn text(&self, map: &RoadMap) -> String {
        let lanes = map.graph().lanes();
        let exact_m: f64 = lanes.iter().map(|lane| lane.length_m).sum();
        let mut text = format!(
            "{} roads, {} junctions\n\
             {} driving lanes: {:.1} m along their centres, {:.1} m between half metres, {:.1} m \
             of them in junctions\n",
            self.roads,
            self.junctions,
            self.driving_lanes,
            exact_m,
            self.driving_lane_length_m,
            self.driving_lane_length_in_junctions_m,
        );
        for point in self.points.iter().flatten() {
            text += &point.as_ref().map_or("no driving lane\n".to_string(), PointAnswer::text);
        }
        for route in self.routes.iter().flatten() {
            text += &route.as_ref().map_or("no way\n".to_string(), RouteAnswer::text);
        }
        text
    }

    /// Read places from a file, `[[x, y], ...]`, and find their lanes.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] or [`Error::Json`] if the file cannot be read.
    pub fn with_points(mut self, map: &RoadMap, path: &Path) -> Result<Self> {
        let places: Vec<[f64; 2]> = atomic::read_json(path)?;
        self.points = Some(places.iter().map(|place| point(map, DVec2::from(*place))).collect());
        Ok(self)
    }

    /// Read questions for ways from a file and plan them.
    ///
    /// # Errors
    ///
    /// [`Error::Io`] or [`Error::Json`] if the file cannot be read, [`Error::Config`] if a
    /// question names a lane that the map does not have.
    pub fn with_routes(mut self, map: &RoadMap, path: &Path) -> Result<Self> {
        let questions: Vec<RouteQuestion> = atomic::read_json(path)?;
        let routes = questions.iter().enumerate().map(|(i, question)| route(map, i, question));
        self.routes = Some(routes.collect::<Result<_>>()?);
        Ok(self)
    }
}

fn point(map: &RoadMap, place_m: DVec2) -> Option<PointAnswer> {
    let on_lane = map.nearest(place_m)?;
    let lane = map.lane(on_lane.lane);
    Some(PointAnswer {
        road: RoadName::new(&map.road(on_lane.lane).id),
        section: lane.key.section,
        lane: lane.key.lane,
        s_m: on_lane.s_m,
        t_m: on_lane.t_m,
        heading_rad: on_lane.heading_rad,
        in_junction: lane.in_junction,
    })
}

fn route(map: &RoadMap, index: usize, question: &RouteQuestion) -> Result<Option<RouteAnswer>> {
    let RouteQuestion { start, goal, lane_change_m } = question;
    let fail = |what: String, hint: &str| Error::Config {
        key: format!("route {index}"),
        what,
        hint: Some(hint.to_string()),
    };
    if !(lane_change_m.is_finite() && *lane_change_m >= 0.0) {
        let what = format!("`lane_change_m` is {lane_change_m}");
        return Err(fail(what, "give metres, 0 or more"));
    }
    let find = |name: &str| {
        let hint = "give lanes as \"road/section/lane\", as the answers to --points have them";
        map.find(name).ok_or_else(|| fail(format!("the map has no driving lane `{name}`"), hint))
    };
    let (starts, goals) = (find(start)?, find(goal)?);
    let Some(plan) = Planner::new(map, *lane_change_m).between_lanes(starts, goals) else {
        return Ok(None);
    };
    let mut lanes: Vec<String> = plan.lanes.iter().map(|lane| map.name(*lane)).collect();
    // A contracted lane was asked for by its own name and is answered by it.
    if let [first, ..] = &mut lanes[..] {
        first.clone_from(start);
    }
    if let [.., last] = &mut lanes[..] {
        last.clone_from(goal);
    }
    Ok(Some(RouteAnswer { cost_m: plan.cost_m, lanes }))
}
