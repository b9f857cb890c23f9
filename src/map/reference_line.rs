//! The line that a road is laid out along, exact at every `s`.

use glam::DVec2;

/// Most heading that one step of quadrature covers, rad: 5 points are then exact to 1e-10.
const STEP_RAD: f64 = 0.25;

/// Most steps of quadrature; a spiral that needs more winds up on itself a hundred times.
const MAX_STEPS: f64 = 4096.0;

/// Nodes and weights of Gauss-Legendre quadrature with 5 points on [-1, 1].
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_1),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_5),
    (0.906_179_845_938_664, 0.236_926_885_056_189_1),
];

/// The shape of a piece in its own frame: it begins at the origin and runs along x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    Line,
    Arc {
        curvature_per_m: f64,
    },
    /// Curvature that changes linearly (clothoid).
    Spiral {
        start_per_m: f64,
        end_per_m: f64,
    },
    /// `v = a + b u + c u^2 + d u^3`.
    Poly3 {
        v: [f64; 4],
    },
    /// `u` and `v` as cubics of `p`, which runs from 0 to `p_end`.
    ParamPoly3 {
        u: [f64; 4],
        v: [f64; 4],
        p_end: f64,
    },
}

/// A stretch of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    pub s_m: f64,
    pub length_m: f64,
    pub start_m: DVec2,
    pub heading_rad: f64,
    pub shape: Shape,
}

/// A point of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinePoint {
    pub position_m: DVec2,
    pub heading_rad: f64,
    /// Positive to the left.
    pub curvature_per_m: f64,
}

/// Pieces by `s`, ascending; at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceLine {
    pieces: Vec<Piece>,
}

impl ReferenceLine {
    /// None without pieces.
    pub fn new(mut pieces: Vec<Piece>) -> Option<Self> {
        pieces.sort_by(|a, b| a.s_m.total_cmp(&b.s_m));
        (!pieces.is_empty()).then_some(ReferenceLine { pieces })
    }

    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// The line at `s_m`; beyond its ends the outer pieces go on.
    pub fn at(&self, s_m: f64) -> LinePoint {
        let after = self.pieces.partition_point(|piece| piece.s_m <= s_m).max(1);
        let piece = &self.pieces[after - 1];
        piece.at(s_m - piece.s_m)
    }
}

impl Piece {
    /// The piece `ds_m` after its start.
    pub fn at(&self, ds_m: f64) -> LinePoint {
        let (offset_m, turn_rad, curvature_per_m) = self.shape.at(ds_m, self.length_m);
        LinePoint {
            position_m: self.start_m + DVec2::from_angle(self.heading_rad).rotate(offset_m),
            heading_rad: self.heading_rad + turn_rad,
            curvature_per_m,
        }
    }
}

impl Shape {
    /// Offset, turn and curvature `ds_m` after the start of a piece of `length_m`.
    fn at(&self, ds_m: f64, length_m: f64) -> (DVec2, f64, f64) {
        match *self {
            Shape::Line => (DVec2::new(ds_m, 0.0), 0.0, 0.0),
            Shape::Arc { curvature_per_m } => {
                (arc(ds_m, curvature_per_m), ds_m * curvature_per_m, curvature_per_m)
            }
            Shape::Spiral { start_per_m, end_per_m } => {
                let slope = if length_m > 0.0 { (end_per_m - start_per_m) / length_m } else { 0.0 };
                spiral(ds_m, start_per_m, slope)
            }
            Shape::Poly3 { v } => {
                let curve = Curve { u: [0.0, 1.0, 0.0, 0.0], v };
                curve.at(curve.parameter_at(ds_m, ds_m))
            }
            Shape::ParamPoly3 { u, v, p_end } => {
                let curve = Curve { u, v };
                // `s` is the share of the curve's own length: exporters' curves and `length`
                // differ by rounding, and pieces must meet.
                let whole_m = curve.length_m(0.0, p_end);
                let share = if length_m > 0.0 { ds_m / length_m } else { 0.0 };
                curve.at(curve.parameter_at(share * whole_m, share * p_end))
            }
        }
    }
}

fn arc(ds_m: f64, curvature_per_m: f64) -> DVec2 {
    // A chord of length 2 sin(turn / 2) / curvature in the middle direction: exact, and stable
    // for curvatures near zero.
    let half = 0.5 * ds_m * curvature_per_m;
    let shrink = if half.abs() < 1e-4 { 1.0 - half * half / 6.0 } else { half.sin() / half };
    ds_m * shrink * DVec2::from_angle(half)
}

fn spiral(ds_m: f64, start_per_m: f64, slope_per_m2: f64) -> (DVec2, f64, f64) {
    let turn = |ds: f64| ds * (start_per_m + 0.5 * slope_per_m2 * ds);
    let curvature_per_m = start_per_m + slope_per_m2 * ds_m;
    let most_rad = ds_m.abs() * start_per_m.abs().max(curvature_per_m.abs());
    let steps = (most_rad / STEP_RAD).ceil().clamp(1.0, MAX_STEPS);
    let step_m = ds_m / steps;
    let mut offset_m = DVec2::ZERO;
    for step in 0..steps as u32 {
        let middle_m = (f64::from(step) + 0.5) * step_m;
        for (node, weight) in GAUSS {
            let heading = DVec2::from_angle(turn(middle_m + 0.5 * step_m * node));
            offset_m += 0.5 * step_m * weight * heading;
        }
    }
    (offset_m, turn(ds_m), curvature_per_m)
}

/// A plane curve of two cubics.
struct Curve {
    u: [f64; 4],
    v: [f64; 4],
}

impl Curve {
    fn value(&self, p: f64) -> DVec2 {
        let cubic = |k: &[f64; 4]| k[0] + p * (k[1] + p * (k[2] + p * k[3]));
        DVec2::new(cubic(&self.u), cubic(&self.v))
    }

    fn derivative(&self, p: f64) -> DVec2 {
        let slope = |k: &[f64; 4]| k[1] + p * (2.0 * k[2] + p * 3.0 * k[3]);
        DVec2::new(slope(&self.u), slope(&self.v))
    }

    fn at(&self, p: f64) -> (DVec2, f64, f64) {
        let second = |k: &[f64; 4]| 2.0 * k[2] + 6.0 * k[3] * p;
        let (first, second) = (self.derivative(p), DVec2::new(second(&self.u), second(&self.v)));
        let speed = first.length();
        let curvature = if speed > 0.0 { first.perp_dot(second) / speed.powi(3) } else { 0.0 };
        (self.value(p), first.to_angle(), curvature)
    }

    fn length_m(&self, from: f64, to: f64) -> f64 {
        const STEPS: u32 = 8;
        let half = 0.5 * (to - from) / f64::from(STEPS);
        let middles = (0..STEPS).map(|step| from + (2.0 * f64::from(step) + 1.0) * half);
        middles
            .flat_map(|middle| GAUSS.map(|(node, weight)| (middle + half * node, weight)))
            .map(|(p, weight)| half * weight * self.derivative(p).length())
            .sum()
    }

    /// The parameter after an arc length of `ds_m`, by Newton's method.
    fn parameter_at(&self, ds_m: f64, guess: f64) -> f64 {
        let mut p = guess;
        for _ in 0..32 {
            let speed = self.derivative(p).length();
            if speed <= 0.0 {
                break;
            }
            let step = (ds_m - self.length_m(0.0, p)) / speed;
            p += step;
            if step.abs() * speed < 1e-10 {
                break;
            }
        }
        p
    }
}
