//! The meshes of all that moves, made once: vehicles in several models, people in many poses.

use std::sync::Arc;

use glam::{DVec2, Vec3};

use crate::{
    scene::{
        mesh::Mesh,
        people::{GAITS, Gait, Look, STANDING, person, stride_m},
        two_wheelers::{bicycle, motorcycle},
        vehicles::{buses, cars, jeeps, trucks, vans},
    },
    world::{
        ego::SEDAN,
        kind::{VEHICLES, VehicleKind, VehicleModel, WalkerKind},
        reservation::ActorId,
        snapshot::WalkerState,
    },
};

/// Poses of a cycle of two steps.
pub const POSES: usize = 16;

/// Slower than this, people stand, m/s.
const STANDING_MPS: f64 = 0.15;

const ADULTS: [Look; 4] = [
    look([46, 52, 70], [206, 164, 138], [58, 44, 36]),
    look([62, 60, 58], [168, 122, 92], [30, 26, 24]),
    look([96, 88, 74], [224, 188, 164], [150, 116, 72]),
    look([34, 34, 38], [104, 72, 54], [24, 22, 22]),
];
const CHILDREN: [Look; 3] = [
    child([60, 78, 120], [220, 180, 154], [120, 88, 56]),
    child([110, 64, 72], [176, 128, 98], [36, 30, 28]),
    child([70, 74, 66], [208, 170, 146], [72, 54, 40]),
];
const HELMETS: [[u8; 3]; 3] = [[226, 226, 222], [40, 40, 44], [176, 42, 36]];

const fn look(trousers: [u8; 3], skin: [u8; 3], hair: [u8; 3]) -> Look {
    Look { scale: 1.0, head: 1.0, trousers, skin, hair, has_helmet: false }
}

const fn child(trousers: [u8; 3], skin: [u8; 3], hair: [u8; 3]) -> Look {
    Look { head: 1.25, scale: 0.66, ..look(trousers, skin, hair) }
}

/// Somebody on foot, in all poses.
#[derive(Clone, Debug)]
struct Walking {
    height_m: f64,
    standing: Arc<Mesh>,
    /// By gait, then by place in the cycle.
    cycles: Vec<Vec<Arc<Mesh>>>,
}

/// All meshes of all that moves.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// Models of each kind, in the order of [`VEHICLES`].
    vehicles: Vec<Vec<Arc<Mesh>>>,
    adults: Vec<Walking>,
    children: Vec<Walking>,
    ego: Arc<Mesh>,
}

impl Default for Shapes {
    fn default() -> Shapes {
        Shapes::new()
    }
}

impl Shapes {
    pub fn new() -> Shapes {
        let sized = |model: &VehicleModel| {
            let all = models(model.kind).into_iter();
            all.map(|mesh| Arc::new(sized(mesh, model))).collect()
        };
        let vehicles: Vec<Vec<Arc<Mesh>>> = VEHICLES.iter().map(sized).collect();
        let ego = ego();
        let walking = |kind: WalkerKind, looks: &[Look]| {
            looks.iter().map(|look| Walking::new(look, kind.height_m())).collect()
        };
        Shapes {
            vehicles,
            adults: walking(WalkerKind::Adult, &ADULTS),
            children: walking(WalkerKind::Child, &CHILDREN),
            ego: Arc::new(ego),
        }
    }

    /// The models of a kind.
    pub fn models(&self, kind: VehicleKind) -> &[Arc<Mesh>] {
        let place = VEHICLES.iter().position(|model| model.kind == kind).unwrap_or(0);
        &self.vehicles[place]
    }

    /// The mesh of a vehicle.
    pub fn vehicle(&self, kind: VehicleKind, id: ActorId) -> Arc<Mesh> {
        let models = self.models(kind);
        models[mixed(id) % models.len()].clone()
    }

    /// The mesh of somebody on foot: the legs move with the way that is gone, swing as far as the speed
    /// makes them, and stand still with the body.
    pub fn walker(&self, state: &WalkerState) -> Arc<Mesh> {
        let looks = match state.kind {
            WalkerKind::Adult => &self.adults,
            WalkerKind::Child => &self.children,
        };
        let walking = &looks[mixed(state.id) % looks.len()];
        let speed_mps = state.velocity_mps.length();
        if speed_mps < STANDING_MPS {
            return walking.standing.clone();
        }
        // Short legs swing as far at a lower speed.
        let stature = walking.height_m / WalkerKind::Adult.height_m();
        let alike = |mps: f64| mps / stature.sqrt();
        // Steps of one length at all times: legs do not jump when somebody slows down.
        let stride_m = stride_m(alike(state.pace_mps) as f32, walking.height_m as f32);
        let strides = state.walked_m / f64::from(stride_m) + f64::from(state.id) * 0.618;
        let cycle = &walking.cycles[nearest_gait(alike(speed_mps))];
        cycle[(strides.rem_euclid(1.0) * POSES as f64) as usize % POSES].clone()
    }

    /// The ego vehicle, for pictures from outside.
    pub fn ego(&self) -> Arc<Mesh> {
        self.ego.clone()
    }
}

impl Walking {
    fn new(look: &Look, height_m: f64) -> Walking {
        let standing = person(look, &STANDING);
        let top_m = standing.bounds_m().map_or(1.0, |(_, high)| high.z);
        // Exactly as tall as everybody of the kind.
        let scale = height_m as f32 / top_m;
        let look = Look { scale: look.scale * scale, ..*look };
        let cycle = |gait: &Gait| {
            let pose = |k: usize| gait.pose(k as f32 / POSES as f32);
            (0..POSES).map(|k| Arc::new(person(&look, &pose(k)))).collect()
        };
        Walking {
            height_m,
            standing: Arc::new(person(&look, &STANDING)),
            cycles: GAITS.iter().map(cycle).collect(),
        }
    }
}

fn nearest_gait(speed_mps: f64) -> usize {
    let off = |gait: &Gait| (f64::from(gait.speed_mps) - speed_mps).abs();
    let nearest = (0..GAITS.len()).min_by(|a, b| off(&GAITS[*a]).total_cmp(&off(&GAITS[*b])));
    nearest.unwrap_or(0)
}

/// A number that does not count up as ids do.
fn mixed(id: ActorId) -> usize {
    (u64::from(id).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as usize
}

fn models(kind: VehicleKind) -> Vec<Mesh> {
    let rider = |k: usize, has_helmet: bool| Look {
        has_helmet,
        hair: if has_helmet { HELMETS[k % HELMETS.len()] } else { ADULTS[k].hair },
        scale: 0.98,
        ..ADULTS[k]
    };
    match kind {
        VehicleKind::Car => cars(),
        VehicleKind::Jeep => jeeps(),
        VehicleKind::Van => vans(),
        VehicleKind::Truck => trucks(),
        VehicleKind::Bus => buses(),
        VehicleKind::Motorcycle => (0..3).map(|k| motorcycle(&rider(k, true))).collect(),
        VehicleKind::Bicycle => (0..4).map(|k| bicycle(&rider(k, k % 2 == 0))).collect(),
    }
}

/// Two-wheelers to the size of their kind; others have it by their measures, without mirrors.
fn sized(mesh: Mesh, model: &VehicleModel) -> Mesh {
    match model.kind {
        VehicleKind::Motorcycle | VehicleKind::Bicycle => {
            stretched(mesh, model.half_m, model.height_m)
        }
        _ => mesh,
    }
}

/// A mesh with given bounds.
fn stretched(mut mesh: Mesh, half_m: DVec2, height_m: f64) -> Mesh {
    let Some((low, high)) = mesh.bounds_m() else { return mesh };
    let wanted = (2.0 * half_m).extend(height_m).as_vec3();
    let factor = wanted / (high - low);
    let middle = 0.5 * (low + high);
    let foot = Vec3::new(middle.x, middle.y, low.z);
    for vertex in &mut mesh.vertices {
        vertex.position_m = (vertex.position_m - foot) * factor;
    }
    mesh
}

/// The first of the cars, stretched to the ego vehicle's size.
fn ego() -> Mesh {
    let mut mesh = cars().swap_remove(0);
    let car = &VEHICLES[0];
    let factor = Vec3::new(
        (SEDAN.half_length_m / car.half_m.x) as f32,
        (SEDAN.half_width_m / car.half_m.y) as f32,
        (SEDAN.height_m / car.height_m) as f32,
    );
    mesh.vertices.iter_mut().for_each(|vertex| vertex.position_m *= factor);
    mesh
}
