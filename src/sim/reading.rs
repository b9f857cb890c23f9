//! What the car's devices say, before it is put into messages.

use glam::{DQuat, DVec2, DVec3};

use crate::{
    footprint::Footprint,
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
    let vehicles = snapshot.vehicles.iter().map(|vehicle| Object {
        id: vehicle.id,
        kind: ObjectKind::Vehicle(vehicle.kind),
        pose: middle(&vehicle.footprint, vehicle.ground_m, vehicle.climb, vehicle.height_m),
        size_m: (2.0 * vehicle.footprint.half_m).extend(vehicle.height_m),
        velocity_mps: vehicle.velocity_mps,
    });
    let walkers = snapshot.walkers.iter().map(|walker| Object {
        id: walker.id,
        kind: ObjectKind::Walker(walker.kind),
        pose: middle(&walker.footprint, walker.ground_m, 0.0, walker.kind.height_m()),
        size_m: (2.0 * walker.footprint.half_m).extend(walker.kind.height_m()),
        velocity_mps: walker.velocity_mps,
    });
    let ego_m = snapshot.ego.position_m;
    let is_near = |object: &Object| object.pose.position_m.truncate().distance(ego_m) < NEAR_M;
    vehicles.chain(walkers).filter(is_near).collect()
}

/// The middle of a box on ground that climbs along it.
fn middle(footprint: &Footprint, ground_m: f64, climb: f64, height_m: f64) -> Pose {
    let mut pose = Pose::new(footprint.centre_m.extend(ground_m), footprint.forward);
    if climb != 0.0 {
        pose.orientation *= DQuat::from_rotation_y(-climb.atan());
    }
    pose.position_m += pose.orientation * DVec3::new(0.0, 0.0, 0.5 * height_m);
    pose
}
