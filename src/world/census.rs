//! What a town's traffic does, counted as it goes: flow, gaps, touches, jams, crossings.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::world::{
    kind::VehicleKind,
    reservation::ActorId,
    snapshot::{VehicleState, WalkerState},
    spread::{Quantiles, Spread},
    streets::{LaneId, Streets},
    touches::{Touch, Touches},
    traffic::{STEP_S, Traffic},
    vehicle::Vehicle,
    walkers::{Crossings, Walkers},
};

/// Slower than this a vehicle has stopped, m/s.
pub const STOPPED_MPS: f64 = 0.1;

/// A vehicle follows if it is no further behind than this, s, and moves at least so fast, m/s.
const FOLLOWS_S: f64 = 4.0;
const FOLLOWS_MPS: f64 = 2.0;

/// It follows steadily if speeds differ by less than this, m/s, and it holds its own, m/s2.
const STEADY_MPS: f64 = 0.3;
const STEADY_MPS2: f64 = 0.1;

/// A lane is free where nobody is so near ahead and no junction either, m.
const FREE_M: f64 = 80.0;

/// What somebody on foot makes drivers do counts as hard from here on, m/s2.
const HARD_MPS2: f64 = 4.0;

/// Gaps, time gaps and speeds are looked at once a second.
const STEPS_PER_SAMPLE: u64 = (1.0 / STEP_S) as u64;
const STEPS_PER_MINUTE: u64 = (60.0 / STEP_S) as u64;

/// Stands of at least so long are counted, s.
pub const LONG_STANDS_S: [f64; 3] = [60.0, 180.0, 300.0];

/// A minute of the town.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Minute {
    /// Of all vehicles, those that stand as well.
    pub mean_speed_mps: f64,
    pub stopped_share: f64,
}

/// What was counted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    pub minutes: Vec<Minute>,
    pub driven_km: f64,
    pub touches_between_vehicles: Vec<Touch>,
    pub touches_with_walkers: Vec<Touch>,
    /// From bumper to bumper while following, m, and in seconds of the follower's speed.
    pub gaps_m: Option<Quantiles>,
    pub time_gaps_s: Option<Quantiles>,
    /// Gaps of who follows steadily, over what the model says for its speed.
    pub steady_gaps_to_theory: Option<Quantiles>,
    /// Speeds on free lanes over the limit, of all that may drive as fast.
    pub free_speed_to_limit: Option<Quantiles>,
    /// Stands of at least 60 s, 180 s and 300 s.
    pub long_stands: [u64; LONG_STANDS_S.len()],
    pub longest_stand_s: f64,
    pub lane_changes: u64,
    pub crossings: Crossings,
    /// Of these, those for which a vehicle braked harder than 4 m/s2.
    pub hard_braking_for: Crossings,
}

/// Counts a run, step by step.
#[derive(Clone, Debug)]
pub struct Census {
    minutes: Vec<Minute>,
    /// Of the minute that has not ended.
    sums: Minute,
    steps: u64,
    driven_m: f64,
    touches: Touches,
    gaps_m: Spread,
    time_gaps_s: Spread,
    steady_gaps: Spread,
    free_speeds: Spread,
    long_stands: [u64; LONG_STANDS_S.len()],
    longest_stand_s: f64,
    lane_changes: u64,
    /// By vehicle, the lane that it was leaving at the last step.
    leaving: BTreeMap<ActorId, LaneId>,
    /// Who is on the way across, and whether somebody has braked hard for them.
    on_street: BTreeMap<ActorId, bool>,
    hard_braking_for: Crossings,
}

impl Default for Census {
    fn default() -> Census {
        Census {
            minutes: Vec::new(),
            sums: Minute::default(),
            steps: 0,
            driven_m: 0.0,
            touches: Touches::default(),
            gaps_m: Spread::new(0.1, 150.0),
            time_gaps_s: Spread::new(0.01, FOLLOWS_S + 0.1),
            steady_gaps: Spread::new(0.005, 5.0),
            free_speeds: Spread::new(0.005, 2.0),
            long_stands: [0; LONG_STANDS_S.len()],
            longest_stand_s: 0.0,
            lane_changes: 0,
            leaving: BTreeMap::new(),
            on_street: BTreeMap::new(),
            hard_braking_for: Crossings::default(),
        }
    }
}

impl Census {
    /// Count a step that has just been made; `vehicles` and `people` are its states.
    pub fn count(
        &mut self,
        streets: &Streets,
        traffic: &Traffic,
        walkers: &Walkers,
        vehicles: &[VehicleState],
        people: &[WalkerState],
    ) {
        self.steps += 1;
        self.touches.look(self.steps as f64 * STEP_S, vehicles, people);
        self.count_hard_braking(traffic, walkers);
        let count = traffic.vehicles.len().max(1) as f64;
        for vehicle in &traffic.vehicles {
            self.driven_m += vehicle.speed_mps * STEP_S;
            self.sums.mean_speed_mps += vehicle.speed_mps / count;
            self.sums.stopped_share += f64::from(u8::from(vehicle.speed_mps < STOPPED_MPS)) / count;
            self.longest_stand_s = self.longest_stand_s.max(vehicle.standing_s);
            for (counted, long_s) in self.long_stands.iter_mut().zip(LONG_STANDS_S) {
                let stood = vehicle.standing_s;
                *counted += u64::from(stood >= long_s && stood - STEP_S < long_s);
            }
            let before = match vehicle.leaving {
                Some(lane) => self.leaving.insert(vehicle.id, lane),
                None => self.leaving.remove(&vehicle.id),
            };
            self.lane_changes += u64::from(vehicle.leaving.is_some() && before != vehicle.leaving);
            if self.steps.is_multiple_of(STEPS_PER_SAMPLE) {
                self.sample(streets, vehicle);
            }
        }
        if self.steps.is_multiple_of(STEPS_PER_MINUTE) {
            let sums = std::mem::take(&mut self.sums);
            let mean = |sum: f64| sum / STEPS_PER_MINUTE as f64;
            self.minutes.push(Minute {
                mean_speed_mps: mean(sums.mean_speed_mps),
                stopped_share: mean(sums.stopped_share),
            });
        }
    }

    fn sample(&mut self, streets: &Streets, vehicle: &Vehicle) {
        let (speed, view) = (vehicle.speed_mps, &vehicle.view);
        if let Some(ahead) = view.ahead
            && speed > FOLLOWS_MPS
            && ahead.gap_m < FOLLOWS_S * speed
        {
            self.gaps_m.add(ahead.gap_m);
            self.time_gaps_s.add(ahead.gap_m / speed);
            let is_steady = (speed - ahead.speed_mps).abs() < STEADY_MPS
                && vehicle.acceleration_mps2.abs() < STEADY_MPS2;
            // Near its wish a vehicle is at any distance.
            if is_steady && speed < 0.9 * view.wish_mps {
                let theory_m = vehicle.model.idm().steady_gap_m(speed, view.wish_mps);
                self.steady_gaps.add(ahead.gap_m / theory_m);
            }
        }
        let lane = &streets.lanes[vehicle.lane];
        let to_junction_m = lane.length_m() - vehicle.s_m;
        let is_free = lane.junction.is_none()
            && vehicle.s_m > FREE_M
            && to_junction_m > FREE_M
            && view.ahead.is_none_or(|ahead| ahead.gap_m > FREE_M);
        let may = vehicle.model.kind != VehicleKind::Bicycle
            && vehicle.model.fastest_mps > lane.limit_mps;
        if is_free && may {
            self.free_speeds.add(speed / lane.limit_mps);
        }
    }

    fn count_hard_braking(&mut self, traffic: &Traffic, walkers: &Walkers) {
        for walker in &walkers.walkers {
            if !walker.is_crossing() {
                self.on_street.remove(&walker.id);
                continue;
            }
            let has_counted = self.on_street.entry(walker.id).or_default();
            let brakes = |vehicle: &Vehicle| {
                vehicle.view.yields_to == Some(walker.id) && vehicle.acceleration_mps2 < -HARD_MPS2
            };
            if !*has_counted && traffic.vehicles.iter().any(brakes) {
                *has_counted = true;
                match walker.is_jaywalking {
                    true => self.hard_braking_for.without_notice += 1,
                    false => self.hard_braking_for.careful += 1,
                }
            }
        }
    }

    /// What was counted so far, in whole minutes where it goes by minutes.
    pub fn tally(&self, crossings: Crossings) -> Tally {
        Tally {
            minutes: self.minutes.clone(),
            driven_km: self.driven_m / 1000.0,
            touches_between_vehicles: self.touches.between_vehicles.clone(),
            touches_with_walkers: self.touches.with_walkers.clone(),
            gaps_m: self.gaps_m.quantiles(),
            time_gaps_s: self.time_gaps_s.quantiles(),
            steady_gaps_to_theory: self.steady_gaps.quantiles(),
            free_speed_to_limit: self.free_speeds.quantiles(),
            long_stands: self.long_stands,
            longest_stand_s: self.longest_stand_s,
            lane_changes: self.lane_changes,
            crossings,
            hard_braking_for: self.hard_braking_for,
        }
    }
}
