//! Reference lines against numerical integration, and what holds of any of them.

use std::f64::consts::FRAC_PI_2;

use glam::DVec2;
use pmp::map::{
    profile::{Cubic, Profile},
    reference_line::{LinePoint, Piece, ReferenceLine, Shape},
};
use proptest::prelude::*;

fn piece(length_m: f64, shape: Shape) -> Piece {
    Piece { s_m: 0.0, length_m, start_m: DVec2::new(12.0, -7.0), heading_rad: 0.4, shape }
}

/// Runge-Kutta over the curvature, in steps of a centimetre at most.
fn integrated(length_m: f64, curvature: impl Fn(f64) -> f64) -> (DVec2, f64) {
    let steps = (length_m / 0.01).ceil();
    let ds = length_m / steps;
    let (mut position, mut heading) = (DVec2::new(12.0, -7.0), 0.4);
    for step in 0..steps as usize {
        let s = step as f64 * ds;
        let (k0, k1, k2) = (curvature(s), curvature(s + ds / 2.0), curvature(s + ds));
        let middle = heading + ds / 24.0 * (5.0 * k0 + 8.0 * k1 - k2);
        let end = heading + ds / 6.0 * (k0 + 4.0 * k1 + k2);
        let directions = [heading, middle, end].map(DVec2::from_angle);
        position += ds / 6.0 * (directions[0] + 4.0 * directions[1] + directions[2]);
        heading = end;
    }
    (position, heading)
}

/// A piece's heading and curvature are what its positions say, and `s` is its arc length.
fn check_derivatives(piece: &Piece, at_m: f64) -> Result<(), TestCaseError> {
    const H: f64 = 1e-4;
    let [before, here, after]: [LinePoint; 3] = [at_m - H, at_m, at_m + H].map(|s| piece.at(s));
    let tangent = (after.position_m - before.position_m) / (2.0 * H);
    prop_assert!((tangent.length() - 1.0).abs() < 1e-6, "speed {}", tangent.length());
    let off_rad = tangent.angle_to(DVec2::from_angle(here.heading_rad));
    prop_assert!(off_rad.abs() < 1e-6, "heading off by {off_rad}");
    let turned =
        DVec2::from_angle(before.heading_rad).angle_to(DVec2::from_angle(after.heading_rad));
    prop_assert!((turned / (2.0 * H) - here.curvature_per_m).abs() < 1e-4);
    Ok(())
}

proptest! {
    #[test]
    fn spirals_are_their_integral(
        length_m in 1.0..150.0_f64, start in -0.15..0.15_f64, end in -0.15..0.15_f64,
    ) {
        let spiral = piece(length_m, Shape::Spiral { start_per_m: start, end_per_m: end });
        let (position, heading) =
            integrated(length_m, |s| start + (end - start) * s / length_m);
        let ours = spiral.at(length_m);
        prop_assert!(ours.position_m.distance(position) < 1e-6, "{}", ours.position_m - position);
        prop_assert!((ours.heading_rad - heading).abs() < 1e-9);
        check_derivatives(&spiral, 0.6 * length_m)?;
    }

    #[test]
    fn arcs_are_circles_and_spirals_of_one_curvature(
        length_m in 1.0..100.0_f64, curvature in -0.2..0.2_f64, share in 0.0..1.0_f64,
    ) {
        let arc = piece(length_m, Shape::Arc { curvature_per_m: curvature });
        let same = Shape::Spiral { start_per_m: curvature, end_per_m: curvature };
        let (a, b) = (arc.at(share * length_m), piece(length_m, same).at(share * length_m));
        prop_assert!(a.position_m.distance(b.position_m) < 1e-9);
        if curvature.abs() > 1e-3 {
            let centre = arc.start_m + DVec2::from_angle(0.4 + FRAC_PI_2) / curvature;
            prop_assert!((a.position_m.distance(centre) - 1.0 / curvature.abs()).abs() < 1e-8);
        }
        check_derivatives(&arc, share * length_m)?;
    }

    #[test]
    fn cubics_are_measured_by_arc_length(
        length_m in 5.0..80.0_f64, bend in -0.6..0.6_f64, twist in -0.6..0.6_f64,
        share in 0.05..0.95_f64,
    ) {
        let v = [0.0, 0.0, bend / length_m, twist / length_m.powi(2)];
        let poly = piece(length_m, Shape::Poly3 { v });
        check_derivatives(&poly, share * length_m)?;
        // The same curve with parameters: u is the parameter times the length.
        let u = [0.0, length_m, 0.0, 0.0];
        let v = [0.0, 0.0, bend * length_m, twist * length_m];
        let normal = Shape::ParamPoly3 { u, v, p_end: 1.0 };
        let whole = integrated_length(|p| {
            DVec2::new(length_m, length_m * (2.0 * bend * p + 3.0 * twist * p * p))
        });
        let curve = piece(whole, normal);
        check_derivatives(&curve, share * whole)?;
        prop_assert!(curve.at(share * whole).position_m.distance(poly.at(share * whole).position_m) < 1e-6);
        let end = curve.start_m + DVec2::from_angle(0.4).rotate(DVec2::new(u[1], v[2] + v[3]));
        prop_assert!(curve.at(whole).position_m.distance(end) < 1e-6);
    }

    #[test]
    fn pieces_that_meet_make_a_line_without_jumps(
        lengths in prop::collection::vec(1.0..40.0_f64, 2..6),
        bends in prop::collection::vec(-0.1..0.1_f64, 7),
    ) {
        let mut pieces: Vec<Piece> = Vec::new();
        let (mut s_m, mut start_m, mut heading_rad) = (0.0, DVec2::ZERO, 1.0);
        for (i, length_m) in lengths.iter().enumerate() {
            let shape = Shape::Spiral { start_per_m: bends[i], end_per_m: bends[i + 1] };
            let next = Piece { s_m, length_m: *length_m, start_m, heading_rad, shape };
            let end = next.at(*length_m);
            (s_m, start_m, heading_rad) = (s_m + length_m, end.position_m, end.heading_rad);
            pieces.push(next);
        }
        let joints: Vec<f64> = pieces.iter().map(|piece| piece.s_m).collect();
        let line = ReferenceLine::new(pieces).unwrap();
        for joint in joints {
            let (before, after) = (line.at(joint - 1e-7), line.at(joint + 1e-7));
            prop_assert!(before.position_m.distance(after.position_m) < 1e-6);
            prop_assert!((before.heading_rad - after.heading_rad).abs() < 1e-6);
            prop_assert!((before.curvature_per_m - after.curvature_per_m).abs() < 1e-6);
        }
    }

    #[test]
    fn a_cubic_is_the_same_from_any_start(
        k in prop::array::uniform4(-2.0..2.0_f64), start in -5.0..5.0_f64, at in -5.0..5.0_f64,
    ) {
        let cubic = Cubic { start_m: 1.0, a: k[0], b: k[1], c: k[2], d: k[3] };
        let moved = cubic.starting_at(start);
        prop_assert!((cubic.at(at) - moved.at(at)).abs() < 1e-9);
        prop_assert!((cubic.slope_at(at) - moved.slope_at(at)).abs() < 1e-9);
        let slope = (cubic.at(at + 1e-5) - cubic.at(at - 1e-5)) / 2e-5;
        prop_assert!((slope - cubic.slope_at(at)).abs() < 1e-5);
    }
}

/// Length of a curve over a parameter from 0 to 1, by Simpson's rule.
fn integrated_length(derivative: impl Fn(f64) -> DVec2) -> f64 {
    const STEPS: usize = 2000;
    let weight = |i: usize| match i {
        0 | STEPS => 1.0,
        i if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let speed = |i: usize| derivative(i as f64 / STEPS as f64).length();
    (0..=STEPS).map(|i| weight(i) * speed(i)).sum::<f64>() / (3 * STEPS) as f64
}

#[test]
fn a_profile_holds_from_each_start_to_the_next() {
    let constant = |start_m, a| Cubic { start_m, a, ..Cubic::default() };
    let profile = Profile::new(vec![constant(20.0, 3.0), constant(5.0, 1.0), constant(5.0, 2.0)]);
    let values = [4.0, 5.0, 19.9, 20.0, 90.0].map(|s| profile.at(s));
    assert_eq!(values, [0.0, 2.0, 2.0, 3.0, 3.0]);
}
