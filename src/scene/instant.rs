//! All that moves, at one instant, as meshes with places.

use std::sync::Arc;

use glam::{Affine3A, DAffine3, DMat3, DVec3};

use crate::{
    footprint::Footprint,
    scene::{mesh::Mesh, shapes::Shapes},
    world::{
        kind::{VEHICLES, VehicleKind, VehicleModel},
        reservation::ActorId,
        snapshot::{Snapshot, VehicleState, WalkerState},
    },
};

/// Brake lamps come on when a vehicle slows down by more than this, m/s2, or stands, m/s.
const BRAKING_MPS2: f64 = -0.6;
const STANDING_MPS: f64 = 0.1;

/// Colours of cars by their share of a hundred, sRGB: of new cars in Germany in 2023 (KBA), about.
const CAR_COLOURS: [(f64, [u8; 3]); 10] = [
    (28.0, [112, 116, 122]),
    (24.0, [30, 31, 34]),
    (21.0, [226, 227, 228]),
    (6.0, [170, 174, 178]),
    (6.0, [40, 66, 118]),
    (4.0, [84, 120, 166]),
    (6.0, [150, 32, 34]),
    (2.0, [52, 78, 62]),
    (2.0, [206, 122, 42]),
    (1.0, [212, 186, 60]),
];

/// Colours of vans, trucks and buses, in equal shares.
const WORK_COLOURS: [[u8; 3]; 6] =
    [[228, 228, 226], [226, 226, 224], [200, 160, 44], [46, 84, 146], [158, 40, 38], [62, 116, 88]];

/// Colours of jackets, in equal shares.
const JACKETS: [[u8; 3]; 10] = [
    [38, 40, 46],
    [58, 64, 84],
    [104, 46, 44],
    [84, 96, 74],
    [150, 142, 128],
    [176, 60, 48],
    [52, 92, 128],
    [196, 184, 160],
    [90, 70, 96],
    [210, 170, 60],
];

/// No body reaches further from its origin than this, m.
pub const LARGEST_BODY_M: f32 = 12.0;

/// A mesh somewhere in the world: a vehicle, or somebody on foot in a pose.
#[derive(Clone, Debug)]
pub struct Body {
    pub actor: ActorId,
    /// In the frame of the body: x forward, y left, z up, the origin on the ground below its middle.
    pub mesh: Arc<Mesh>,
    pub world_from_body: Affine3A,
    /// Of coachwork and jackets, sRGB.
    pub colour: [u8; 3],
    /// World frame, m/s.
    pub velocity_mps: DVec3,
    pub is_braking: bool,
}

/// What moves, without the ego vehicle, which its own sensors do not see.
#[derive(Clone, Debug, Default)]
pub struct Instant {
    pub time_s: f64,
    /// Ascending by actor: vehicles, then people.
    pub bodies: Vec<Body>,
}

impl Instant {
    /// The bodies of a snapshot.
    pub fn of(snapshot: &Snapshot, shapes: &Shapes) -> Instant {
        let vehicles = snapshot.vehicles.iter().map(|state| vehicle(state, shapes));
        let walkers = snapshot.walkers.iter().map(|state| walker(state, shapes));
        Instant { time_s: snapshot.time_s, bodies: vehicles.chain(walkers).collect() }
    }
}

fn vehicle(state: &VehicleState, shapes: &Shapes) -> Body {
    let speed_mps = state.velocity_mps.length();
    Body {
        actor: state.id,
        mesh: shapes.vehicle(state.kind, state.id),
        world_from_body: place(&state.footprint, state.ground_m, state.climb, stretch(state)),
        colour: coachwork(state.kind, state.colour),
        velocity_mps: state.velocity_mps.extend(speed_mps * state.climb),
        is_braking: state.acceleration_mps2 < BRAKING_MPS2 || speed_mps < STANDING_MPS,
    }
}

fn walker(state: &WalkerState, shapes: &Shapes) -> Body {
    Body {
        actor: state.id,
        mesh: shapes.walker(state),
        world_from_body: place(&state.footprint, state.ground_m, 0.0, DVec3::ONE),
        colour: one_of(&JACKETS, state.colour),
        velocity_mps: state.velocity_mps.extend(0.0),
        is_braking: false,
    }
}

/// Where a footprint stands on ground that climbs along it, and how its body is stretched along its
/// axes. Lanes are level across, so nothing leans to a side.
fn place(footprint: &Footprint, ground_m: f64, climb: f64, stretch: DVec3) -> Affine3A {
    let (forward, left) =
        (footprint.forward.extend(climb).normalize(), footprint.left().extend(0.0));
    let up = forward.cross(left);
    let axes = DMat3::from_cols(forward * stretch.x, left * stretch.y, up * stretch.z);
    DAffine3::from_mat3_translation(axes, footprint.centre_m.extend(ground_m)).as_affine3a()
}

/// The size of a vehicle over that of the meshes of its kind: no two are quite alike.
fn stretch(state: &VehicleState) -> DVec3 {
    let model = VEHICLES.iter().find(|model| model.kind == state.kind);
    let of = |model: &VehicleModel| {
        (state.footprint.half_m / model.half_m).extend(state.height_m / model.height_m)
    };
    model.map_or(DVec3::ONE, of)
}

fn coachwork(kind: VehicleKind, colour: f64) -> [u8; 3] {
    if matches!(kind, VehicleKind::Van | VehicleKind::Truck | VehicleKind::Bus) {
        return one_of(&WORK_COLOURS, colour);
    }
    let mut left = colour * CAR_COLOURS.iter().map(|(share, _)| share).sum::<f64>();
    for (share, colour) in CAR_COLOURS {
        left -= share;
        if left < 0.0 {
            return colour;
        }
    }
    CAR_COLOURS[0].1
}

/// The choice that a number in [0, 1) stands for.
fn one_of(colours: &[[u8; 3]], number: f64) -> [u8; 3] {
    let place = (number * colours.len() as f64) as usize;
    colours[place.min(colours.len() - 1)]
}
