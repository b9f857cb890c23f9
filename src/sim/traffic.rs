//! Other cars: one that leads, some that come towards us, some that are parked.

use glam::DVec3;

use crate::{
    noise::Noise,
    sim::{
        car::{Car, PAINTS},
        cruise::Cruise,
        driver::DECISION_S,
        road::{LANE_WIDTH_M, OWN_LANE_M, Road, SHOULDER_M},
        scene::{Rgb, Scene},
        scenery::beside,
    },
    world::car_following::Ahead,
    world::ego::{SEDAN, STEP_S},
};

/// What oncoming cars drive on a straight, m/s.
const ONCOMING_MPS: f64 = 11.0;

/// An oncoming car nearer than this counts as near, m.
const ONCOMING_NEAR_M: f64 = 90.0;

/// Brake lamps come on at this, m/s2.
const BRAKE_LAMPS_MPS2: f64 = -0.6;

/// A car on the middle of a lane.
#[derive(Clone, Copy, Debug)]
struct LaneCar {
    s_m: f64,
    speed_mps: f64,
    acceleration_mps2: f64,
    paint: Rgb,
}

/// The car ahead of the ego vehicle; it changes its wish from time to time.
struct Lead {
    car: LaneCar,
    cruise: Cruise,
    wish_mps: f64,
    content_s: f64,
}

pub struct Traffic {
    noise: Noise,
    lead: Option<Lead>,
    oncoming: Vec<LaneCar>,
}

impl Traffic {
    /// Cars along the road for an ego vehicle that starts at arc length `ego_s_m`.
    pub fn new(mut noise: Noise, road: &Road, ego_s_m: f64) -> Self {
        let lead = noise.chance(0.8).then(|| Lead {
            car: LaneCar {
                s_m: ego_s_m + noise.uniform(14.0, 45.0),
                speed_mps: 0.0,
                acceleration_mps2: 0.0,
                paint: noise.pick(&PAINTS),
            },
            cruise: Cruise::default(),
            wish_mps: noise.uniform(8.0, 12.5),
            content_s: noise.uniform(6.0, 15.0),
        });
        let mut oncoming = Vec::new();
        let mut s_m = ego_s_m + noise.uniform(50.0, 150.0);
        while s_m < road.length_m() {
            let paint = noise.pick(&PAINTS);
            oncoming.push(LaneCar { s_m, speed_mps: ONCOMING_MPS, acceleration_mps2: 0.0, paint });
            s_m += noise.uniform(60.0, 240.0);
        }
        Traffic { noise, lead, oncoming }
    }

    /// Let [`STEP_S`] pass; `decide` is true every [`DECISION_S`].
    pub fn step(&mut self, road: &Road, decide: bool) {
        if let Some(lead) = &mut self.lead {
            if decide {
                lead.decide(road, &mut self.noise);
            }
            lead.car.advance(1.0);
        }
        for car in &mut self.oncoming {
            let limit = road.speed_limit_mps(car.s_m).min(ONCOMING_MPS);
            car.acceleration_mps2 = ((limit - car.speed_mps) / STEP_S).clamp(-2.0, 1.5);
            car.advance(-1.0);
        }
        self.oncoming.retain(|car| car.s_m > 0.0);
    }

    /// The lead car, for a front bumper at arc length `front_m`.
    pub fn ahead(&self, front_m: f64) -> Option<Ahead> {
        let car = &self.lead.as_ref()?.car;
        Some(Ahead { gap_m: car.s_m - SEDAN.half_length_m - front_m, speed_mps: car.speed_mps })
    }

    /// Whether an oncoming car will soon pass a car at arc length `s_m`.
    pub fn oncoming_near(&self, s_m: f64) -> bool {
        self.oncoming.iter().any(|c| (-10.0..ONCOMING_NEAR_M).contains(&(c.s_m - s_m)))
    }

    /// Arc length of the lead car's middle, m.
    pub fn lead_s_m(&self) -> Option<f64> {
        self.lead.as_ref().map(|lead| lead.car.s_m)
    }

    /// All moving cars as they stand now.
    pub fn cars(&self, road: &Road) -> Vec<Car> {
        let lead = self.lead.iter().map(|lead| lead.car.on_road(road, 1.0));
        lead.chain(self.oncoming.iter().map(|car| car.on_road(road, -1.0))).collect()
    }
}

impl Lead {
    fn decide(&mut self, road: &Road, noise: &mut Noise) {
        self.content_s -= DECISION_S;
        if self.content_s <= 0.0 {
            self.wish_mps = noise.uniform(7.0, 12.5);
            self.content_s = noise.uniform(6.0, 15.0);
        }
        let front_m = self.car.s_m + SEDAN.half_length_m;
        let speed_mps = self.car.speed_mps;
        self.car.acceleration_mps2 = self.cruise.acceleration_mps2(
            road,
            front_m,
            speed_mps,
            self.wish_mps,
            None,
            DECISION_S,
        );
    }
}

impl LaneCar {
    fn advance(&mut self, direction: f64) {
        self.speed_mps = (self.speed_mps + self.acceleration_mps2 * STEP_S).max(0.0);
        self.s_m += direction * self.speed_mps * STEP_S;
    }

    fn on_road(&self, road: &Road, direction: f64) -> Car {
        let mut world_from_car = beside(road, self.s_m, direction * OWN_LANE_M);
        if direction < 0.0 {
            world_from_car.matrix3.x_axis *= -1.0;
            world_from_car.matrix3.y_axis *= -1.0;
        }
        Car {
            world_from_car,
            velocity_mps: self.speed_mps * world_from_car.matrix3.x_axis,
            paint: self.paint,
            braking: self.acceleration_mps2 < BRAKE_LAMPS_MPS2 || self.speed_mps < 0.1,
        }
    }
}

/// Cars parked on the verge of the right-hand side.
pub fn add_parked(scene: &mut Scene, noise: &mut Noise, road: &Road) {
    let lateral_m = -(LANE_WIDTH_M + SHOULDER_M + SEDAN.half_width_m + 0.4);
    let mut s_m = noise.uniform(30.0, 90.0);
    while s_m < road.length_m() {
        let world_from_car = beside(road, s_m, lateral_m);
        let paint = noise.pick(&PAINTS);
        Car { world_from_car, velocity_mps: DVec3::ZERO, paint, braking: false }.add_to(scene);
        s_m += noise.uniform(40.0, 260.0);
    }
}
