//! Pedestrians: on side-walks, across streets when there is time, and now and then when there is
//! none.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    footprint::Footprint,
    noise::Noise,
    world::{
        kind::WalkerKind,
        reservation::ActorId,
        streets::{LEVEL_M, Onward, Streets, WalkId},
        traffic::{Hazard, STEP_S},
    },
};

/// First number of a pedestrian; vehicles have those below.
pub const FIRST_WALKER: ActorId = 10_000;

/// Longest way across a street that is taken at once, m.
const WIDEST_M: f64 = 30.0;

/// Time to spare that careful people leave to a vehicle, s.
const SPARE_S: f64 = 1.5;

/// How far they look for vehicles, m: a wide street takes some 8 s, and vehicles are fast.
const SIGHT_M: f64 = 200.0;

/// Who steps out without notice, per person and second.
const JAYWALK_PER_S: f64 = 0.0015;

/// Who wants to cross in the middle of a street, with care, per person and second.
const CROSS_PER_S: f64 = 0.006;

/// How long people wait for a gap before they walk on, s.
const PATIENCE_S: f64 = 25.0;

/// Somebody on foot.
#[derive(Clone, Debug)]
pub struct Walker {
    pub id: ActorId,
    pub kind: WalkerKind,
    /// What this one walks or runs, m/s.
    pub pace_mps: f64,
    /// Picks colours, in [0, 1).
    pub colour: f64,
    pub position_m: DVec2,
    /// Of the street below or beside.
    pub height_m: f64,
    /// Height of the side-walk that is walked on, m.
    kerb_m: f64,
    pub velocity_mps: DVec2,
    /// Way that was gone so far, m.
    pub walked_m: f64,
    /// Unit vector that the body faces.
    pub facing: DVec2,
    /// Crossed without looking the last time.
    pub is_jaywalking: bool,
    activity: Activity,
    walk: WalkId,
    s_m: f64,
    backwards: bool,
    aside_m: f64,
    noise: Noise,
}

/// What somebody is doing.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Activity {
    Walking,
    /// At the kerb, before a way across.
    Waiting {
        to: Landing,
        since_s: f64,
    },
    /// On the way across, from kerb to kerb, or on to the next walk.
    Crossing {
        to: Landing,
    },
}

/// Where one goes on after a crossing.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Landing {
    walk: WalkId,
    s_m: f64,
    backwards: bool,
    position_m: DVec2,
    /// A street lies between.
    crosses: bool,
}

/// Steps out on the street, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Crossings {
    pub careful: u64,
    pub without_notice: u64,
}

/// All pedestrians.
#[derive(Clone, Debug, Default)]
pub struct Walkers {
    pub walkers: Vec<Walker>,
    pub crossings: Crossings,
}

/// A vehicle, as people on foot see it.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    pub footprint: Footprint,
    pub height_m: f64,
    pub speed_mps: f64,
}

impl Walkers {
    /// `count` people, spread over all walks.
    pub fn spawn(
        streets: &Streets,
        count: usize,
        noise: &mut Noise,
        actor: impl Fn(ActorId) -> Noise,
    ) -> Walkers {
        let total: f64 = streets.walks.iter().map(|walk| walk.course.length_m()).sum();
        let mut walkers = Walkers::default();
        if total <= 0.0 {
            return walkers;
        }
        for index in 0..count {
            let mut s_m = noise.uniform(0.0, total);
            let mut walk = 0;
            while s_m > streets.walks[walk].course.length_m() && walk + 1 < streets.walks.len() {
                s_m -= streets.walks[walk].course.length_m();
                walk += 1;
            }
            let id = FIRST_WALKER + index as ActorId;
            walkers.walkers.push(Walker::new(id, actor(id), streets, walk, s_m));
        }
        walkers
    }

    /// Let [`STEP_S`] pass.
    pub fn step(&mut self, streets: &Streets, vehicles: &[Seen]) {
        for walker in &mut self.walkers {
            walker.step(streets, vehicles, &mut self.crossings);
            walker.walked_m += walker.velocity_mps.length() * STEP_S;
        }
    }

    /// Those who are on a street or about to be, for drivers.
    pub fn hazards(&self) -> impl Iterator<Item = Hazard> {
        let on_street = |walker: &&Walker| matches!(walker.activity, Activity::Crossing { .. });
        self.walkers.iter().filter(on_street).map(|walker| Hazard {
            actor: walker.id,
            position_m: walker.position_m,
            velocity_mps: walker.velocity_mps,
            radius_m: walker.kind.half_m().y,
            height_m: walker.height_m,
        })
    }
}

impl Walker {
    fn new(id: ActorId, mut noise: Noise, streets: &Streets, walk: WalkId, s_m: f64) -> Walker {
        let kind = if noise.chance(0.18) { WalkerKind::Child } else { WalkerKind::Adult };
        let runs = noise.chance(if kind == WalkerKind::Child { 0.25 } else { 0.08 });
        let pace_mps = if runs { noise.uniform(2.2, 3.4) } else { noise.uniform(0.9, 1.6) };
        let half_width_m = streets.walks[walk].half_width_m;
        let mut walker = Walker {
            id,
            kind,
            pace_mps,
            colour: noise.uniform(0.0, 1.0),
            position_m: DVec2::ZERO,
            height_m: 0.0,
            kerb_m: 0.0,
            velocity_mps: DVec2::ZERO,
            walked_m: 0.0,
            facing: DVec2::X,
            is_jaywalking: false,
            activity: Activity::Walking,
            walk,
            s_m,
            backwards: noise.chance(0.5),
            aside_m: noise.uniform(-0.8, 0.8) * half_width_m,
            noise,
        };
        walker.stand_on_walk(streets);
        walker
    }

    /// What the body covers of the ground.
    pub fn footprint(&self) -> Footprint {
        Footprint { centre_m: self.position_m, forward: self.facing, half_m: self.kind.half_m() }
    }

    /// On a street, or on the way across.
    pub fn is_crossing(&self) -> bool {
        matches!(self.activity, Activity::Crossing { .. })
    }

    /// Height of what the feet stand on: the side-walk, or the street, m.
    pub fn ground_m(&self) -> f64 {
        match self.activity {
            Activity::Crossing { to } if to.crosses => self.height_m,
            _ => self.height_m + self.kerb_m,
        }
    }

    fn stand_on_walk(&mut self, streets: &Streets) {
        let spot = streets.walks[self.walk].course.at(self.s_m);
        self.position_m = spot.position_m + spot.forward.perp() * self.aside_m;
        self.height_m = spot.height_m;
        self.kerb_m = streets.walks[self.walk].kerb_m;
        self.facing = if self.backwards { -spot.forward } else { spot.forward };
    }

    fn step(&mut self, streets: &Streets, vehicles: &[Seen], crossings: &mut Crossings) {
        let is_near = |seen: &&Seen| {
            (seen.height_m - self.height_m).abs() < LEVEL_M
                && seen.footprint.centre_m.distance_squared(self.position_m) < SIGHT_M * SIGHT_M
        };
        let near: Vec<Seen> = match self.activity {
            Activity::Walking => Vec::new(),
            _ => vehicles.iter().filter(is_near).copied().collect(),
        };
        let vehicles = &near[..];
        match self.activity {
            Activity::Walking => self.walk_on(streets, crossings),
            Activity::Waiting { to, since_s } => {
                self.velocity_mps = DVec2::ZERO;
                self.facing = (to.position_m - self.position_m).normalize_or(self.facing);
                let width_m = self.position_m.distance(to.position_m);
                if has_gap(self.position_m, to.position_m, width_m / self.pace_mps, vehicles) {
                    crossings.careful += 1;
                    self.activity = Activity::Crossing { to };
                } else if since_s > PATIENCE_S {
                    self.backwards = !self.backwards;
                    self.activity = Activity::Walking;
                } else {
                    self.activity = Activity::Waiting { to, since_s: since_s + STEP_S };
                }
            }
            Activity::Crossing { to } => self.cross(streets, to, vehicles),
        }
    }

    fn walk_on(&mut self, streets: &Streets, crossings: &mut Crossings) {
        let before_m = self.position_m;
        let length_m = streets.walks[self.walk].course.length_m();
        self.s_m += self.pace_mps * STEP_S * if self.backwards { -1.0 } else { 1.0 };
        if !(0.0..=length_m).contains(&self.s_m) {
            self.s_m = self.s_m.clamp(0.0, length_m);
            self.turn_corner(streets);
            return;
        }
        self.stand_on_walk(streets);
        self.velocity_mps = (self.position_m - before_m) / STEP_S;
        let (jaywalks, crosses) =
            (self.noise.chance(JAYWALK_PER_S * STEP_S), self.noise.chance(CROSS_PER_S * STEP_S));
        if (jaywalks || crosses)
            && let Some(to) = self.landing_opposite(streets)
        {
            self.is_jaywalking = jaywalks;
            if jaywalks {
                crossings.without_notice += 1;
                self.activity = Activity::Crossing { to };
            } else {
                self.activity = Activity::Waiting { to, since_s: 0.0 };
            }
        }
    }

    /// At the end of a walk: on to another, across the street, or back.
    fn turn_corner(&mut self, streets: &Streets) {
        let onward = &streets.walks[self.walk].onward[usize::from(!self.backwards)];
        if onward.is_empty() {
            self.backwards = !self.backwards;
            return;
        }
        let onward = self.noise.pick(onward);
        let walk = &streets.walks[onward.walk];
        let s_m = if onward.at_end { walk.course.length_m() } else { 0.0 };
        let spot = walk.course.at(s_m);
        let aside_m = self.aside_m.clamp(-walk.half_width_m, walk.half_width_m);
        let position_m = spot.position_m + spot.forward.perp() * aside_m;
        let Onward { walk, at_end: backwards, crosses } = onward;
        let to = Landing { walk, s_m, backwards, position_m, crosses };
        self.is_jaywalking = false;
        self.activity = match onward.crosses {
            true => Activity::Waiting { to, since_s: 0.0 },
            false => Activity::Crossing { to },
        };
    }

    /// Straight across the street from here.
    fn landing_opposite(&self, streets: &Streets) -> Option<Landing> {
        let opposite = streets.walks[self.walk].opposite?;
        let walk = &streets.walks[opposite];
        let (s_m, _) = walk.course.project(self.position_m);
        let spot = walk.course.at(s_m);
        let width_m = spot.position_m.distance(self.position_m);
        let is_beside = s_m > 0.5 && s_m < walk.course.length_m() - 0.5;
        let (backwards, position_m) = (self.backwards, spot.position_m);
        let to = Landing { walk: opposite, s_m, backwards, position_m, crosses: true };
        (is_beside && width_m < WIDEST_M).then_some(to)
    }

    fn cross(&mut self, streets: &Streets, to: Landing, vehicles: &[Seen]) {
        let left = to.position_m - self.position_m;
        let step_m = self.pace_mps * STEP_S;
        if left.length() <= step_m {
            let walk = &streets.walks[to.walk];
            self.walk = to.walk;
            self.s_m = to.s_m;
            self.backwards = to.backwards;
            let spot = walk.course.at(to.s_m);
            self.aside_m = spot.forward.perp_dot(to.position_m - spot.position_m);
            self.activity = Activity::Walking;
            self.position_m = to.position_m;
            return;
        }
        self.facing = left.normalize();
        let next_m = self.position_m + self.facing * step_m;
        // Nobody walks into the side of what stands or passes right before them: what passes is
        // let by, from further away the longer it is, since its rear swings out in bends; what
        // stands is walked round, by its nearer end.
        const ARM_M: f64 = 0.45;
        const SWING: f64 = 0.15;
        let (here_m, position_m) = (self.position_m, next_m);
        let in_way = |seen: &&Seen| {
            let distance_m = seen.footprint.distance_m(position_m);
            let swing_m = if seen.speed_mps > 0.3 { SWING * seen.footprint.half_m.x } else { 0.0 };
            distance_m < ARM_M + swing_m && distance_m < seen.footprint.distance_m(here_m)
        };
        let next_m = match vehicles.iter().find(in_way) {
            None => next_m,
            Some(seen) if seen.speed_mps > 0.3 => here_m,
            Some(seen) => {
                let forward = seen.footprint.forward;
                let along = forward.dot(here_m - seen.footprint.centre_m).signum() * forward;
                here_m + along * step_m
            }
        };
        self.velocity_mps = (next_m - here_m) / STEP_S;
        self.position_m = next_m;
    }
}

/// Whether no vehicle comes to the line across before it is crossed.
fn has_gap(from_m: DVec2, to_m: DVec2, needed_s: f64, vehicles: &[Seen]) -> bool {
    let across = (to_m - from_m).normalize_or(DVec2::X);
    let width_m = from_m.distance(to_m);
    vehicles.iter().all(|seen| {
        let footprint = &seen.footprint;
        let from = footprint.centre_m - from_m;
        // Standing on the line, or right before it.
        let reach_m = footprint.radius_m() + 0.5;
        let is_between = |point: DVec2| {
            let at = (point - from_m).dot(across);
            at > -reach_m && at < width_m + reach_m
        };
        let aside_m = from.perp_dot(across);
        let approach_mps =
            -(footprint.forward * seen.speed_mps).perp_dot(across) * aside_m.signum();
        if aside_m.abs() < reach_m {
            return !is_between(footprint.centre_m);
        }
        if approach_mps < 0.3 {
            return true;
        }
        let arrival_s = (aside_m.abs() - reach_m) / approach_mps;
        let there_m = footprint.centre_m + footprint.forward * seen.speed_mps * arrival_s;
        arrival_s > needed_s + SPARE_S || !is_between(there_m)
    })
}
