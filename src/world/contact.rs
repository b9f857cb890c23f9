//! Who touched the ego vehicle, where, how fast, and whose fault it was.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{
    footprint::Footprint,
    world::{
        kind::{VehicleKind, WalkerKind},
        reservation::ActorId,
    },
};

/// What the ego vehicle can run into, or be run into by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "what", content = "kind", rename_all = "kebab-case")]
pub enum Other {
    Vehicle(VehicleKind),
    Walker(WalkerKind),
    /// A building, a pole, a tree.
    Static,
}

/// Who moved into whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fault {
    Ego,
    Other,
}

/// The first touch of the ego vehicle and something else.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    pub other: Other,
    /// Number of the actor; none of what stands for ever.
    pub actor: Option<ActorId>,
    pub time_s: f64,
    /// Between the two, world frame, m.
    pub position_m: [f64; 2],
    /// Length of the difference of both velocities, m/s.
    pub relative_speed_mps: f64,
    pub fault: Fault,
}

/// Something that could be touched, as it is now.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    pub other: Other,
    pub actor: Option<ActorId>,
    pub footprint: Footprint,
    pub velocity_mps: DVec2,
}

/// The contact of the ego vehicle with a body, if they touch.
pub fn contact(ego: &Body, body: &Body, time_s: f64) -> Option<Contact> {
    let (gap_m, axis) = ego.footprint.separation(&body.footprint);
    if gap_m > 0.0 {
        return None;
    }
    // At fault is who moves faster towards the other, along the line that parts them.
    let (ego_mps, other_mps) = (ego.velocity_mps.dot(axis), -body.velocity_mps.dot(axis));
    let reach_m = ego.footprint.reach_m(axis) + gap_m / 2.0;
    let towards = ego.footprint.centre_m + axis * reach_m;
    Some(Contact {
        other: body.other,
        actor: body.actor,
        time_s,
        position_m: towards.to_array(),
        relative_speed_mps: (ego.velocity_mps - body.velocity_mps).length(),
        fault: if ego_mps >= other_mps { Fault::Ego } else { Fault::Other },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(x: f64, y: f64, velocity_mps: DVec2) -> Body {
        let footprint = Footprint::new(DVec2::new(x, y), 0.0, DVec2::new(2.45, 0.93));
        Body { other: Other::Vehicle(VehicleKind::Car), actor: Some(3), footprint, velocity_mps }
    }

    #[test]
    fn who_drives_into_the_other_is_at_fault() {
        let moving = DVec2::new(8.0, 0.0);
        let fault = |ego: &Body, other: &Body| contact(ego, other, 1.0).map(|c| c.fault);
        let (standing, behind) = (body(0.0, 0.0, DVec2::ZERO), body(-4.85, 0.2, moving));
        assert_eq!(fault(&standing, &behind), Some(Fault::Other), "hit from behind");
        assert_eq!(fault(&behind, &standing), Some(Fault::Ego), "the same, the other way round");
        let aside = body(0.5, 1.8, DVec2::new(8.0, -1.0));
        assert_eq!(
            fault(&body(0.0, 0.0, moving), &aside),
            Some(Fault::Other),
            "cut in from the left"
        );
        assert_eq!(fault(&standing, &body(6.0, 0.0, moving)), None);
    }

    #[test]
    fn the_speed_of_a_contact_is_that_of_one_as_the_other_sees_it() {
        let (ego, other) = (body(0.0, 0.0, DVec2::X * 8.0), body(4.8, 0.0, DVec2::X * -3.0));
        let contact = contact(&ego, &other, 2.5).unwrap();
        assert_eq!((contact.relative_speed_mps, contact.time_s), (11.0, 2.5));
        assert!((1.8..3.0).contains(&contact.position_m[0]), "{:?}", contact.position_m);
    }
}
