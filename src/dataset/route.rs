//! The way ahead: 130 waypoints 0.4 m apart, planned or driven, and the command it implies.

use glam::DVec3;

use crate::{
    dataset::{
        ego::{EgoState, EgoTrack, wrap_angle},
        motion::Motion,
    },
    frame::{Command, ROUTE_POINTS, ROUTE_SPACING_M, Route, RouteSource},
    log::{
        recording::{Series, Stamped, Topic},
        transforms::TransformTree,
    },
};

/// Poses nearer than this to the last one kept add no path: a standing car's jitter is no way.
const MIN_STEP_M: f64 = 0.1;

/// Heading change within [`TURN_WITHIN_M`] that makes a turn, rad (45 degrees).
const TURN_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// Together with [`TURN_RAD`] this is a bend of at most 32 m radius: a junction, not a curve of
/// the road.
const TURN_WITHIN_M: f64 = 25.0;

/// A way through the world with its arc length.
#[derive(Clone, Debug, Default)]
pub struct Path {
    points_m: Vec<DVec3>,
    /// Arc length at each point, metres, seen from above.
    arc_m: Vec<f64>,
    /// Time at each point, ns; only of a driven path.
    stamps_ns: Vec<i64>,
    /// Indices of points before which the path is broken.
    breaks: Vec<usize>,
}

impl Path {
    /// Where the car went. The path is broken where its track has a gap.
    pub fn driven(track: &EgoTrack) -> Path {
        let mut path = Path::default();
        let mut last_ns = None;
        for sample in track.samples() {
            let broken =
                last_ns.is_some_and(|last_ns| !track.is_continuous(last_ns, sample.stamp_ns));
            if path.push(sample.value.position_m, broken) {
                path.stamps_ns.push(sample.stamp_ns);
            }
            last_ns = Some(sample.stamp_ns);
        }
        path
    }

    /// A planned route.
    pub fn planned(points_m: &[DVec3]) -> Path {
        let mut path = Path::default();
        for point in points_m {
            path.push(*point, false);
        }
        path
    }

    fn push(&mut self, point_m: DVec3, broken: bool) -> bool {
        if broken {
            self.breaks.push(self.points_m.len());
        }
        let step_m = self.points_m.last().map(|last| (point_m - last).truncate().length());
        if step_m.is_some_and(|step_m| step_m < MIN_STEP_M && !broken) {
            return false;
        }
        self.arc_m.push(self.arc_m.last().unwrap_or(&0.0) + step_m.unwrap_or(0.0));
        self.points_m.push(point_m);
        true
    }

    /// Waypoints ahead of a car that drives this path and is at `now`, at `stamp_ns`: the first
    /// is where the car is (paper eq. 1).
    pub fn ahead_of_driver(&self, stamp_ns: i64, now: &EgoState) -> Route {
        let next = self.stamps_ns.partition_point(|stamp| *stamp <= stamp_ns);
        self.waypoints(now, next, now.position_m, RouteSource::Driven)
    }

    /// Waypoints ahead of a car at `now` on a planned route; the first is the closest point of
    /// the route. Of two equally close points the earlier is taken.
    pub fn ahead_on_route(&self, now: &EgoState) -> Option<Route> {
        let mut best: Option<(f64, usize, DVec3)> = None;
        for (index, pair) in self.points_m.windows(2).enumerate() {
            let (a, along) = (pair[0], pair[1] - pair[0]);
            let length2 = along.truncate().length_squared();
            let t =
                ((now.position_m - a).truncate().dot(along.truncate()) / length2).clamp(0.0, 1.0);
            let point = a + along * t;
            let distance = (now.position_m - point).truncate().length();
            if best.is_none_or(|(least, ..)| distance < least) {
                best = Some((distance, index + 1, point));
            }
        }
        let (_, next, start) = best?;
        Some(self.waypoints(now, next, start, RouteSource::Planned))
    }

    /// Resample from `start`, which lies before point `next`, at equal arc lengths.
    fn waypoints(&self, now: &EgoState, next: usize, start: DVec3, source: RouteSource) -> Route {
        let end = self.breaks.iter().copied().find(|at| *at >= next).unwrap_or(self.points_m.len());
        let mut waypoints_m = [0.0; 2 * ROUTE_POINTS];
        let mut len = 0;
        let mut place = |point: DVec3| {
            let [x, y] = now.ego_from_world(point);
            waypoints_m[2 * len] = x as f32;
            waypoints_m[2 * len + 1] = y as f32;
            len += 1;
            len < ROUTE_POINTS
        };
        let mut more = place(start);
        let (mut last, mut until_next_m) = (start, ROUTE_SPACING_M);
        for point in self.points_m.iter().take(end).skip(next) {
            let step = *point - last;
            let step_m = step.truncate().length();
            let mut along_m = until_next_m;
            while more && along_m <= step_m {
                more = place(last + step * (along_m / step_m));
                along_m += ROUTE_SPACING_M;
            }
            if !more {
                break;
            }
            until_next_m = along_m - step_m;
            last = *point;
        }
        let [x, y] = [waypoints_m[2 * len - 2], waypoints_m[2 * len - 1]];
        for padding in waypoints_m.chunks_exact_mut(2).skip(len) {
            padding.copy_from_slice(&[x, y]);
        }
        Route { waypoints_m, len: len as u8, source }
    }
}

/// Routes of a topic in the world of the ego motion, by the time from which they hold; and, if there
/// are some that cannot be brought there, how many and why.
pub fn planned(
    topic: Option<&Topic>,
    motion: &Motion,
    transforms: &TransformTree,
) -> (Vec<Stamped<Path>>, Option<String>) {
    let Some((topic, Series::Path(paths))) = topic.map(|topic| (topic, &topic.series)) else {
        return (Vec::new(), None);
    };
    let (mut planned, mut unplaced) = (Vec::new(), Vec::new());
    let paths: Vec<_> = paths.iter().filter(|path| path.value.len() > 1).collect();
    for path in &paths {
        let stamp_ns = path.stamp_ns;
        match motion.world_points(&path.value, &topic.frame_id, stamp_ns, transforms) {
            Ok(points) => planned.push(Stamped { stamp_ns, value: Path::planned(&points) }),
            Err(why) => unplaced.push(why),
        }
    }
    let left_out = unplaced.first().map(|why| {
        format!("route {}: {} of {} left out, {why}", topic.name, unplaced.len(), paths.len())
    });
    (planned, left_out)
}

/// The command that a route implies where no map tells of junctions: a turn is a bend of the
/// next 52 m too tight for a road's curve; all else follows the lane. `straight` needs a map.
pub fn command(route: &Route) -> Command {
    let points = &route.waypoints_m[..2 * usize::from(route.len)];
    // Headings over 2 m: over 0.4 m they would be noise.
    const SPAN: usize = 5;
    let headings: Vec<f64> = (SPAN..points.len() / 2)
        .map(|i| {
            let (dx, dy) = (
                points[2 * i] - points[2 * (i - SPAN)],
                points[2 * i + 1] - points[2 * (i - SPAN) + 1],
            );
            f64::from(dy).atan2(f64::from(dx))
        })
        .collect();
    let window = (TURN_WITHIN_M / ROUTE_SPACING_M) as usize;
    let changes = (0..headings.len()).map(|i| {
        let end = (i + window).min(headings.len() - 1);
        wrap_angle(headings[end] - headings[i])
    });
    let strongest = changes.fold(0.0_f64, |a, b| if b.abs() > a.abs() { b } else { a });
    match strongest {
        change if change >= TURN_RAD => Command::Left,
        change if change <= -TURN_RAD => Command::Right,
        _ => Command::Follow,
    }
}
