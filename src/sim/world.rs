//! The world of one drive, in steps of 10 ms: the road, the cars on it, and the driver.

use glam::DVec3;

use crate::{
    noise::{Noise, Purpose},
    sim::{
        driver::{DECISION_S, Decision, Driver, View},
        road::{OWN_LANE_M, Road},
        scene::Scene,
        scenery,
        traffic::{self, Traffic},
    },
    world::ego::{Car, SEDAN, STEP_S},
};

/// Where the ego vehicle starts, m along the road.
const START_M: f64 = 50.0;

/// Road beyond the furthest that any car can get, so that its end stays out of sight, m.
const SPARE_M: f64 = 400.0;

/// Fastest that any driver wishes to go, m/s, rounded up.
const FASTEST_MPS: f64 = 13.0;

/// What is further away than this is in nobody's picture, m.
const SIGHT_M: f64 = 250.0;

/// Steps between two decisions.
const DECISION_STEPS: u64 = (DECISION_S / STEP_S) as u64;

pub struct World {
    pub road: Road,
    scenery: Scene,
    traffic: Traffic,
    driver: Driver,
    ego: Car,
    /// Arc length of the ego frame's origin, m.
    s_m: f64,
    decision: Decision,
    steps: u64,
}

impl World {
    /// The world of an episode, long enough to drive for `seconds`; everything stands still.
    pub fn new(seed: u64, episode: u32, seconds: f64) -> Self {
        let noise = |purpose| Noise::new(seed, episode, purpose);
        let length_m = (START_M + seconds * FASTEST_MPS + SPARE_M).max(3000.0);
        let road = Road::generate(&mut noise(Purpose::Road), length_m);
        let mut scenery_noise = noise(Purpose::Scenery);
        let mut scenery = scenery::build(&mut scenery_noise, &road);
        traffic::add_parked(&mut scenery, &mut scenery_noise, &road);
        let ego =
            Car::at_rest(SEDAN, road.place(START_M, OWN_LANE_M), road.at(START_M).heading_rad);
        let mut world = World {
            traffic: Traffic::new(noise(Purpose::Traffic), &road, START_M),
            driver: Driver::new(noise(Purpose::Driver)),
            road,
            scenery,
            ego,
            s_m: START_M,
            decision: Decision::default(),
            steps: 0,
        };
        world.decide();
        world
    }

    /// Let [`STEP_S`] pass.
    pub fn step(&mut self) {
        self.ego = self.ego.step(self.decision.applied);
        self.s_m = self.road.project_near(self.ego.position_m, self.s_m).0;
        self.steps += 1;
        let decide = self.steps.is_multiple_of(DECISION_STEPS);
        self.traffic.step(&self.road, decide);
        if decide {
            self.decide();
        }
    }

    fn decide(&mut self) {
        let view = View {
            s_m: self.s_m,
            ahead: self.traffic.ahead(self.s_m + SEDAN.half_length_m),
            oncoming: self.traffic.oncoming_near(self.s_m),
        };
        self.decision = self.driver.decide(&self.road, &self.ego, view);
    }

    /// Steps since the start.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    pub fn ego(&self) -> &Car {
        &self.ego
    }

    /// Arc length of the ego frame's origin, m.
    pub fn s_m(&self) -> f64 {
        self.s_m
    }

    /// What the driver wants and what is applied until the next decision.
    pub fn decision(&self) -> &Decision {
        &self.decision
    }

    /// Arc length of the lead car's middle, m; `None` if this drive has none.
    pub fn lead_s_m(&self) -> Option<f64> {
        self.traffic.lead_s_m()
    }

    /// What sensors can see from where the ego vehicle is; itself it does not see.
    pub fn scene(&self) -> Scene {
        let here: DVec3 = self.ego.position_m.extend(0.0);
        let mut scene = Scene::default();
        scene.add_near(&self.scenery, here, SIGHT_M);
        for car in self.traffic.cars(&self.road) {
            if car.world_from_car.translation.distance(here) < SIGHT_M {
                car.add_to(&mut scene);
            }
        }
        scene
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::ego::SEDAN;

    #[test]
    fn no_drive_touches_anything_and_each_starts_from_rest_and_brakes() {
        for episode in 0..4 {
            let mut world = World::new(11, episode, 90.0);
            assert_eq!(world.ego().speed_mps, 0.0);
            let (mut fastest, mut hardest) = (0.0_f64, 0.0_f64);
            for step in 0..9000 {
                world.step();
                fastest = fastest.max(world.ego().speed_mps);
                hardest = hardest.min(world.ego().acceleration_mps2);
                if step % 10 == 0 {
                    touches_nothing(&world, episode);
                }
            }
            assert!(fastest > 8.0 && fastest < FASTEST_MPS, "{fastest}");
            assert!(hardest < -1.0 && hardest > -6.1, "{hardest}");
        }
    }

    fn touches_nothing(world: &World, episode: u32) {
        let ego = world.ego().world_from_ego();
        let mut near = Scene::default();
        near.add_near(&world.scene(), ego.translation, 12.0);
        for i in -10..=10 {
            for side in [-SEDAN.half_width_m, SEDAN.half_width_m] {
                let x = SEDAN.half_length_m * f64::from(i) / 10.0;
                let point = ego.transform_point3(DVec3::new(x, side, 0.5));
                for solid in &near.solids {
                    let clear = solid.outside_m(point);
                    assert!(clear > 0.0, "episode {episode}, s {}: {solid:?}", world.s_m());
                }
            }
        }
    }
}
