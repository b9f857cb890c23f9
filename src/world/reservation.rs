//! Right of way at junctions without signals: who asks first may cross first.
//!
//! A vehicle that comes near asks for the lanes that it will take through the junction. It is let
//! in when no lane that crosses them is taken, nobody who has waited longer for such a lane could
//! go, and there is room for it behind the junction. So nobody stops in the middle, everybody who
//! is in gets out, and the one who has waited longest goes next: there is no deadlock among those
//! who ask. Two whose ways come together are let in if the one behind is far enough behind.

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
    pub length_m: f64,
    pub speed_mps: f64,
    /// The lane of these that the vehicle's rear is on, and its arc length there, m; before the
    /// junction the first, negative.
    pub rear: (usize, f64),
}

/// Who comes out of a merge behind another keeps this gap, m, and this time gap, s, and can brake
/// down to the other's speed so hard, m/s2.
const MERGE_GAP_M: f64 = 2.0;
const MERGE_GAP_S: f64 = 1.0;
const MERGE_BRAKING_MPS2: f64 = 2.0;

impl Claim {
    /// Whether it still needs the stretch of its `index`-th lane up to `to_m`.
    fn needs(&self, index: usize, to_m: f64) -> bool {
        let (at, rear_m) = self.rear;
        index > at || index == at && rear_m < to_m
    }

    /// From the rear to the end of the `index`-th lane, m.
    fn to_end_m(&self, index: usize, streets: &Streets) -> f64 {
        let (at, rear_m) = self.rear;
        let lanes = self.lanes.get(at..=index).unwrap_or_default();
        lanes.iter().map(|lane| streets.lanes[*lane].length_m()).sum::<f64>() - rear_m
    }

    /// Whether two ways come together, and one would come out right behind the other.
    fn squeezes(&self, other: &Claim, streets: &Streets) -> bool {
        self.lanes.iter().enumerate().any(|(index, lane)| {
            streets.merging(*lane).iter().any(|with| {
                let Some(theirs) = other.lanes.iter().position(|lane| lane == with) else {
                    return false;
                };
                let own = (self, self.to_end_m(index, streets));
                let their = (other, other.to_end_m(theirs, streets));
                let (first, second) = if own.1 < their.1 { (own, their) } else { (their, own) };
                let gap_m = second.1 - second.0.length_m - first.1;
                let (speed, ahead) = (second.0.speed_mps, first.0.speed_mps);
                let braking_m = (speed.powi(2) - ahead.powi(2)) / (2.0 * MERGE_BRAKING_MPS2);
                first.1 > 0.0 && gap_m < MERGE_GAP_M + MERGE_GAP_S * speed + braking_m.max(0.0)
            })
        })
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
    /// Ask for a way, unless the actor has asked for it already; who knows more of it now, or goes
    /// another way, is let in anew, unless it is in.
    pub fn ask(&mut self, wanted: Claim) {
        let begins = |claim: &Claim| claim.lanes.iter().position(|lane| *lane == wanted.lanes[0]);
        let mut own = self.claims.iter_mut().filter(|claim| claim.actor == wanted.actor);
        let Some((claim, at)) = own.find_map(|claim| begins(claim).map(|at| (claim, at))) else {
            self.claims.push(wanted);
            return;
        };
        if claim.lanes[at..] != wanted.lanes[..] {
            claim.lanes.truncate(at);
            claim.lanes.extend(wanted.lanes);
            claim.is_taken &= wanted.is_taken || at > 0;
        }
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
                other.actor != claim.actor
                    && is_before(at, other)
                    && (claim.crosses(other, streets) || claim.squeezes(other, streets))
            });
            self.claims[index].is_taken = !blocked;
        }
    }

    /// Whether an actor may enter a lane of a junction.
    pub fn may_enter(&self, actor: ActorId, lane: LaneId) -> bool {
        let mut own = self.claims.iter().filter(|claim| claim.actor == actor);
        own.any(|claim| claim.is_taken && claim.lanes.contains(&lane))
    }

    /// Forget an actor's claims but those that it is to keep.
    pub fn forget(&mut self, actor: ActorId, keeps: impl Fn(&Claim) -> bool) {
        self.claims.retain(|claim| claim.actor != actor || keeps(claim));
    }
}
