//! Courses: reference lines made of pieces whose headings join.
//!
//! Map frame: x east, y north, metres; headings in radians, anticlockwise from east.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

/// Pieces shorter than this are what rounding leaves over, m.
const SHORTEST_M: f64 = 1e-6;

/// Abscissas and weights of the five-point Gauss-Legendre rule on [0, 1].
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

/// A place and the direction of travel there, map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub position_m: DVec2,
    pub heading_rad: f64,
}

impl Pose {
    /// The unit vector of the heading.
    pub fn ahead(&self) -> DVec2 {
        DVec2::from_angle(self.heading_rad)
    }

    /// The pose moved sideways, positive to the left.
    pub fn shifted(&self, left_m: f64) -> Pose {
        Pose { position_m: self.position_m + left_m * self.ahead().perp(), ..*self }
    }

    /// The same place, looking back.
    pub fn reversed(&self) -> Pose {
        Pose { heading_rad: self.heading_rad + PI, ..*self }
    }
}

/// The shape of a piece.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Curvature in 1/m, positive to the left, changes linearly: a line, an arc or a spiral.
    Clothoid { start_per_m: f64, end_per_m: f64 },
    /// Polynomials of a parameter from 0 to 1 in the frame of the piece's start, m.
    Cubic { forward_m: [f64; 4], left_m: [f64; 4] },
}

/// A piece of a course.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    pub start: Pose,
    pub length_m: f64,
    pub shape: Shape,
}

impl Piece {
    /// Where the piece ends.
    pub fn end(&self) -> Pose {
        self.at(1.0)
    }

    /// The pose at a share of the piece, 0 to 1.
    fn at(&self, share: f64) -> Pose {
        match self.shape {
            Shape::Clothoid { start_per_m, end_per_m } => {
                let slope = (end_per_m - start_per_m) / self.length_m;
                along(self.start, start_per_m, slope, share * self.length_m)
            }
            Shape::Cubic { forward_m, left_m } => {
                let value = |[a, b, c, d]: [f64; 4]| a + share * (b + share * (c + share * d));
                let slope = |[_, b, c, d]: [f64; 4]| b + share * (2.0 * c + share * 3.0 * d);
                let local = DVec2::new(value(forward_m), value(left_m));
                Pose {
                    position_m: self.start.position_m + self.start.ahead().rotate(local),
                    heading_rad: self.start.heading_rad + slope(left_m).atan2(slope(forward_m)),
                }
            }
        }
    }
}

/// The pose `length_m` on, when curvature begins at `per_m` and grows by `slope` per metre.
fn along(start: Pose, per_m: f64, slope: f64, length_m: f64) -> Pose {
    let heading = |s: f64| start.heading_rad + s * (per_m + 0.5 * slope * s);
    let sharpest = per_m.abs().max((per_m + slope * length_m).abs());
    let steps = (sharpest * length_m / 0.3).ceil().max(1.0);
    let step_m = length_m / steps;
    let mut position_m = start.position_m;
    for i in 0..steps as u32 {
        let from_m = f64::from(i) * step_m;
        for (at, weight) in GAUSS {
            position_m += step_m * weight * DVec2::from_angle(heading(from_m + at * step_m));
        }
    }
    Pose { position_m, heading_rad: heading(length_m) }
}

/// A reference line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course(pub Vec<Piece>);

/// A corner that a course rounds off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    pub at_m: DVec2,
    pub radius_m: f64,
    /// Length of the spirals that lead into the arc and out of it, m; 0 for none.
    pub spiral_m: f64,
}

impl Course {
    /// From one point to another, round corners between them.
    ///
    /// # Errors
    ///
    /// What does not fit, in words.
    pub fn through(from_m: DVec2, corners: &[Corner], to_m: DVec2) -> Result<Course, String> {
        let points: Vec<DVec2> =
            [from_m].into_iter().chain(corners.iter().map(|c| c.at_m)).chain([to_m]).collect();
        let first = (points[1] - points[0]).to_angle();
        let mut course = Course::default();
        let mut now = Pose { position_m: from_m, heading_rad: first };
        for (i, corner) in corners.iter().enumerate() {
            let leaves = (points[i + 2] - points[i + 1]).to_angle();
            let turn = wrapped(leaves - now.heading_rad);
            let Corner { at_m, radius_m, spiral_m } = *corner;
            let bend = 1.0 / (radius_m * turn.signum());
            let eased = spiral_m / (2.0 * radius_m);
            let arc_m = radius_m * (turn.abs() - 2.0 * eased);
            let line_m = (at_m - now.position_m).dot(now.ahead()) - tangent_m(turn, corner);
            if arc_m < 0.0 || line_m < -SHORTEST_M {
                return Err(format!("the corner at ({}, {}) has no room", at_m.x, at_m.y));
            }
            now = course.push(now, line_m, 0.0, 0.0);
            now = course.push(now, spiral_m, 0.0, bend);
            now = course.push(now, arc_m, bend, bend);
            now = course.push(now, spiral_m, bend, 0.0);
        }
        let last_m = (to_m - now.position_m).dot(now.ahead());
        if last_m < -SHORTEST_M {
            return Err(format!("the last corner before ({}, {}) has no room", to_m.x, to_m.y));
        }
        course.push(now, last_m, 0.0, 0.0);
        Ok(course)
    }

    /// From one pose to another: a fillet where their tangents meet between them, else a cubic.
    pub fn joining(from: Pose, to: Pose) -> Course {
        let turn = wrapped(to.heading_rad - from.heading_rad);
        let chord = to.position_m - from.position_m;
        let sine = from.ahead().perp_dot(to.ahead());
        // Distances of both ends from the point where the tangents meet.
        let before_m = chord.perp_dot(to.ahead()) / sine;
        let behind_m = from.ahead().perp_dot(chord) / sine;
        let is_straight = turn.abs() < 1e-7 && chord.perp_dot(from.ahead()).abs() < 1e-6;
        let mut course = Course::default();
        if is_straight {
            course.push(from, chord.length(), 0.0, 0.0);
        } else if turn.abs() > 0.05 && before_m > 0.5 && behind_m > 0.5 {
            let tangent_m = before_m.min(behind_m);
            let radius_m = tangent_m / (turn.abs() / 2.0).tan();
            let bend = turn.signum() / radius_m;
            let now = course.push(from, before_m - tangent_m, 0.0, 0.0);
            let now = course.push(now, radius_m * turn.abs(), bend, bend);
            course.push(now, behind_m - tangent_m, 0.0, 0.0);
        } else {
            course.0.push(cubic(from, to));
        }
        course
    }

    /// Arc length of the whole, m.
    pub fn length_m(&self) -> f64 {
        self.0.iter().map(|piece| piece.length_m).sum()
    }

    /// The part of a course of lines, arcs and spirals between two arc lengths.
    pub fn cut(&self, from_m: f64, to_m: f64) -> Course {
        let mut part = Course::default();
        let mut s_m = 0.0;
        for piece in &self.0 {
            let low_m = (from_m - s_m).max(0.0);
            let high_m = (to_m - s_m).min(piece.length_m);
            s_m += piece.length_m;
            let Shape::Clothoid { start_per_m, end_per_m } = piece.shape else { continue };
            if high_m - low_m > SHORTEST_M {
                let slope = (end_per_m - start_per_m) / piece.length_m;
                let bend = |at_m: f64| start_per_m + slope * at_m;
                let start = along(piece.start, start_per_m, slope, low_m);
                part.push(start, high_m - low_m, bend(low_m), bend(high_m));
            }
        }
        part
    }

    /// Where the course begins.
    pub fn start(&self) -> Pose {
        self.0[0].start
    }

    /// Where the course ends.
    pub fn end(&self) -> Pose {
        self.0[self.0.len() - 1].end()
    }

    /// Places all along the course, its ends among them, every 5 m or closer.
    pub fn places_m(&self) -> impl Iterator<Item = DVec2> + '_ {
        self.0.iter().flat_map(|piece| {
            let steps = (piece.length_m / 5.0).ceil() as u32;
            (0..=steps).map(move |i| piece.at(f64::from(i) / f64::from(steps)).position_m)
        })
    }

    fn push(&mut self, start: Pose, length_m: f64, start_per_m: f64, end_per_m: f64) -> Pose {
        if length_m <= SHORTEST_M {
            return start;
        }
        let piece = Piece { start, length_m, shape: Shape::Clothoid { start_per_m, end_per_m } };
        self.0.push(piece);
        piece.end()
    }
}

/// How far before its corner a turn begins, m.
fn tangent_m(turn_rad: f64, corner: &Corner) -> f64 {
    let Corner { radius_m, spiral_m, .. } = *corner;
    let origin = Pose { position_m: DVec2::ZERO, heading_rad: 0.0 };
    let spiral = match spiral_m > 0.0 {
        true => along(origin, 0.0, 1.0 / (radius_m * spiral_m), spiral_m),
        false => origin,
    };
    // The circle is moved inwards by the spiral, and its centre lies ahead of the spiral's start.
    let (sine, cosine) = spiral.heading_rad.sin_cos();
    let inwards_m = spiral.position_m.y - radius_m * (1.0 - cosine);
    let ahead_m = spiral.position_m.x - radius_m * sine;
    (radius_m + inwards_m) * (turn_rad.abs() / 2.0).tan() + ahead_m
}

/// The cubic that leaves one pose and arrives at another, with handles as long as its chord.
fn cubic(from: Pose, to: Pose) -> Piece {
    let chord = to.position_m - from.position_m;
    let into = DVec2::from_angle(-from.heading_rad);
    let (end, arrives) = (into.rotate(chord), chord.length() * into.rotate(to.ahead()));
    let leaves = DVec2::new(chord.length(), 0.0);
    let c = 3.0 * end - 2.0 * leaves - arrives;
    let d = leaves + arrives - 2.0 * end;
    let steps = 64;
    let speed = |p: f64| (leaves + 2.0 * p * c + 3.0 * p * p * d).length();
    let length_m = (0..steps)
        .flat_map(|i| {
            GAUSS.map(|(at, weight)| weight * speed((f64::from(i) + at) / f64::from(steps)))
        })
        .sum::<f64>()
        / f64::from(steps);
    let shape =
        Shape::Cubic { forward_m: [0.0, leaves.x, c.x, d.x], left_m: [0.0, leaves.y, c.y, d.y] };
    Piece { start: from, length_m, shape }
}

/// An angle brought into (-pi, pi].
pub fn wrapped(angle_rad: f64) -> f64 {
    PI - (PI - angle_rad).rem_euclid(TAU)
}
