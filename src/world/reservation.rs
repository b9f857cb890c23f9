//! Right of way at junctions without signals: who asks first may cross first.
//!
//! A vehicle that comes near asks for the lanes that it will take through the junction. It is let
//! in when no lane that crosses them is taken, nobody who has waited longer for such a lane could
//! go, and there is room for it behind the junction. So nobody stops in the middle, everybody who
//! is in gets out, and the one who has waited longest goes next: there is no deadlock among those
//! who ask.

use crate::world::streets::{LaneId, Streets};

/// Number of an actor; 0 is the ego vehicle.
pub type ActorId = u32;

/// A way through a junction, asked for or taken.
#[derive(Clone, Debug)]
pub struct Claim {
    pub actor: ActorId,
    /// Lanes inside the junction, in order.
    pub lanes: Vec<LaneId>,
    /// Step at which it was asked for.
    pub since: u64,
    pub is_taken: bool,
    /// Whether there is room behind the junction now.
    pub has_room: bool,
    /// The vehicle needs more room than a car does.
    pub is_wide: bool,
    /// The lane of these that the vehicle is on, and the arc length of its rear there, m; before
    /// the junction the first, negative.
    pub rear: (usize, f64),
}

impl Claim {
    /// Whether it still needs the stretch of its `index`-th lane up to `to_m`.
    fn needs(&self, index: usize, to_m: f64) -> bool {
        let (at, rear_m) = self.rear;
        index > at || index == at && rear_m < to_m
    }

    /// Whether two ways cross where both still have to pass.
    fn crosses(&self, other: &Claim, streets: &Streets) -> bool {
        self.lanes.iter().enumerate().any(|(index, lane)| {
            let conflicts = streets.conflicts(*lane).iter();
            conflicts.filter(|c| !c.is_wide || self.is_wide || other.is_wide).any(|conflict| {
                let theirs = other.lanes.iter().position(|lane| *lane == conflict.with);
                theirs.is_some_and(|theirs| {
                    let back = streets.conflicts(conflict.with).iter().find(|c| c.with == *lane);
                    let their_end_m = back.map_or(f64::INFINITY, |c| c.to_m);
                    self.needs(index, conflict.to_m) && other.needs(theirs, their_end_m)
                })
            })
        })
    }
}

/// All claims of a town, ascending by (step of asking, actor).
#[derive(Clone, Debug, Default)]
pub struct Reservations {
    claims: Vec<Claim>,
}

impl Reservations {
    /// Ask for a way, unless the actor has asked for one that begins there already.
    pub fn ask(
        &mut self,
        actor: ActorId,
        is_wide: bool,
        lanes: &[LaneId],
        step: u64,
        is_inside: bool,
    ) {
        let has_asked =
            |claim: &Claim| claim.actor == actor && claim.lanes.first() == lanes.first();
        if self.claims.iter().any(has_asked) {
            return;
        }
        self.claims.push(Claim {
            actor,
            lanes: lanes.to_vec(),
            since: step,
            is_taken: is_inside,
            has_room: false,
            is_wide,
            rear: (0, f64::NEG_INFINITY),
        });
    }

    /// What the actors' claims are, to bring them up to date.
    pub fn claims_mut(&mut self) -> &mut Vec<Claim> {
        &mut self.claims
    }

    pub fn claims(&self) -> &[Claim] {
        &self.claims
    }

    /// Let in whoever may go, in the order of asking.
    pub fn settle(&mut self, streets: &Streets) {
        self.claims.sort_by_key(|claim| (claim.since, claim.actor));
        for index in 0..self.claims.len() {
            let claim = &self.claims[index];
            if claim.is_taken || !claim.has_room {
                continue;
            }
            let is_before =
                |at: usize, other: &Claim| other.is_taken || (at < index && other.has_room);
            let mut others = self.claims.iter().enumerate();
            let blocked = others.any(|(at, other)| {
                other.actor != claim.actor && is_before(at, other) && claim.crosses(other, streets)
            });
            self.claims[index].is_taken = !blocked;
        }
    }

    /// Whether an actor may enter a lane of a junction.
    pub fn may_enter(&self, actor: ActorId, lane: LaneId) -> bool {
        let mut own = self.claims.iter().filter(|claim| claim.actor == actor);
        own.any(|claim| claim.is_taken && claim.lanes.contains(&lane))
    }

    /// Forget an actor's claims, all or those that hold no lane of `keep`.
    pub fn forget(&mut self, actor: ActorId, keep: &[LaneId]) {
        self.claims.retain(|claim| {
            claim.actor != actor || claim.lanes.iter().any(|lane| keep.contains(lane))
        });
    }
}
