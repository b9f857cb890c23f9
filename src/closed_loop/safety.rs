//! Time to collision: when bodies would touch if all kept their velocities (nuPlan's metric).

use glam::DVec2;

use crate::{
    footprint::Footprint,
    world::{snapshot::Snapshot, streets::LEVEL_M},
};

/// Bodies are moved on in steps of this, s, so often.
const STEP_S: f64 = 0.1;
const STEPS: usize = 30;

/// Less than this is short, s (nuPlan's bound).
pub const SHORT_S: f64 = 0.95;

/// A car that is slower stands, m/s: nobody collides with it by its own doing.
const STANDS_MPS: f64 = 0.05;

/// Seconds until the ego vehicle would touch somebody who is ahead of its middle, if both kept their
/// velocities and headings; `None` if not within 3 s.
pub fn time_to_collision_s(snapshot: &Snapshot) -> Option<f64> {
    let ego = &snapshot.ego;
    if ego.speed_mps < STANDS_MPS {
        return None;
    }
    let (own, own_mps) = (ego.footprint(), ego.velocity_world_mps());
    let horizon_s = STEP_S * STEPS as f64;
    let comes_near = |body: &Footprint, velocity_mps: DVec2| {
        let between_m = body.centre_m - own.centre_m;
        let reach_m = own.radius_m() + body.radius_m();
        let closing_mps = (velocity_mps - own_mps).length();
        between_m.dot(own.forward) > 0.0 && between_m.length() < reach_m + closing_mps * horizon_s
    };
    let is_level = |ground_m: f64| (ground_m - snapshot.ego_ground_m).abs() < LEVEL_M;
    let vehicles = snapshot.vehicles.iter().filter(|v| is_level(v.ground_m));
    let walkers = snapshot.walkers.iter().filter(|w| is_level(w.ground_m));
    let bodies = vehicles.map(|v| (v.footprint, v.velocity_mps));
    let bodies = bodies.chain(walkers.map(|w| (w.footprint, w.velocity_mps)));
    let near: Vec<_> = bodies.filter(|(body, mps)| comes_near(body, *mps)).collect();
    let moved = |body: &Footprint, velocity_mps: DVec2, after_s: f64| Footprint {
        centre_m: body.centre_m + velocity_mps * after_s,
        ..*body
    };
    (0..=STEPS).map(|step| step as f64 * STEP_S).find(|after_s| {
        let own = moved(&own, own_mps, *after_s);
        near.iter().any(|(body, mps)| own.touches(&moved(body, *mps, *after_s)))
    })
}
