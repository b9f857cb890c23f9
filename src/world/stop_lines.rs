//! Where vehicles stop before a junction: so far back that a bus can turn past them.

use glam::DVec2;

use crate::{
    footprint::Footprint,
    world::{
        kind::{VEHICLES, VehicleKind, VehicleModel},
        streets::{LaneId, Spot, Streets},
    },
};

/// A queue is looked at in pieces of this length, and moved back by so much at most, m; behind its
/// line a bus still has so much of its lane to stand on.
const PIECE_M: f64 = 1.0;
const FURTHEST_M: f64 = 10.0;
const STAND_M: f64 = 13.0;

/// Half of the width that a queue takes, with room beside it, m.
const QUEUE_HALF_M: f64 = 1.15;

/// Set the stop lines of all lanes that lead into junctions.
pub fn set_back(streets: &mut Streets) {
    let Some(bus) = VEHICLES.iter().find(|model| model.kind == VehicleKind::Bus) else { return };
    for junction in 0..streets.junctions.len() {
        let inside = streets.junctions[junction].lanes.clone();
        let mut approaches: Vec<LaneId> =
            inside.iter().flat_map(|lane| &streets.lanes[*lane].previous).copied().collect();
        approaches.retain(|lane| streets.lanes[*lane].junction.is_none());
        approaches.sort_unstable();
        approaches.dedup();
        for lane in inside {
            let swept = sweep(streets, lane, bus);
            for &approach in &approaches {
                let is_own = streets.lanes[lane].previous.contains(&approach);
                if !is_own {
                    let back_m = clear_of(streets, approach, &swept);
                    let line_m = &mut streets.lanes[approach].line_m;
                    *line_m = line_m.max(back_m);
                }
            }
        }
    }
}

/// What a vehicle covers on its way through a junction, until its rear is out of it.
fn sweep(streets: &Streets, lane: LaneId, model: &VehicleModel) -> Vec<Footprint> {
    let first = |ids: &[LaneId]| ids.first().map(|id| &streets.lanes[*id].course);
    let inside = &streets.lanes[lane];
    let (before, after) = (first(&inside.previous), first(&inside.next));
    let spot = |s_m: f64| -> Spot {
        match (before, after) {
            (Some(before), _) if s_m < 0.0 => before.at(before.length_m() + s_m),
            (_, Some(after)) if s_m > inside.length_m() => after.at(s_m - inside.length_m()),
            _ => inside.course.at(s_m),
        }
    };
    let axle_m = model.wheelbase * model.half_m.x;
    let steps = ((inside.length_m() + 2.0 * model.half_m.x) / PIECE_M) as usize;
    let footprint = |step: usize| {
        let s_m = step as f64 * PIECE_M;
        let (front_m, rear_m) = (spot(s_m + axle_m).position_m, spot(s_m - axle_m).position_m);
        let forward = (front_m - rear_m).normalize_or(DVec2::X);
        Footprint { centre_m: (front_m + rear_m) / 2.0, forward, half_m: model.half_m }
    };
    (0..=steps).map(footprint).collect()
}

/// How far before the end of a lane a queue has to begin not to be touched, m.
fn clear_of(streets: &Streets, approach: LaneId, swept: &[Footprint]) -> f64 {
    let course = &streets.lanes[approach].course;
    let pieces = ((course.length_m() - STAND_M).min(FURTHEST_M) / PIECE_M) as usize;
    let touched = (0..pieces).rev().find(|piece| {
        let spot = course.at(course.length_m() - (*piece as f64 + 0.5) * PIECE_M);
        let half_m = DVec2::new(PIECE_M / 2.0, QUEUE_HALF_M);
        let queue = Footprint { centre_m: spot.position_m, forward: spot.forward, half_m };
        let is_near = |body: &&Footprint| {
            body.centre_m.distance(queue.centre_m) < body.radius_m() + queue.radius_m()
        };
        swept.iter().filter(is_near).any(|body| body.touches(&queue))
    });
    touched.map_or(0.0, |piece| (piece + 1) as f64 * PIECE_M)
}
