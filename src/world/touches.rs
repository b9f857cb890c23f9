//! Who touches whom among vehicles and people on foot: every pair, by what they cover.

use std::collections::BTreeMap;

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    footprint::Footprint,
    world::{
        reservation::ActorId,
        snapshot::{VehicleState, WalkerState},
        streets::LEVEL_M,
    },
};

/// A pair that has been apart for so long touches anew, s.
const ANEW_S: f64 = 10.0;

/// Two actors that share ground, when it began.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    pub time_s: f64,
    /// Ascending; at least the first is a vehicle.
    pub actors: [ActorId; 2],
    /// Middle of the first, world frame, m.
    pub position_m: [f64; 2],
    pub speeds_mps: [f64; 2],
}

/// Touches of a run, each pair once per meeting.
#[derive(Clone, Debug, Default)]
pub struct Touches {
    pub between_vehicles: Vec<Touch>,
    pub with_walkers: Vec<Touch>,
    /// When a pair was last seen touching, s.
    last_s: BTreeMap<[ActorId; 2], f64>,
}

/// What a body covers, on its way from left to right of the map.
struct Body {
    actor: ActorId,
    footprint: Footprint,
    ground_m: f64,
    velocity_mps: DVec2,
    is_vehicle: bool,
    /// West and east end of the circle around it, m.
    west_m: f64,
    east_m: f64,
}

impl Touches {
    /// Look at all pairs at one instant.
    pub fn look(&mut self, time_s: f64, vehicles: &[VehicleState], walkers: &[WalkerState]) {
        let body = |actor, footprint: Footprint, ground_m, velocity_mps, is_vehicle| {
            let (x_m, radius_m) = (footprint.centre_m.x, footprint.radius_m());
            let (west_m, east_m) = (x_m - radius_m, x_m + radius_m);
            Body { actor, footprint, ground_m, velocity_mps, is_vehicle, west_m, east_m }
        };
        let vehicles =
            vehicles.iter().map(|v| body(v.id, v.footprint, v.ground_m, v.velocity_mps, true));
        let walkers =
            walkers.iter().map(|w| body(w.id, w.footprint, w.ground_m, w.velocity_mps, false));
        let mut bodies: Vec<Body> = vehicles.chain(walkers).collect();
        bodies.sort_by(|a, b| a.west_m.total_cmp(&b.west_m).then(a.actor.cmp(&b.actor)));
        for (index, a) in bodies.iter().enumerate() {
            for b in bodies[index + 1..].iter().take_while(|b| b.west_m <= a.east_m) {
                let is_level = (a.ground_m - b.ground_m).abs() < LEVEL_M;
                // People may brush past each other.
                let counts = a.is_vehicle || b.is_vehicle;
                if is_level && counts && a.footprint.touches(&b.footprint) {
                    let pair = if a.actor < b.actor { [a, b] } else { [b, a] };
                    self.add(time_s, pair);
                }
            }
        }
    }

    fn add(&mut self, time_s: f64, pair: [&Body; 2]) {
        let actors = pair.map(|body| body.actor);
        let before_s = self.last_s.insert(actors, time_s);
        if before_s.is_some_and(|before_s| time_s - before_s < ANEW_S) {
            return;
        }
        let touch = Touch {
            time_s,
            actors,
            position_m: pair[0].footprint.centre_m.to_array(),
            speeds_mps: pair.map(|body| body.velocity_mps.length()),
        };
        match pair.iter().all(|body| body.is_vehicle) {
            true => self.between_vehicles.push(touch),
            false => self.with_walkers.push(touch),
        }
    }
}
