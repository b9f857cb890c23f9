//! A drive from start to end: goal, contact, or out of time.

use serde::{Deserialize, Serialize};

use crate::{
    policy::Action,
    world::{
        contact::{Contact, Other},
        scoring::Sums,
        simulation::{SUBSTEPS, World},
    },
};

/// When a drive is over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Rules {
    /// The goal is reached this near to it, m.
    pub goal_m: f64,
    /// Time limit: the route at this speed, km/h, and then some (NoCrash's formula).
    pub slowest_kmph: f64,
    pub grace_s: f64,
    /// Further from the route than this the drive is over, m.
    pub off_route_m: f64,
}

impl Default for Rules {
    /// The goal lies as near as the paper's controller aims ahead, and the time limit is that of twice
    /// NoCrash's speed.
    fn default() -> Rules {
        Rules { goal_m: 5.0, slowest_kmph: 10.0, grace_s: 20.0, off_route_m: 30.0 }
    }
}

impl Rules {
    /// Time for a route of a length, s.
    pub fn limit_s(&self, route_m: f64) -> f64 {
        route_m / (self.slowest_kmph / 3.6) + self.grace_s
    }
}

/// How a drive ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "end", rename_all = "kebab-case")]
pub enum End {
    Goal,
    Contact(Contact),
    Timeout,
    OffRoute,
}

impl End {
    /// In a word, by whom the ego vehicle touched.
    pub fn name(&self) -> &'static str {
        match self {
            End::Goal => "goal",
            End::Contact(contact) => match contact.other {
                Other::Vehicle(_) => "collision-vehicle",
                Other::Walker(_) => "collision-pedestrian",
                Other::Static => "collision-static",
            },
            End::Timeout => "timeout",
            End::OffRoute => "off-route",
        }
    }
}

/// A drive, over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub end: End,
    pub route_m: f64,
    pub progress_m: f64,
    pub sums: Sums,
}

/// Looks on as somebody drives, and says when the drive is over.
#[derive(Clone, Debug)]
pub struct Watch {
    rules: Rules,
    limit_s: f64,
    sums: Sums,
}

impl Watch {
    /// Of a drive that has not begun.
    pub fn new(world: &World, rules: Rules) -> Watch {
        let limit_s = rules.limit_s(world.route.length_m());
        Watch { rules, limit_s, sums: Sums::default() }
    }

    /// What has been counted so far.
    pub fn sums(&self) -> &Sums {
        &self.sums
    }

    /// When time is out, s.
    pub fn limit_s(&self) -> f64 {
        self.limit_s
    }

    /// Look at the world, every 0.1 s and at the first contact; `Some` when the drive is over.
    pub fn look(&mut self, world: &World) -> Option<End> {
        let (route, ego, progress_m) = (&world.route, world.ego(), world.progress_m());
        self.sums.add(&world.streets, route, progress_m, ego);
        if let Some(contact) = world.contact() {
            return Some(End::Contact(*contact));
        }
        let left_m = route.length_m() - progress_m;
        let goal_m = self.rules.goal_m;
        if left_m < goal_m && ego.position_m.distance(route.goal_m()) < goal_m {
            return Some(End::Goal);
        }
        if route.at(progress_m).position_m.distance(ego.position_m) > self.rules.off_route_m {
            return Some(End::OffRoute);
        }
        (world.time_s() > self.limit_s).then_some(End::Timeout)
    }

    /// What the drive came to.
    pub fn outcome(self, world: &World, end: End) -> Outcome {
        let (route_m, progress_m) = (world.route.length_m(), world.progress_m());
        Outcome { end, route_m, progress_m, sums: self.sums }
    }
}

/// Let a driver drive; it is asked every 0.1 s.
pub fn drive(world: &mut World, driver: &mut dyn FnMut(&World) -> Action) -> Outcome {
    let mut watch = Watch::new(world, Rules::default());
    loop {
        let action = driver(world);
        for _ in 0..SUBSTEPS {
            world.step(action);
            if world.contact().is_some() {
                break;
            }
        }
        if let Some(end) = watch.look(world) {
            return watch.outcome(world, end);
        }
    }
}
