//! Convex outlines on the ground: what is driven, walked on or taken.

use glam::DVec2;

use crate::footprint::Footprint;

/// Whether a footprint overlaps a convex outline: no axis separates them.
pub fn overlaps(footprint: &Footprint, outline_m: &[DVec2]) -> bool {
    let own = footprint.corners_m();
    !separates(&own, outline_m) && !separates(outline_m, &own)
}

/// South-west and north-east corner around points, m.
pub fn bounds_m(points_m: &[DVec2]) -> (DVec2, DVec2) {
    points_m.iter().fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(low, high), point| {
        (low.min(*point), high.max(*point))
    })
}

/// Whether an edge of the first outline has all of the other one on its far side.
fn separates(edges_m: &[DVec2], other_m: &[DVec2]) -> bool {
    (0..edges_m.len()).any(|i| {
        let normal = (edges_m[(i + 1) % edges_m.len()] - edges_m[i]).perp();
        let span = |points_m: &[DVec2]| {
            points_m
                .iter()
                .map(|point| point.dot(normal))
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), reach| {
                    (low.min(reach), high.max(reach))
                })
        };
        let ((own_low, own_high), (low, high)) = (span(edges_m), span(other_m));
        own_high <= low || high <= own_low
    })
}

/// The convex hull of points, anticlockwise (Andrew's monotone chain).
pub fn hull_m(mut points_m: Vec<DVec2>) -> Vec<DVec2> {
    points_m.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points_m.dedup();
    let mut hull: Vec<DVec2> = Vec::new();
    for pass in [points_m.clone(), points_m.into_iter().rev().collect()] {
        let base = hull.len();
        for point in pass {
            while hull.len() >= base + 2 {
                let [a, b] = [hull[hull.len() - 2], hull[hull.len() - 1]];
                if (b - a).perp_dot(point - a) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
    }
    hull
}
