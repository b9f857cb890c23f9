//! The state of the world at one instant: what sensors, the expert and the metrics look at.

use glam::DVec2;
use sha2::{Digest, Sha256};

use crate::{
    footprint::Footprint,
    world::{
        ego::Car,
        kind::{VehicleKind, WalkerKind},
        reservation::ActorId,
        streets::Streets,
        traffic::Traffic,
        vehicle::Vehicle,
        walkers::{Seen, Walker, Walkers},
    },
};

/// A vehicle of the traffic.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleState {
    pub id: ActorId,
    pub kind: VehicleKind,
    pub footprint: Footprint,
    /// Of the ground half-way between its axles, and by how much that of the front axle is higher than
    /// that of the rear one, over the way between them on the map.
    pub ground_m: f64,
    pub climb: f64,
    pub height_m: f64,
    /// On the map.
    pub velocity_mps: DVec2,
    pub acceleration_mps2: f64,
    /// Picks a colour, in [0, 1).
    pub colour: f64,
}

/// The vehicles of the traffic as they are now.
pub fn vehicle_states(streets: &Streets, traffic: &Traffic) -> Vec<VehicleState> {
    let state = |vehicle: &Vehicle| {
        let footprint = vehicle.footprint(streets);
        let [front_m, rear_m] = vehicle.axles(streets).map(|axle| axle.height_m);
        VehicleState {
            id: vehicle.id,
            kind: vehicle.model.kind,
            footprint,
            ground_m: 0.5 * (front_m + rear_m),
            climb: (front_m - rear_m) / vehicle.wheelbase_m(),
            height_m: vehicle.height_m,
            velocity_mps: vehicle.velocity_mps(&footprint),
            acceleration_mps2: vehicle.acceleration_mps2,
            colour: vehicle.colour,
        }
    };
    traffic.vehicles.iter().map(state).collect()
}

impl VehicleState {
    /// As people on foot see it.
    pub fn seen(&self) -> Seen {
        let speed_mps = self.velocity_mps.length();
        Seen { footprint: self.footprint, height_m: self.ground_m, speed_mps }
    }
}

/// Somebody on foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkerState {
    pub id: ActorId,
    pub kind: WalkerKind,
    pub footprint: Footprint,
    /// Of the ground below.
    pub ground_m: f64,
    pub velocity_mps: DVec2,
    /// What this one walks or runs with nobody in the way, m/s.
    pub pace_mps: f64,
    /// Way that was gone so far, m.
    pub walked_m: f64,
    /// Stepped out without looking.
    pub is_jaywalking: bool,
    /// On a street, or on the way across.
    pub is_crossing: bool,
    /// Picks colours, in [0, 1).
    pub colour: f64,
}

/// Everybody on foot as they are now.
pub fn walker_states(walkers: &Walkers) -> Vec<WalkerState> {
    let state = |walker: &Walker| WalkerState {
        id: walker.id,
        kind: walker.kind,
        footprint: walker.footprint(),
        ground_m: walker.ground_m(),
        velocity_mps: walker.velocity_mps,
        pace_mps: walker.pace_mps,
        walked_m: walker.walked_m,
        is_jaywalking: walker.is_jaywalking,
        is_crossing: walker.is_crossing(),
        colour: walker.colour,
    };
    walkers.walkers.iter().map(state).collect()
}

/// All that moves, at one instant.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    pub time_s: f64,
    pub ego: Car,
    /// Of the ground below the ego vehicle.
    pub ego_ground_m: f64,
    /// Ascending by id.
    pub vehicles: Vec<VehicleState>,
    /// Ascending by id.
    pub walkers: Vec<WalkerState>,
}

impl Snapshot {
    /// A hash of every number of the state: two worlds that agree in it are the same.
    pub fn hash(&self) -> u64 {
        let ego = &self.ego;
        let [x, y] = ego.position_m.to_array();
        let own =
            [self.time_s, x, y, ego.yaw_rad, ego.speed_mps, ego.steer_rad, ego.throttle, ego.brake];
        hash(&own, &self.vehicles, &self.walkers)
    }

    /// The same world a share of the way to `next`, for those who move: agents live in steps of
    /// 0.1 s, and the ego vehicle in between sees them where they are on their way.
    pub fn towards(&self, next: &Snapshot, share: f64) -> Snapshot {
        let vehicles = self.vehicles.iter().zip(&next.vehicles);
        let walkers = self.walkers.iter().zip(&next.walkers);
        let between = |a: f64, b: f64| a + (b - a) * share;
        Snapshot {
            time_s: between(self.time_s, next.time_s),
            ego: self.ego,
            ego_ground_m: self.ego_ground_m,
            vehicles: vehicles
                .map(|(a, b)| VehicleState {
                    footprint: a.footprint.towards(&b.footprint, share),
                    ground_m: between(a.ground_m, b.ground_m),
                    climb: between(a.climb, b.climb),
                    ..*b
                })
                .collect(),
            walkers: walkers
                .map(|(a, b)| WalkerState {
                    footprint: a.footprint.towards(&b.footprint, share),
                    ground_m: between(a.ground_m, b.ground_m),
                    walked_m: between(a.walked_m, b.walked_m),
                    ..*b
                })
                .collect(),
        }
    }
}

/// A hash of numbers and of every number of these bodies.
pub fn hash(numbers: &[f64], vehicles: &[VehicleState], walkers: &[WalkerState]) -> u64 {
    let mut hasher = Sha256::new();
    let mut add = |values: &[f64]| values.iter().for_each(|v| hasher.update(v.to_le_bytes()));
    add(numbers);
    let mut add_body = |id: ActorId, footprint: &Footprint, velocity_mps: DVec2| {
        let Footprint { centre_m, forward, half_m } = footprint;
        let pairs = [*centre_m, *forward, *half_m, velocity_mps];
        add(&[f64::from(id)]);
        pairs.iter().for_each(|pair| add(&pair.to_array()));
    };
    for vehicle in vehicles {
        add_body(vehicle.id, &vehicle.footprint, vehicle.velocity_mps);
    }
    for walker in walkers {
        add_body(walker.id, &walker.footprint, walker.velocity_mps);
    }
    let digest = hasher.finalize();
    digest.iter().take(8).fold(0, |hash, byte| hash << 8 | u64::from(*byte))
}
