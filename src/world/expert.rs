//! The expert: follows its route at about 40 km/h, 15 at junctions, and touches nobody.
//!
//! It sees the state of the world, not its sensors (paper, section III.B).

use glam::DVec2;

use crate::{
    footprint::Footprint,
    noise::{Noise, Purpose},
    policy::Action,
    world::{
        car_following::{Ahead, Idm},
        route::{Route, Waypoint},
        simulation::World,
        snapshot::Snapshot,
        streets::{LEVEL_M, LaneId},
        traffic::STEP_S,
        vehicle::Vehicle,
    },
};

/// How the expert drives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpertConfig {
    /// Wish on a free road and at junctions, m/s.
    pub cruise_mps: f64,
    pub junction_mps: f64,
    /// The junction's speed is reached this far before it, m.
    pub junction_margin_m: f64,
    /// Braking for what is foreseen, m/s2, positive.
    pub foreseen_mps2: f64,
    /// Lateral acceleration in bends, m/s2.
    pub lateral_mps2: f64,
    pub follow: Idm,
    /// From here on braking counts as an emergency, m/s2, positive.
    pub emergency_mps2: f64,
    /// Probability of a steering burst in a decision, while none is on; 0 for clean driving.
    pub burst_chance: f64,
}

impl Default for ExpertConfig {
    fn default() -> ExpertConfig {
        ExpertConfig {
            cruise_mps: 40.0 / 3.6,
            junction_mps: 15.0 / 3.6,
            junction_margin_m: 4.0,
            foreseen_mps2: 2.0,
            lateral_mps2: 2.0,
            follow: Idm {
                acceleration_mps2: 2.0,
                comfort_mps2: 2.0,
                time_gap_s: 1.4,
                rest_gap_m: 3.0,
            },
            emergency_mps2: 4.0,
            burst_chance: 0.0,
        }
    }
}

impl ExpertConfig {
    /// The speed that the limits, bends and junctions ahead allow now, m/s.
    pub fn wish_mps(&self, route: &Route, at_m: f64) -> f64 {
        let mut wish = self.cruise_mps;
        let (from, to) = (route.index_at(at_m), route.index_at(at_m + HORIZON_M));
        for waypoint in &route.waypoints()[from..=to] {
            let mut here = waypoint.limit_mps.min(self.cruise_mps);
            let mut distance_m = (waypoint.at_m - at_m).max(0.0);
            here = here.min((self.lateral_mps2 / waypoint.curvature_per_m.max(1e-6)).sqrt());
            if waypoint.in_junction {
                here = here.min(self.junction_mps);
                distance_m = (distance_m - self.junction_margin_m).max(0.0);
            }
            wish = wish.min((here * here + 2.0 * self.foreseen_mps2 * distance_m).sqrt());
        }
        // The tail is still in the junction that the middle has left.
        let behind = route.index_at(at_m - 2.5);
        if route.waypoints()[behind..=from].iter().any(|waypoint| waypoint.in_junction) {
            wish = wish.min(self.junction_mps);
        }
        wish.max(0.5)
    }
}

/// What the expert wants, and what reaches the car.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Decision {
    pub wanted: Action,
    pub applied: Action,
    /// It brakes harder than for comfort.
    pub is_emergency: bool,
}

/// A disturbance of the steering: a triangular pulse.
#[derive(Clone, Copy, Debug)]
struct Burst {
    peak: f64,
    duration_s: f64,
    age_s: f64,
}

/// The driver; asked every [`STEP_S`].
#[derive(Clone, Debug)]
pub struct Expert {
    config: ExpertConfig,
    noise: Noise,
    burst: Option<Burst>,
}

/// How far ahead on the route the expert looks, m.
const HORIZON_M: f64 = 70.0;

/// Pure pursuit aims this far ahead: seconds of driving, and at least metres.
const AIM_S: f64 = 0.7;
const AIM_MIN_M: f64 = 4.5;

/// Room beside the car, m: to vehicles, and to people.
const BESIDE_VEHICLE_M: f64 = 0.35;
const BESIDE_WALKER_M: f64 = 0.7;

/// Others' ways are foreseen this far, s.
const FORESIGHT_S: f64 = 4.0;

/// Slower than this steering bursts do nothing, m/s; and what they may pull at most, m/s2.
const BURST_MIN_MPS: f64 = 5.0;
const BURST_MAX_MPS2: f64 = 2.0;

impl Expert {
    pub fn new(config: ExpertConfig, seed: u64, episode: u32) -> Expert {
        Expert { config, noise: Noise::new(seed, episode, Purpose::Driver), burst: None }
    }

    /// The decision for the next [`STEP_S`].
    pub fn decide(&mut self, world: &World) -> Decision {
        let snapshot = world.snapshot();
        let ego = &snapshot.ego;
        let acceleration = self.acceleration_mps2(world, &snapshot);
        let (throttle, brake) = ego.config.pedals(acceleration, ego.speed_mps);
        let (throttle, brake) = match ego.speed_mps < 0.2 && acceleration < 0.1 {
            // Stand still, on a slope or in gear.
            true => (0.0, brake.max(0.4)),
            false => (throttle, brake),
        };
        let wheel_rad = pursuit_rad(&world.route, &snapshot, world.progress_m());
        let steer = ego.config.steer(wheel_rad, ego.speed_mps) as f32;
        let wanted = Action { steer, throttle, brake };
        let pull = self.disturbance(&snapshot) as f32;
        Decision {
            wanted,
            applied: Action { steer: (steer + pull).clamp(-1.0, 1.0), ..wanted },
            is_emergency: acceleration < -self.config.emergency_mps2,
        }
    }

    fn acceleration_mps2(&self, world: &World, snapshot: &Snapshot) -> f64 {
        let (route, ego) = (&world.route, &snapshot.ego);
        let front_m = world.progress_m() + ego.config.half_length_m;
        let speed_mps = ego.speed_mps;
        let wish_mps = self.config.wish_mps(route, world.progress_m());
        let follow = &self.config.follow;
        let mut wanted = follow.acceleration_mps2(speed_mps, wish_mps, None);
        // Down to a lower wish, brake as was foreseen and not more gently.
        if speed_mps > wish_mps {
            wanted = wanted.min((wish_mps - speed_mps) / 0.5).max(-3.0);
        }
        let ahead = [
            self.line_ahead(world, front_m),
            self.body_ahead(world, snapshot),
            self.change_ahead(world, front_m),
            world.ahead_of_ego(HORIZON_M),
        ];
        for ahead in ahead.into_iter().flatten() {
            let follows = follow.acceleration_mps2(speed_mps, wish_mps.max(speed_mps), Some(ahead));
            // What it takes at least to stay behind, where that is more than comfortable.
            let closing = (speed_mps - ahead.speed_mps).max(0.0);
            let least = -closing * closing / (2.0 * (ahead.gap_m - 1.0).max(0.1));
            wanted = wanted.min(follows);
            if least < -follow.comfort_mps2 {
                wanted = wanted.min(1.1 * least);
            }
        }
        wanted.max(-ego.config.brake_mps2)
    }

    /// The line of a junction that others have not let us into yet.
    fn line_ahead(&self, world: &World, front_m: f64) -> Option<Ahead> {
        const LINE_M: f64 = 2.0;
        let route = &world.route;
        let (from, to) = (route.index_at(front_m), route.index_at(front_m + HORIZON_M));
        let waypoints = &route.waypoints()[from..=to];
        let closed = |pair: &&[Waypoint]| {
            pair[1].in_junction && !pair[0].in_junction && !world.may_enter(pair[1].lane)
        };
        let line = waypoints.windows(2).find(closed)?;
        let line_m = world.streets.lanes[line[0].lane].line_m.max(LINE_M);
        let gap_m = line[1].at_m - front_m - line_m + self.config.follow.rest_gap_m;
        Some(Ahead::standing(gap_m))
    }

    /// Where a lane change has to wait for somebody on the lane that it leads into.
    fn change_ahead(&self, world: &World, front_m: f64) -> Option<Ahead> {
        const LOOK_M: f64 = 30.0;
        let at_m = world.progress_m();
        let changes = world.route.lane_changes();
        let change = changes.iter().find(|change| change.from_m > at_m - 1.0)?;
        if change.from_m > at_m + LOOK_M {
            return None;
        }
        let (ego, forward) = (world.ego(), world.route.forward(at_m));
        let streets = &world.streets;
        let is_in_way = |vehicle: &&Vehicle| {
            let comes = |lane: LaneId| {
                lane == change.into || streets.lanes[lane].next.contains(&change.into)
            };
            if !comes(vehicle.lane) && !vehicle.leaving.is_some_and(comes) {
                return false;
            }
            let spot = vehicle.spot(streets, 0.0);
            let ahead_m = forward.dot(spot.position_m - ego.position_m);
            let lengths_m = vehicle.half_m.x + ego.config.half_length_m;
            let closing_mps = vehicle.speed_mps - ego.speed_mps;
            // Who is behind and stands, or is slow, lets us in.
            let behind_m = lengths_m + 2.0 + 3.0 * closing_mps.max(0.0);
            let ahead_limit_m = lengths_m + 1.0;
            let stands_behind = vehicle.speed_mps < 0.5 && ahead_m < -lengths_m - 0.5;
            !stands_behind && ahead_m > -behind_m && ahead_m < ahead_limit_m
        };
        let waits = world.traffic.vehicles.iter().any(|vehicle| is_in_way(&vehicle));
        let gap_m = change.from_m - front_m + self.config.follow.rest_gap_m;
        waits.then(|| Ahead::standing(gap_m.max(0.5)))
    }

    /// The nearest vehicle or person whose body will be in the way.
    fn body_ahead(&self, world: &World, snapshot: &Snapshot) -> Option<Ahead> {
        const STEP_ALONG_M: f64 = 1.0;
        let ego = &snapshot.ego;
        let half_m = DVec2::new(ego.config.half_length_m, ego.config.half_width_m);
        let reach_m = 15.0 + ego.speed_mps * 2.0 + ego.speed_mps.powi(2) / 5.0;
        let near = |footprint: &Footprint| {
            footprint.centre_m.distance(ego.position_m) < reach_m + footprint.half_m.x + 10.0
        };
        let is_level = |ground_m: f64| (ground_m - snapshot.ego_ground_m).abs() < LEVEL_M;
        let vehicles =
            snapshot.vehicles.iter().filter(|v| is_level(v.ground_m) && near(&v.footprint));
        let vehicles: Vec<_> = vehicles.collect();
        let walkers =
            snapshot.walkers.iter().filter(|w| is_level(w.ground_m) && near(&w.footprint));
        let walkers: Vec<_> = walkers.collect();
        let route = &world.route;
        let mut ahead_m = half_m.x;
        while ahead_m < reach_m.min(HORIZON_M) {
            let at_m = world.progress_m() + ahead_m;
            if at_m > route.length_m() + half_m.x {
                break;
            }
            let forward = route.forward(at_m);
            // What stands a little aside of the route now will be on it: the car comes back to it.
            let centre_m = route.at(at_m).position_m;
            let slice = |beside_m: f64| Footprint {
                centre_m,
                forward,
                half_m: DVec2::new(STEP_ALONG_M / 2.0, half_m.y + beside_m),
            };
            let gap_m = ahead_m - half_m.x;
            let lane = slice(BESIDE_VEHICLE_M);
            if let Some(vehicle) = vehicles.iter().find(|v| lane.touches(&v.footprint)) {
                let speed_mps = vehicle.velocity_mps.dot(forward).max(0.0);
                return Some(Ahead { gap_m, speed_mps });
            }
            let path = slice(BESIDE_WALKER_M);
            let arrival_s = (gap_m / ego.speed_mps.max(1.5)).min(FORESIGHT_S);
            let steps_into = walkers.iter().any(|walker| {
                let is_there = |after_s: f64| {
                    let moved = walker.velocity_mps * after_s;
                    let centre_m = walker.footprint.centre_m + moved;
                    path.touches(&Footprint { centre_m, ..walker.footprint })
                };
                // On the way across, and there at about the time that we are.
                is_there(0.0)
                    || walker.is_crossing
                        && [-0.8, 0.0, 0.8].iter().any(|d| is_there((arrival_s + d).max(0.0)))
            });
            if steps_into {
                return Some(Ahead::standing(gap_m));
            }
            ahead_m += STEP_ALONG_M;
        }
        None
    }

    /// What to add to the steering now.
    fn disturbance(&mut self, snapshot: &Snapshot) -> f64 {
        let speed_mps = snapshot.ego.speed_mps;
        let Some(burst) = &mut self.burst else {
            let near =
                |footprint: &Footprint| footprint.centre_m.distance(snapshot.ego.position_m) < 25.0;
            let is_alone = !snapshot.vehicles.iter().any(|v| near(&v.footprint))
                && !snapshot.walkers.iter().any(|w| w.is_crossing && near(&w.footprint));
            let starts = self.noise.chance(self.config.burst_chance);
            if starts && is_alone && speed_mps > BURST_MIN_MPS {
                let duration_s = self.noise.uniform(0.7, 1.3);
                let push_m = self.noise.uniform(0.3, 0.7);
                // By its end the pulse alone would push the car aside by its peak, integrated
                // twice over a triangle; the driver fights it.
                let pull_mps2 = (4.0 * push_m / duration_s.powi(2)).min(BURST_MAX_MPS2);
                let side = self.noise.pick(&[-1.0, 1.0]);
                let config = &snapshot.ego.config;
                let angle_rad = side * pull_mps2 * config.wheelbase_m / speed_mps.powi(2);
                let peak = config.steer(angle_rad, speed_mps);
                self.burst = Some(Burst { peak, duration_s, age_s: 0.0 });
            }
            return 0.0;
        };
        burst.age_s += STEP_S;
        if burst.age_s >= burst.duration_s {
            self.burst = None;
            return 0.0;
        }
        burst.peak * (1.0 - (2.0 * burst.age_s / burst.duration_s - 1.0).abs())
    }
}

/// The front wheels' angle that takes the rear axle to a point ahead on the route (Coulter, 1992).
fn pursuit_rad(route: &Route, snapshot: &Snapshot, progress_m: f64) -> f64 {
    let ego = &snapshot.ego;
    let axle_m = ego.rear_axle_m();
    let wheelbase_m = ego.config.wheelbase_m;
    let aim_m = (AIM_S * ego.speed_mps).max(AIM_MIN_M);
    let at_m = progress_m - wheelbase_m / 2.0 + aim_m;
    let beyond_m = (at_m - route.length_m()).max(0.0);
    let target = route.at(at_m).position_m + route.forward(at_m) * beyond_m - axle_m;
    let aside_m = DVec2::from_angle(ego.yaw_rad).perp_dot(target);
    (2.0 * wheelbase_m * aside_m / target.length_squared().max(1.0)).atan()
}
