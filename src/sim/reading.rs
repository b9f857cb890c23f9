//! What the car's devices say, before it is put into messages.

use glam::{DQuat, DVec2, DVec3};

use crate::{
    frame::Command,
    policy::Action,
    sensors::{
        gnss::GnssFix, imu::ImuReading, lidar::LidarReturn, odometry::OdometryReading,
        radar::RadarReturn,
    },
    world::{
        ego::Car,
        kind::{VehicleKind, WalkerKind},
        reservation::ActorId,
        route::{Route, Waypoint},
        snapshot::Snapshot,
    },
};

/// One sample of a source.
#[derive(Clone, Debug)]
pub enum Reading {
    /// A picture as JPEG.
    Picture(Vec<u8>),
    Lidar(Vec<LidarReturn>),
    Radar(Vec<RadarReturn>),
    Odometry(OdometryReading),
    Imu(ImuReading),
    Fix(GnssFix),
    Control {
        wanted: Action,
        applied: Action,
        car: Car,
    },
    Situation {
        in_junction: bool,
        speed_limit_mps: f64,
        command: Command,
    },
    /// The way ahead, from a little behind the car.
    Route(Vec<Pose>),
    /// All that moves near the car.
    Objects(Vec<Object>),
}

/// A place and a heading on the ground, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    pub position_m: DVec3,
    pub orientation: DQuat,
}

/// The kind of an [`Object`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ObjectKind {
    Vehicle(VehicleKind),
    Walker(WalkerKind),
}

/// The box around somebody.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Object {
    pub id: ActorId,
    pub kind: ObjectKind,
    /// Of the middle of the box.
    pub pose: Pose,
    /// Length, width, height, m.
    pub size_m: DVec3,
    pub velocity_mps: DVec2,
}

/// Objects further from the car than this are told by nobody, m: a little more than sensors reach.
const NEAR_M: f64 = 120.0;

/// What a path begins with behind the car and ends with beyond the route that frames have, m: the car
/// drives on until the next one comes.
const BEHIND_M: f64 = 5.0;
const AHEAD_M: f64 = 70.0;

impl Pose {
    fn new(position_m: DVec3, forward: DVec2) -> Pose {
        Pose { position_m, orientation: DQuat::from_rotation_z(forward.to_angle()) }
    }
}

/// The part of a route around a car that has come `at_m` on it.
pub fn way_ahead(route: &Route, at_m: f64) -> Vec<Pose> {
    let (from, to) = (route.index_at(at_m - BEHIND_M), route.index_at(at_m + AHEAD_M));
    let pose = |waypoint: &Waypoint| {
        Pose::new(waypoint.position_m.extend(waypoint.height_m), route.forward(waypoint.at_m))
    };
    route.waypoints()[from..=to].iter().map(pose).collect()
}

/// Boxes of all that moves near the car: vehicles, then people.
pub fn objects(snapshot: &Snapshot) -> Vec<Object> {
    let vehicles = snapshot.vehicles.iter().map(|vehicle| {
        let kind = ObjectKind::Vehicle(vehicle.kind);
        (
            vehicle.id,
            kind,
            vehicle.footprint,
            vehicle.ground_m,
            vehicle.height_m,
            vehicle.velocity_mps,
        )
    });
    let walkers = snapshot.walkers.iter().map(|walker| {
        let (kind, height_m) = (ObjectKind::Walker(walker.kind), walker.kind.height_m());
        (walker.id, kind, walker.footprint, walker.ground_m, height_m, walker.velocity_mps)
    });
    let ego_m = snapshot.ego.position_m;
    let near = vehicles
        .chain(walkers)
        .filter(|(_, _, footprint, ..)| footprint.centre_m.distance(ego_m) < NEAR_M);
    let object = |(id, kind, footprint, ground_m, height_m, velocity_mps)| {
        let footprint: crate::footprint::Footprint = footprint;
        let middle_m = footprint.centre_m.extend(ground_m + height_m / 2.0);
        Object {
            id,
            kind,
            pose: Pose::new(middle_m, footprint.forward),
            size_m: (2.0 * footprint.half_m).extend(height_m),
            velocity_mps,
        }
    };
    near.map(object).collect()
}
