//! Routes of the CARLA leaderboard: XML files with waypoints in CARLA's world.

use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use crate::{
    error::{Error, Result},
    map::{
        index::OnLane,
        planner::{LanePlace, Planner},
        route::MapRoute,
        xml::{self, Element},
    },
};

/// A waypoint further than this from the centre of every lane is off the road, m.
const OFF_ROAD_M: f64 = 4.0;

/// Lanes this much further away than the nearest are tried as well: ways through a junction
/// overlap, and only what comes next tells which is meant, m.
const OVERLAP_M: f64 = 1.0;

/// A route of a file, in the frame of the map.
#[derive(Clone, Debug)]
pub struct LeaderboardRoute {
    pub id: String,
    pub town: String,
    waypoints: Vec<Waypoint>,
    path: PathBuf,
}

#[derive(Clone, Copy, Debug)]
struct Waypoint {
    position_m: DVec3,
    /// Counter-clockwise from x; newer files have none.
    heading_rad: Option<f64>,
    line: u32,
}

/// Read all routes of a file, old (`<waypoint>`) or new (`<waypoints><position>`).
///
/// # Errors
///
/// [`Error::Io`] if it cannot be read, [`Error::Map`] with element and line if it is malformed.
pub fn read(path: &Path) -> Result<Vec<LeaderboardRoute>> {
    let text = xml::read_text(path)?;
    let document = xml::parse(path, &text)?;
    let root = Element::root(&document, path, "routes")?;
    root.children("route").map(|route| read_route(route, path)).collect()
}

fn read_route(route: Element, path: &Path) -> Result<LeaderboardRoute> {
    let inner = route.child("waypoints");
    let positions = inner.into_iter().flat_map(|inner| inner.children("position"));
    let waypoints: Vec<Waypoint> =
        route.children("waypoint").chain(positions).map(read_waypoint).collect::<Result<_>>()?;
    if waypoints.len() < 2 {
        return Err(route.fault("a route needs a start and an end".into()));
    }
    Ok(LeaderboardRoute {
        id: route.text("id")?.to_string(),
        town: route.text("town")?.to_string(),
        waypoints,
        path: path.to_path_buf(),
    })
}

fn read_waypoint(waypoint: Element) -> Result<Waypoint> {
    // CARLA's y points south and its yaw turns clockwise.
    let position_m =
        DVec3::new(waypoint.number("x")?, -waypoint.number("y")?, waypoint.number_or("z", 0.0)?);
    let heading_rad = match waypoint.attribute("yaw") {
        Some(_) => Some(-waypoint.number("yaw")?.to_radians()),
        None => None,
    };
    Ok(Waypoint { position_m, heading_rad, line: waypoint.line() })
}

impl LeaderboardRoute {
    /// Snap the waypoints to lanes and plan the way through them.
    ///
    /// Of several lanes that a waypoint may lie on, those are taken with which the way is
    /// cheapest.
    ///
    /// # Errors
    ///
    /// [`Error::Map`] with the waypoint that lies off the road or cannot be reached.
    pub fn plan(&self, planner: &Planner) -> Result<MapRoute> {
        let mut ways: Vec<(f64, Vec<LanePlace>)> = Vec::new();
        for (index, waypoint) in self.waypoints.iter().enumerate() {
            let places = self.snapped(planner, index)?;
            if index == 0 {
                ways = places.into_iter().map(|place| (0.0, vec![place])).collect();
                continue;
            }
            let mut longer = Vec::new();
            for place in places {
                let reached = ways.iter().filter_map(|(cost_m, way)| {
                    let plan = planner.between_places(*way.last()?, place)?;
                    Some((cost_m + plan.cost_m, way))
                });
                if let Some((cost_m, way)) = reached.min_by(|a, b| a.0.total_cmp(&b.0)) {
                    longer.push((cost_m, way.iter().copied().chain([place]).collect()));
                }
            }
            if longer.is_empty() {
                let what = "cannot be reached from the waypoint before it";
                return Err(self.fault(index, waypoint, what));
            }
            ways = longer;
        }
        let best = ways.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, places) = best.unwrap_or_default();
        MapRoute::through(planner, &places).map_err(|index| {
            self.fault(
                index,
                &self.waypoints[index],
                "cannot be reached from the waypoint before it",
            )
        })
    }

    /// The places on lanes that a waypoint may mean, nearest first.
    fn snapped(&self, planner: &Planner, index: usize) -> Result<Vec<LanePlace>> {
        let waypoint = &self.waypoints[index];
        let mut near = planner.map().within(waypoint.position_m.truncate(), OFF_ROAD_M);
        let is_along = |on_lane: &OnLane| {
            let heading = DVec2::from_angle(on_lane.heading_rad);
            waypoint.heading_rad.is_none_or(|yaw| heading.dot(DVec2::from_angle(yaw)) > 0.0)
        };
        if near.iter().any(is_along) {
            near.retain(is_along);
        }
        let Some(nearest_m) = near.first().map(|nearest| nearest.distance_m) else {
            return Err(self.fault(index, waypoint, "lies off the road"));
        };
        near.retain(|on_lane| on_lane.distance_m <= nearest_m + OVERLAP_M);
        let places = near.iter().map(|on| LanePlace { lane: on.lane, s_m: on.s_m });
        Ok(places.collect())
    }

    fn fault(&self, index: usize, waypoint: &Waypoint, what: &str) -> Error {
        let DVec3 { x, y, .. } = waypoint.position_m;
        let last = self.waypoints.len() - 1;
        let which = match index {
            0 => "start".to_string(),
            index if index == last => "end".to_string(),
            index => format!("waypoint {index}"),
        };
        Error::Map {
            path: self.path.clone(),
            line: waypoint.line,
            element: "waypoint".into(),
            what: format!("route {}: its {which}, ({x:.2}, {y:.2}) on the map, {what}", self.id),
            hint: Some(format!("is this route for another town? It is marked {}", self.town)),
        }
    }
}
