//! A plain two-lane road: straights and curves joined by transitions of linear curvature.
//!
//! World frame: x forward at the start of the road, y left, z up, flat ground at z = 0. `s` is
//! the arc length of the centre line in metres, `lateral` the distance from it, positive left.
//! Traffic keeps right. The heading stays within 75 degrees of the start's, so that the road
//! never meets itself.

use glam::DVec2;

use crate::noise::Noise;

/// Width of each of the two lanes, m.
pub const LANE_WIDTH_M: f64 = 3.5;

/// Lateral position of the middle of the lane that runs along the road.
pub const OWN_LANE_M: f64 = -LANE_WIDTH_M / 2.0;

/// Asphalt beyond the edge line, m.
pub const SHOULDER_M: f64 = 0.4;

/// Width of lane markings, m.
pub const LINE_WIDTH_M: f64 = 0.14;

/// A dash of the centre line and the gap behind it, m.
pub const DASH_M: f64 = 3.0;
pub const DASH_PERIOD_M: f64 = 9.0;

/// Extent of a stop line along the road, m.
pub const STOP_LINE_DEPTH_M: f64 = 0.5;

/// Limit of the country road, m/s (50 km/h).
pub const SPEED_LIMIT_MPS: f64 = 50.0 / 3.6;

/// Lateral acceleration that the limit of a curve is made for, m/s2.
const LATERAL_MPS2: f64 = 2.2;

/// Distance between two stored points, m; pieces are whole multiples of it.
const STEP_M: f64 = 0.5;

/// A stretch over which curvature changes linearly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    pub length_m: f64,
    /// Curvature at both ends, 1/m, positive = left.
    pub start_per_m: f64,
    pub end_per_m: f64,
}

/// A point of the centre line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoadPoint {
    pub position_m: DVec2,
    pub heading_rad: f64,
    pub curvature_per_m: f64,
}

/// What the ground is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    Grass,
    Asphalt,
    Marking,
}

/// A road, from arc length 0 to its length.
#[derive(Clone, Debug)]
pub struct Road {
    points: Vec<RoadPoint>,
    /// Where the right lane has to stop: arc length of the near edge of the line, m, ascending.
    stop_lines_m: Vec<f64>,
}

impl Road {
    /// A road of at least `length_m`, with curves of both signs and stop lines.
    pub fn generate(noise: &mut Noise, length_m: f64) -> Self {
        let mut pieces = vec![level(noise.uniform(60.0, 120.0))];
        let (mut s, mut heading) = (pieces[0].length_m, 0.0_f64);
        let mut stop_lines = Vec::new();
        while s < length_m {
            let goal = noise.uniform(25.0, 75.0_f64).to_radians()
                * if heading.abs() < 0.2 { noise.pick(&[-1.0, 1.0]) } else { -heading.signum() };
            let radius_m = noise.uniform(22.0, 120.0);
            let straight_m = noise.uniform(20.0, 160.0);
            let turn = turn(goal - heading, radius_m);
            heading += turn.iter().map(bend).sum::<f64>();
            pieces.extend(turn);
            pieces.push(level(straight_m));
            s = pieces.iter().map(|p| p.length_m).sum();
            if straight_m > 90.0 {
                stop_lines.push(s - 30.0);
            }
        }
        Road { stop_lines_m: stop_lines, ..Road::from_pieces(&pieces) }
    }

    /// A road of given curvature; lengths are rounded to half metres. No stop lines.
    pub fn from_pieces(pieces: &[Piece]) -> Self {
        let mut now = RoadPoint { position_m: DVec2::ZERO, heading_rad: 0.0, curvature_per_m: 0.0 };
        let mut points = Vec::new();
        for piece in pieces {
            let steps = (piece.length_m / STEP_M).round().max(1.0);
            let slope = (piece.end_per_m - piece.start_per_m) / steps;
            for i in 0..steps as usize {
                now.curvature_per_m = piece.start_per_m + slope * i as f64;
                points.push(now);
                now = ahead(&now, slope / STEP_M, STEP_M);
            }
        }
        points.push(now);
        Road { points, stop_lines_m: Vec::new() }
    }

    /// Arc length of the whole road, m.
    pub fn length_m(&self) -> f64 {
        (self.points.len() - 1) as f64 * STEP_M
    }

    pub fn stop_lines_m(&self) -> &[f64] {
        &self.stop_lines_m
    }

    /// The centre line at arc length `s_m`; straight on beyond both ends.
    pub fn at(&self, s_m: f64) -> RoadPoint {
        let i = ((s_m / STEP_M).max(0.0) as usize).min(self.points.len() - 2);
        let (from, to) = (&self.points[i], &self.points[i + 1]);
        let slope = (to.curvature_per_m - from.curvature_per_m) / STEP_M;
        let ds = s_m - i as f64 * STEP_M;
        if (0.0..=STEP_M).contains(&ds) {
            return ahead(from, slope, ds);
        }
        let end = if ds < 0.0 { from } else { to };
        let ds = if ds < 0.0 { ds } else { ds - STEP_M };
        ahead(&RoadPoint { curvature_per_m: 0.0, ..*end }, 0.0, ds)
    }

    /// A position beside the centre line, world frame, m.
    pub fn place(&self, s_m: f64, lateral_m: f64) -> DVec2 {
        let point = self.at(s_m);
        point.position_m + lateral_m * DVec2::from_angle(point.heading_rad).perp()
    }

    /// Arc length and lateral distance of a world position, looking at the whole road.
    pub fn project(&self, position_m: DVec2) -> (f64, f64) {
        self.project_within(position_m, 0.0, self.length_m())
    }

    /// The same for a position whose nearest point is known to lie between two arc lengths.
    pub fn project_within(&self, position_m: DVec2, from_m: f64, to_m: f64) -> (f64, f64) {
        const COARSE: usize = 8;
        let last = self.points.len() - 1;
        let first = ((from_m / STEP_M).max(0.0) as usize).min(last);
        let end = ((to_m / STEP_M).max(0.0) as usize).min(last);
        let mut nearest = (f64::INFINITY, first);
        for i in (first..=end).step_by(COARSE) {
            let distance = self.points[i].position_m.distance_squared(position_m);
            if distance < nearest.0 {
                nearest = (distance, i);
            }
        }
        self.project_near(position_m, nearest.1 as f64 * STEP_M)
    }

    /// The same from a guess of the arc length, a few metres off at most.
    pub fn project_near(&self, position_m: DVec2, guess_m: f64) -> (f64, f64) {
        let mut s = guess_m;
        let mut lateral = 0.0;
        for _ in 0..3 {
            let point = self.at(s);
            let tangent = DVec2::from_angle(point.heading_rad);
            let offset = position_m - point.position_m;
            lateral = tangent.perp_dot(offset);
            // Newton's step, with the bend of the road kept away from its pole.
            s += tangent.dot(offset) / (1.0 - point.curvature_per_m * lateral).max(0.2);
        }
        (s, lateral)
    }

    /// What may be driven at arc length `s_m`, m/s, from the curvature there.
    pub fn speed_limit_mps(&self, s_m: f64) -> f64 {
        let curvature = self.at(s_m).curvature_per_m.abs();
        (LATERAL_MPS2 / curvature.max(1e-6)).sqrt().min(SPEED_LIMIT_MPS)
    }

    /// What lies on the ground at a place of the road.
    pub fn surface(&self, s_m: f64, lateral_m: f64) -> Surface {
        let half_line = LINE_WIDTH_M / 2.0;
        let on_edge_line = (lateral_m.abs() - LANE_WIDTH_M).abs() < half_line;
        let on_dash = lateral_m.abs() < half_line && s_m.rem_euclid(DASH_PERIOD_M) < DASH_M;
        if on_edge_line || on_dash || self.on_stop_line(s_m, lateral_m) {
            Surface::Marking
        } else if lateral_m.abs() < LANE_WIDTH_M + SHOULDER_M {
            Surface::Asphalt
        } else {
            Surface::Grass
        }
    }

    fn on_stop_line(&self, s_m: f64, lateral_m: f64) -> bool {
        (-LANE_WIDTH_M..0.0).contains(&lateral_m)
            && self.stop_lines_m.iter().any(|line| (0.0..STOP_LINE_DEPTH_M).contains(&(s_m - line)))
    }
}

/// One step along linear curvature: the heading exactly, the position by the middle heading.
fn ahead(from: &RoadPoint, slope_per_m2: f64, ds_m: f64) -> RoadPoint {
    let heading =
        |ds: f64| from.heading_rad + ds * (from.curvature_per_m + slope_per_m2 * ds / 2.0);
    RoadPoint {
        position_m: from.position_m + ds_m * DVec2::from_angle(heading(ds_m / 2.0)),
        heading_rad: heading(ds_m),
        curvature_per_m: from.curvature_per_m + slope_per_m2 * ds_m,
    }
}

fn level(length_m: f64) -> Piece {
    piece(length_m, 0.0, 0.0)
}

fn piece(length_m: f64, start_per_m: f64, end_per_m: f64) -> Piece {
    Piece { length_m: (length_m / STEP_M).round() * STEP_M, start_per_m, end_per_m }
}

fn bend(piece: &Piece) -> f64 {
    piece.length_m * (piece.start_per_m + piece.end_per_m) / 2.0
}

/// Into a curve, round it and out again; together they turn by about `angle_rad`.
fn turn(angle_rad: f64, radius_m: f64) -> [Piece; 3] {
    // A transition turns by half of what the arc of its length would.
    let transition_m = (0.6 * radius_m).min(radius_m * angle_rad.abs() / 2.0);
    let arc_m = (radius_m * angle_rad.abs() - transition_m).max(STEP_M);
    let curvature = angle_rad.signum() / radius_m;
    [
        piece(transition_m.max(STEP_M), 0.0, curvature),
        piece(arc_m, curvature, curvature),
        piece(transition_m.max(STEP_M), curvature, 0.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Purpose;

    fn road() -> Road {
        Road::generate(&mut Noise::new(3, 0, Purpose::Road), 3000.0)
    }

    #[test]
    fn curvature_integrates_to_heading_and_heading_to_position() {
        let road = road();
        let ds = 0.01;
        let (mut heading, mut position) = (0.0, DVec2::ZERO);
        for i in 0..(road.length_m() / ds) as usize {
            let middle = road.at((i as f64 + 0.5) * ds);
            heading += ds * middle.curvature_per_m;
            position += ds * DVec2::from_angle(middle.heading_rad);
        }
        let end = road.at(road.length_m());
        assert!((heading - end.heading_rad).abs() < 1e-3, "{heading} {end:?}");
        assert!(position.distance(end.position_m) < 0.05, "{position} {end:?}");
    }

    #[test]
    fn curves_go_both_ways_and_curvature_never_jumps() {
        let road = road();
        let curvature: Vec<f64> = road.points.iter().map(|p| p.curvature_per_m).collect();
        assert!(curvature.iter().any(|k| *k > 0.01) && curvature.iter().any(|k| *k < -0.01));
        let step = curvature.windows(2).map(|k| (k[1] - k[0]).abs()).fold(0.0, f64::max);
        assert!(step < 0.01, "{step}");
    }

    #[test]
    fn a_place_on_the_road_projects_back_onto_itself() {
        let road = road();
        for i in 0..290 {
            let (s, lateral) = (10.0 * f64::from(i) + 0.3, f64::from(i % 13) - 6.0);
            let (back_s, back_lateral) = road.project(road.place(s, lateral));
            assert!((s - back_s).abs() < 0.02, "{s} {back_s}");
            assert!((lateral - back_lateral).abs() < 0.01, "{lateral} {back_lateral}");
        }
    }

    #[test]
    fn the_road_keeps_clear_of_itself() {
        let points = road().points;
        for (i, a) in points.iter().enumerate().step_by(10) {
            for b in points.iter().skip(i + 160).step_by(10) {
                assert!(a.position_m.distance(b.position_m) > 12.0);
            }
        }
    }
}
