//! A vehicle of the traffic: where it is on its lanes, and how it stands on the ground.

use std::collections::VecDeque;

use glam::DVec2;

use crate::{
    footprint::Footprint,
    noise::Noise,
    world::{
        car_following::Ahead,
        kind::VehicleModel,
        occupancy::Asker,
        reservation::ActorId,
        streets::{LaneId, Spot, Streets},
    },
};

/// How far ahead a vehicle knows its way, m; further where that would end inside a junction, up to
/// the second length.
const PLAN_M: f64 = 120.0;
const LONGEST_PLAN_M: f64 = 400.0;

/// How fast a vehicle moves aside: at most, m/s, and per speed.
pub const ASIDE_MPS: f64 = 1.1;
pub const ASIDE_PER_SPEED: f64 = 0.22;

/// A vehicle of the traffic.
#[derive(Clone, Debug)]
pub struct Vehicle {
    pub id: ActorId,
    pub model: &'static VehicleModel,
    /// Half of length and width, m, and height, m.
    pub half_m: DVec2,
    pub height_m: f64,
    /// Picks a colour, in [0, 1).
    pub colour: f64,
    /// Of what limits and bends allow, what this driver takes.
    pub haste: f64,
    pub lane: LaneId,
    /// Arc length of its middle on the lane, m.
    pub s_m: f64,
    /// Distance from the middle of the lane, positive left, and where it wants to be, m.
    pub aside_m: f64,
    pub keeps_aside_m: f64,
    /// The lane that it is leaving, until it has no part of it any more.
    pub leaving: Option<LaneId>,
    pub speed_mps: f64,
    pub acceleration_mps2: f64,
    /// How long it has stood, s.
    pub standing_s: f64,
    /// Of the last step.
    pub view: View,
    /// Lanes behind, the last one first, as far as its rear needs them.
    behind: VecDeque<LaneId>,
    /// Lanes ahead.
    plan: VecDeque<LaneId>,
    noise: Noise,
}

/// What a driver sees, and makes of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// The speed that the driver wants here.
    pub wish_mps: f64,
    /// The next body on the way.
    pub ahead: Option<Ahead>,
    /// Who steps into the way and makes the driver brake more than all else does.
    pub yields_to: Option<ActorId>,
    pub wanted_mps2: f64,
}

impl Vehicle {
    /// A vehicle that is set down on a lane; what it is and how it drives is drawn from `noise`.
    pub fn new(
        id: ActorId,
        mut noise: Noise,
        streets: &Streets,
        lane: LaneId,
        s_m: f64,
    ) -> Vehicle {
        let model = VehicleModel::draw(&mut noise);
        let half_m = model.half_m * noise.uniform(0.94, 1.06);
        let width_m = streets.lanes[lane].width_m;
        // Bicycles keep to the right of their lane.
        let free_m = (width_m / 2.0 - half_m.y).max(0.0);
        let keeps_aside_m = if half_m.y < 0.35 { -0.6 * free_m } else { 0.0 };
        let mut vehicle = Vehicle {
            id,
            model,
            half_m,
            height_m: model.height_m * noise.uniform(0.95, 1.05),
            colour: noise.uniform(0.0, 1.0),
            haste: noise.uniform(0.85, 1.05),
            lane,
            s_m,
            aside_m: keeps_aside_m,
            keeps_aside_m,
            leaving: None,
            speed_mps: 0.0,
            acceleration_mps2: 0.0,
            standing_s: 0.0,
            view: View::default(),
            behind: VecDeque::new(),
            plan: VecDeque::new(),
            noise,
        };
        vehicle.look_back(streets);
        vehicle.make_plan(streets);
        vehicle
    }

    /// Lanes of its way: the one that it is on, and those ahead.
    pub fn way(&self) -> impl Iterator<Item = LaneId> {
        std::iter::once(self.lane).chain(self.plan.iter().copied())
    }

    /// Lanes that its rear has not left, the last one first.
    pub fn tail(&self, streets: &Streets) -> impl Iterator<Item = LaneId> {
        let mut rear_m = self.s_m - self.half_m.x;
        self.behind.iter().copied().take_while(move |lane| {
            let reaches = rear_m < 0.0;
            rear_m += streets.lanes[*lane].length_m();
            reaches
        })
    }

    pub fn asker(&self) -> Asker {
        Asker { actor: self.id, s_m: self.s_m, half_length_m: self.half_m.x }
    }

    /// Choose lanes until the way is long enough; at a fork each way is as likely.
    pub fn make_plan(&mut self, streets: &Streets) {
        let mut length_m: f64 = self.way().map(|lane| streets.lanes[lane].length_m()).sum();
        loop {
            let last = self.plan.back().copied().unwrap_or(self.lane);
            let enough_m =
                if streets.lanes[last].is_waiting_place() { PLAN_M } else { LONGEST_PLAN_M };
            let next = &streets.lanes[last].next;
            if length_m - self.s_m >= enough_m || next.is_empty() {
                break;
            }
            let next = self.noise.pick(next);
            length_m += streets.lanes[next].length_m();
            self.plan.push_back(next);
        }
    }

    /// Choose another way from here on.
    pub fn plan_anew(&mut self, streets: &Streets) {
        self.plan.clear();
        self.make_plan(streets);
    }

    /// Go over to a neighbouring lane; the body follows.
    pub fn change_lane(&mut self, streets: &Streets, to: LaneId) {
        let (from, target) = (&streets.lanes[self.lane], &streets.lanes[to]);
        let here = from.course.at(self.s_m);
        let position_m = here.position_m + here.forward.perp() * self.aside_m;
        let s_m = from.beside_m(self.s_m, target);
        let there = target.course.at(s_m);
        self.aside_m = there.forward.perp_dot(position_m - there.position_m);
        self.leaving = Some(self.lane);
        self.lane = to;
        self.s_m = s_m;
        self.plan.clear();
        self.behind.clear();
        self.look_back(streets);
        self.make_plan(streets);
    }

    /// Let time pass at an acceleration; a vehicle never rolls back.
    pub fn advance(&mut self, streets: &Streets, acceleration_mps2: f64, dt_s: f64) {
        let speed_mps = (self.speed_mps + acceleration_mps2 * dt_s).max(0.0);
        let moved_m = (self.speed_mps + speed_mps) / 2.0 * dt_s;
        self.acceleration_mps2 = (speed_mps - self.speed_mps) / dt_s;
        self.speed_mps = speed_mps;
        self.standing_s = if speed_mps < 0.1 { self.standing_s + dt_s } else { 0.0 };
        self.s_m += moved_m;
        while self.s_m >= streets.lanes[self.lane].length_m() {
            let Some(next) = self.plan.pop_front() else {
                self.s_m = streets.lanes[self.lane].length_m();
                self.speed_mps = 0.0;
                break;
            };
            self.s_m -= streets.lanes[self.lane].length_m();
            self.behind.push_front(self.lane);
            self.lane = next;
        }
        self.behind.truncate(8);
        self.make_plan(streets);

        let most_m = ASIDE_MPS.min(ASIDE_PER_SPEED * speed_mps) * dt_s;
        self.aside_m += (self.keeps_aside_m - self.aside_m).clamp(-most_m, most_m);
        let width_m = streets.lanes[self.lane].width_m;
        if self.aside_m.abs() + self.half_m.y < width_m / 2.0 + 0.2 {
            self.leaving = None;
        }
    }

    fn look_back(&mut self, streets: &Streets) {
        let mut length_m = self.s_m;
        let mut first = self.lane;
        while length_m < 2.0 * self.half_m.x + 2.0 {
            let Some(before) = streets.lanes[first].previous.first() else { break };
            self.behind.push_back(*before);
            length_m += streets.lanes[*before].length_m();
            first = *before;
        }
    }

    /// The spot of its way that lies `ahead_m` before its middle, or behind it.
    pub fn spot(&self, streets: &Streets, ahead_m: f64) -> Spot {
        let mut s_m = self.s_m + ahead_m;
        let mut lane = self.lane;
        if s_m < 0.0 {
            for before in &self.behind {
                lane = *before;
                s_m += streets.lanes[lane].length_m();
                if s_m >= 0.0 {
                    break;
                }
            }
        } else {
            for next in &self.plan {
                let length_m = streets.lanes[lane].length_m();
                if s_m <= length_m {
                    break;
                }
                s_m -= length_m;
                lane = *next;
            }
        }
        let on_lane = streets.lanes[lane].course.at(s_m);
        let position_m = on_lane.position_m + on_lane.forward.perp() * self.aside_m;
        Spot { position_m, ..on_lane }
    }

    /// From axle to axle along its way, m.
    pub fn wheelbase_m(&self) -> f64 {
        2.0 * self.model.wheelbase * self.half_m.x
    }

    /// Where its front and its rear axle stand.
    pub fn axles(&self, streets: &Streets) -> [Spot; 2] {
        let half_m = 0.5 * self.wheelbase_m();
        [self.spot(streets, half_m), self.spot(streets, -half_m)]
    }

    /// What it covers of the ground: both axles are on the way, so that long vehicles cut corners
    /// as they do.
    pub fn footprint(&self, streets: &Streets) -> Footprint {
        let [front, rear] = self.axles(streets);
        let forward = (front.position_m - rear.position_m).normalize_or(front.forward);
        let centre_m = (front.position_m + rear.position_m) / 2.0;
        Footprint { centre_m, forward, half_m: self.half_m }
    }

    /// Velocity over the ground, m/s, of a vehicle that stands as `footprint` says.
    pub fn velocity_mps(&self, footprint: &Footprint) -> DVec2 {
        footprint.forward * self.speed_mps
    }

    /// True with probability `p`, from the vehicle's own stream.
    pub fn chance(&mut self, p: f64) -> bool {
        self.noise.chance(p)
    }
}
