//! Courses: reference lines made of pieces whose headings join.
//!
//! Map frame: x east, y north, metres; headings in radians, anticlockwise from east.

use std::f64::consts::PI;

use glam::DVec2;

use crate::{
    dataset::ego::wrap_angle,
    map::reference_line::{Piece, Shape},
};

/// Pieces shorter than this are what rounding leaves over, m.
const SHORTEST_M: f64 = 1e-6;

/// A fillet needs this much of a tangent at both ends, m.
const SHORTEST_TANGENT_M: f64 = 0.5;

/// Directions closer than this have no corner between them, rad.
const PARALLEL_RAD: f64 = 0.05;

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
        Pose { heading_rad: wrap_angle(self.heading_rad + PI), ..*self }
    }
}

/// A corner that a course rounds off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corner {
    pub at_m: DVec2,
    pub radius_m: f64,
    /// Length of the spirals that lead into the arc and out of it, m; 0 for none.
    pub spiral_m: f64,
}

/// A reference line; at least one piece, each beginning where the one before ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Course {
    pieces: Vec<Piece>,
    end: Pose,
}

impl Course {
    /// Nothing yet, from a pose on.
    fn from(start: Pose) -> Course {
        Course { pieces: Vec::new(), end: start }
    }

    /// From one point to another, round corners between them.
    ///
    /// # Errors
    ///
    /// What does not fit, in words.
    pub fn through(from_m: DVec2, corners: &[Corner], to_m: DVec2) -> Result<Course, String> {
        let points: Vec<DVec2> =
            [from_m].into_iter().chain(corners.iter().map(|c| c.at_m)).chain([to_m]).collect();
        let heading_rad = (points[1] - points[0]).to_angle();
        let mut course = Course::from(Pose { position_m: from_m, heading_rad });
        for (corner, ends) in corners.iter().zip(points[1..].windows(2)) {
            let turn_rad = wrap_angle((ends[1] - ends[0]).to_angle() - course.end.heading_rad);
            let Corner { at_m, radius_m, spiral_m } = *corner;
            let bend = turn_rad.signum() / radius_m;
            let arc_m = radius_m * turn_rad.abs() - spiral_m;
            let line_m = course.ahead_m(at_m) - tangent_m(turn_rad, corner);
            if arc_m < 0.0 || line_m < -SHORTEST_M {
                return Err(format!("the corner at ({}, {}) has no room", at_m.x, at_m.y));
            }
            course.push(line_m, 0.0, 0.0);
            course.push(spiral_m, 0.0, bend);
            course.push(arc_m, bend, bend);
            course.push(spiral_m, bend, 0.0);
        }
        let last_m = course.ahead_m(to_m);
        if last_m < -SHORTEST_M {
            return Err(format!("the last corner before ({}, {}) has no room", to_m.x, to_m.y));
        }
        course.push(last_m, 0.0, 0.0);
        Ok(course)
    }

    /// From one pose to another: a fillet where their tangents meet between them, else a cubic.
    pub fn joining(from: Pose, to: Pose) -> Course {
        let turn_rad = wrap_angle(to.heading_rad - from.heading_rad);
        let chord_m = to.position_m - from.position_m;
        let sine = from.ahead().perp_dot(to.ahead());
        // Distances of both ends from the point where the tangents meet.
        let before_m = chord_m.perp_dot(to.ahead()) / sine;
        let behind_m = from.ahead().perp_dot(chord_m) / sine;
        let aside_m = chord_m.perp_dot(from.ahead());
        let mut course = Course::from(from);
        if turn_rad.abs() < 1e-7 && aside_m.abs() < SHORTEST_M {
            course.push(chord_m.length(), 0.0, 0.0);
        } else if turn_rad.abs() > PARALLEL_RAD && before_m.min(behind_m) > SHORTEST_TANGENT_M {
            let tangent_m = before_m.min(behind_m);
            let radius_m = tangent_m / (turn_rad.abs() / 2.0).tan();
            let bend = turn_rad.signum() / radius_m;
            course.push(before_m - tangent_m, 0.0, 0.0);
            course.push(radius_m * turn_rad.abs(), bend, bend);
            course.push(behind_m - tangent_m, 0.0, 0.0);
        } else {
            course.add(cubic(from, to));
        }
        course
    }

    /// The pieces, by `s`.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Arc length of the whole, m.
    pub fn length_m(&self) -> f64 {
        self.pieces.last().map_or(0.0, |piece| piece.s_m + piece.length_m)
    }

    /// The part of a course of lines, arcs and spirals between two arc lengths.
    pub fn cut(&self, from_m: f64, to_m: f64) -> Course {
        let mut part: Option<Course> = None;
        for piece in &self.pieces {
            let low_m = (from_m - piece.s_m).max(0.0);
            let high_m = (to_m - piece.s_m).min(piece.length_m);
            if high_m - low_m > SHORTEST_M {
                let bend = |at_m: f64| piece.at(at_m).curvature_per_m;
                let part = part.get_or_insert_with(|| Course::from(pose(piece, low_m)));
                part.push(high_m - low_m, bend(low_m), bend(high_m));
            }
        }
        part.unwrap_or_else(|| Course::from(self.start()))
    }

    /// Where the course begins.
    pub fn start(&self) -> Pose {
        self.pieces.first().map_or(self.end, |piece| pose(piece, 0.0))
    }

    /// Where the course ends.
    pub fn end(&self) -> Pose {
        self.end
    }

    /// Places all along the course, its ends among them, every 5 m or closer.
    pub fn places_m(&self) -> impl Iterator<Item = DVec2> + '_ {
        self.pieces.iter().flat_map(|piece| {
            let steps = (piece.length_m / 5.0).ceil() as u32;
            let at_m = move |i: u32| piece.length_m * f64::from(i) / f64::from(steps);
            (0..=steps).map(move |i| piece.at(at_m(i)).position_m)
        })
    }

    /// How far ahead of the end a place lies, m.
    fn ahead_m(&self, place_m: DVec2) -> f64 {
        (place_m - self.end.position_m).dot(self.end.ahead())
    }

    /// Go on with a line, an arc or a spiral; curvatures in 1/m.
    fn push(&mut self, length_m: f64, start_per_m: f64, end_per_m: f64) {
        if length_m <= SHORTEST_M {
            return;
        }
        let shape = if start_per_m != end_per_m {
            Shape::Spiral { start_per_m, end_per_m }
        } else if start_per_m != 0.0 {
            Shape::Arc { curvature_per_m: start_per_m }
        } else {
            Shape::Line
        };
        let Pose { position_m, heading_rad } = self.end;
        self.add(Piece { s_m: self.length_m(), length_m, start_m: position_m, heading_rad, shape });
    }

    fn add(&mut self, piece: Piece) {
        self.end = pose(&piece, piece.length_m);
        self.pieces.push(piece);
    }
}

fn pose(piece: &Piece, ds_m: f64) -> Pose {
    let point = piece.at(ds_m);
    Pose { position_m: point.position_m, heading_rad: wrap_angle(point.heading_rad) }
}

/// How far before its corner a turn begins, m.
fn tangent_m(turn_rad: f64, corner: &Corner) -> f64 {
    let Corner { radius_m, spiral_m, .. } = *corner;
    let mut spiral = Course::from(Pose { position_m: DVec2::ZERO, heading_rad: 0.0 });
    spiral.push(spiral_m, 0.0, 1.0 / radius_m);
    let Pose { position_m, heading_rad } = spiral.end();
    // The circle is moved inwards by the spiral, and its centre lies ahead of the spiral's start.
    let (sine, cosine) = heading_rad.sin_cos();
    let inwards_m = position_m.y - radius_m * (1.0 - cosine);
    let ahead_m = position_m.x - radius_m * sine;
    (radius_m + inwards_m) * (turn_rad.abs() / 2.0).tan() + ahead_m
}

/// The cubic that leaves one pose and arrives at another, with handles as long as its chord.
fn cubic(from: Pose, to: Pose) -> Piece {
    const CHORDS: u32 = 512;
    let into = DVec2::from_angle(-from.heading_rad);
    let end = into.rotate(to.position_m - from.position_m);
    let (leaves, arrives) = (end.length() * DVec2::X, end.length() * into.rotate(to.ahead()));
    let [a, b] = [3.0 * end - 2.0 * leaves - arrives, leaves + arrives - 2.0 * end];
    let place_m = |p: f64| p * (leaves + p * (a + p * b));
    let chord_m = |i: u32| {
        let share = |i: u32| f64::from(i) / f64::from(CHORDS);
        place_m(share(i)).distance(place_m(share(i + 1)))
    };
    Piece {
        s_m: 0.0,
        length_m: (0..CHORDS).map(chord_m).sum(),
        start_m: from.position_m,
        heading_rad: from.heading_rad,
        shape: Shape::ParamPoly3 {
            u: [0.0, leaves.x, a.x, b.x],
            v: [0.0, leaves.y, a.y, b.y],
            p_end: 1.0,
        },
    }
}
