//! People, low in detail, from their joints: standing, walking, running, riding.
//!
//! Body frame: x forward, y left, z up; the origin lies on the ground below the middle.

use std::f32::consts::{PI, TAU};

use glam::{Vec2, Vec3};

use crate::scene::{
    mesh::{Material, Mesh},
    solids::{Paint, paint},
};

/// Takes the colour of the body.
const JACKET: Paint = paint(Material::Jacket, [120, 120, 120]);
const SHOES: Paint = paint(Material::Rubber, [44, 40, 38]);

/// Lengths of an adult of 1.75 m, m: from hip to knee, from knee to sole, from hip to shoulder,
/// from shoulder to elbow, from elbow to finger tips, from shoulder to the middle of the head.
const THIGH_M: f32 = 0.43;
const SHANK_M: f32 = 0.48;
const BACK_M: f32 = 0.53;
const UPPER_ARM_M: f32 = 0.29;
const FOREARM_M: f32 = 0.38;
const NECK_M: f32 = 0.19;
const HIP_M: f32 = 0.1;
const SHOULDER_M: f32 = 0.205;
const SHOE_M: f32 = 0.07;
/// From hip to heel and from hip to toes along the sole, m.
const HEEL_M: f32 = 0.07;
const TOES_M: f32 = 0.18;

/// How somebody is dressed and shaped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// Of an adult of 1.75 m.
    pub scale: f32,
    /// Of the head, over that of the rest: children have large ones.
    pub head: f32,
    pub trousers: [u8; 3],
    pub skin: [u8; 3],
    pub hair: [u8; 3],
    pub has_helmet: bool,
}

/// Angles of joints, rad: legs and arms positive forward from straight down, left before right;
/// knees and elbows positive as they bend.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    pub thigh_rad: [f32; 2],
    pub knee_rad: [f32; 2],
    pub upper_arm_rad: [f32; 2],
    pub elbow_rad: [f32; 2],
    /// Of the back, forward.
    pub lean_rad: f32,
    /// Of legs and arms, to the sides.
    pub spread_rad: f32,
    /// Height of the hips, m; none where the feet are to stand on the ground.
    pub hip_m: Option<f32>,
    /// The lower foot is so far above the ground, m.
    pub flight_m: f32,
}

/// A way of moving on foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gait {
    pub speed_mps: f32,
    swing_rad: f32,
    knee_rad: f32,
    elbow_rad: f32,
    lean_rad: f32,
    flight_m: f32,
}

/// Ways of moving, from slow to fast.
pub const GAITS: [Gait; 5] = [
    gait(0.6, 0.24, 0.7, 0.15, 0.0, 0.0),
    gait(1.0, 0.36, 0.9, 0.2, 0.02, 0.0),
    gait(1.45, 0.46, 1.05, 0.35, 0.04, 0.0),
    gait(2.3, 0.58, 1.5, 1.3, 0.12, 0.04),
    gait(3.2, 0.7, 1.8, 1.5, 0.17, 0.07),
];

const fn gait(
    speed_mps: f32,
    swing_rad: f32,
    knee_rad: f32,
    elbow_rad: f32,
    lean_rad: f32,
    flight_m: f32,
) -> Gait {
    Gait { speed_mps, swing_rad, knee_rad, elbow_rad, lean_rad, flight_m }
}

/// Length of two steps at a speed, for somebody of a height, m: longer steps and more of them the
/// faster one is (about the square root of the speed each).
pub fn stride_m(speed_mps: f32, height_m: f32) -> f32 {
    0.8 * height_m * (speed_mps / 1.3).sqrt()
}

/// Everybody stands like this.
pub const STANDING: Pose = Pose {
    thigh_rad: [0.03, -0.03],
    knee_rad: [0.0, 0.0],
    upper_arm_rad: [0.04, -0.02],
    elbow_rad: [0.12, 0.15],
    lean_rad: 0.0,
    spread_rad: 0.04,
    hip_m: None,
    flight_m: 0.0,
};

impl Gait {
    /// The pose at a share of the cycle of two steps; at 0 the left heel comes down.
    pub fn pose(&self, share: f32) -> Pose {
        let legs = [share, (share + 0.5).fract()];
        let forward = legs.map(|share| libm::cosf(TAU * share));
        // A knee bends as its leg swings to the front, in the second half of its cycle.
        let bend = |share: f32| {
            let swing = ((share - 0.5) / 0.5).clamp(0.0, 1.0);
            0.08 + self.knee_rad * libm::sinf(PI * swing.powf(0.8)).max(0.0)
        };
        Pose {
            thigh_rad: forward.map(|forward| self.swing_rad * (forward + 0.15)),
            knee_rad: legs.map(bend),
            upper_arm_rad: forward.map(|forward| -0.85 * self.swing_rad * forward),
            elbow_rad: [self.elbow_rad; 2],
            lean_rad: self.lean_rad,
            spread_rad: 0.02,
            hip_m: None,
            // In the air twice a cycle: a quarter of it after each foot came down.
            flight_m: self.flight_m * (0.5 - 0.5 * libm::cosf(2.0 * TAU * (share + 0.5))),
        }
    }
}

/// Somebody in a pose.
pub fn person(look: &Look, pose: &Pose) -> Mesh {
    let trousers = paint(Material::Trousers, look.trousers);
    let mut mesh = Mesh::default();
    let legs = [0, 1].map(|side| Leg::new(side, pose));
    let lowest_m = legs.iter().map(Leg::lowest_m).fold(f32::INFINITY, f32::min);
    let hip_m = pose.hip_m.map_or(pose.flight_m - lowest_m, |hip_m| hip_m / look.scale);
    let hip = Vec3::new(0.0, 0.0, hip_m);
    for leg in &legs {
        leg.draw(hip, trousers, &mut mesh);
    }
    let up = Vec3::new(libm::sinf(pose.lean_rad), 0.0, libm::cosf(pose.lean_rad));
    let waist = hip + 0.1 * up;
    mesh.limb(
        [hip - 0.08 * up, waist],
        Vec3::Y,
        [Vec2::new(0.15, 0.1), Vec2::new(0.16, 0.11)],
        trousers,
    );
    let shoulders = hip + BACK_M * up;
    let trunk = [waist - 0.04 * up, shoulders + 0.03 * up];
    mesh.limb(trunk, Vec3::Y, [Vec2::new(0.165, 0.12), Vec2::new(0.21, 0.11)], JACKET);
    for side in 0..2 {
        arm(side, pose, shoulders, look, &mut mesh);
    }
    head(look, shoulders + NECK_M * up + Vec3::X * 0.02, &mut mesh);
    for vertex in &mut mesh.vertices {
        vertex.position_m *= look.scale;
    }
    mesh
}

/// 1 for the left side, -1 for the right one.
fn sign(side: usize) -> f32 {
    if side == 0 { 1.0 } else { -1.0 }
}

/// Straight down, swung forward by an angle and out to a side by another.
fn swung(forward_rad: f32, out_rad: f32, side: usize) -> Vec3 {
    let aside = sign(side) * libm::sinf(out_rad);
    Vec3::new(libm::sinf(forward_rad), aside, -libm::cosf(forward_rad)).normalize()
}

/// Joints of a leg, from the middle of the hips.
struct Leg {
    hip: Vec3,
    knee: Vec3,
    ankle: Vec3,
    /// Along the sole.
    sole: Vec3,
    /// Down through the sole.
    down: Vec3,
}

impl Leg {
    fn new(side: usize, pose: &Pose) -> Leg {
        let hip = Vec3::Y * sign(side) * HIP_M;
        let thigh = swung(pose.thigh_rad[side], pose.spread_rad, side);
        let shank_rad = pose.thigh_rad[side] - pose.knee_rad[side];
        let down = swung(shank_rad, pose.spread_rad, side);
        let knee = hip + THIGH_M * thigh;
        let ankle = knee + (SHANK_M - SHOE_M) * down;
        let sole = Vec3::Y.cross(down) * -1.0;
        Leg { hip, knee, ankle, sole: sole.normalize_or(Vec3::X), down }
    }

    fn lowest_m(&self) -> f32 {
        let heel = self.ankle + SHOE_M * self.down - HEEL_M * self.sole;
        let toes = self.ankle + SHOE_M * self.down + TOES_M * self.sole;
        heel.z.min(toes.z)
    }

    fn draw(&self, hips: Vec3, trousers: Paint, mesh: &mut Mesh) {
        let [hip, knee, ankle] = [self.hip, self.knee, self.ankle].map(|joint| hips + joint);
        let (thick, thin) = (Vec2::new(0.085, 0.095), Vec2::new(0.06, 0.065));
        mesh.sleeve([hip, knee], Vec3::Y, [thick, thin], trousers);
        mesh.sleeve(
            [knee, ankle + 0.02 * self.down],
            Vec3::Y,
            [thin, Vec2::new(0.05, 0.055)],
            trousers,
        );
        let middle = ankle + 0.5 * SHOE_M * self.down;
        let shoe = [middle - HEEL_M * self.sole, middle + TOES_M * self.sole];
        mesh.limb(
            shoe,
            Vec3::Y,
            [Vec2::new(0.045, 0.5 * SHOE_M), Vec2::new(0.045, 0.5 * SHOE_M)],
            SHOES,
        );
    }
}

fn arm(side: usize, pose: &Pose, shoulders: Vec3, look: &Look, mesh: &mut Mesh) {
    let skin = paint(Material::Skin, look.skin);
    let shoulder = shoulders + Vec3::Y * sign(side) * SHOULDER_M;
    let upper = swung(pose.upper_arm_rad[side], pose.spread_rad, side);
    let lower = swung(pose.upper_arm_rad[side] + pose.elbow_rad[side], pose.spread_rad, side);
    let elbow = shoulder + UPPER_ARM_M * upper;
    let wrist = elbow + 0.68 * FOREARM_M * lower;
    let tips = elbow + FOREARM_M * lower;
    let widths = [Vec2::splat(0.062), Vec2::splat(0.048), Vec2::splat(0.038)];
    mesh.limb([shoulder + Vec3::Z * 0.04, elbow], Vec3::Y, [widths[0], widths[1]], JACKET);
    mesh.sleeve([elbow, wrist], Vec3::Y, [widths[1], widths[2]], JACKET);
    mesh.limb([wrist, tips], Vec3::Y, [widths[2], Vec2::new(0.03, 0.04)], skin);
}

fn head(look: &Look, middle: Vec3, mesh: &mut Mesh) {
    let skin = paint(Material::Skin, look.skin);
    let hair = match look.has_helmet {
        true => paint(Material::Coachwork, look.hair),
        false => paint(Material::Skin, look.hair),
    };
    let neck = [middle - Vec3::Z * 0.17, middle - Vec3::Z * 0.05];
    mesh.sleeve(neck, Vec3::Y, [Vec2::splat(0.055); 2], skin);
    let size = if look.has_helmet { 1.2 } else { 1.0 };
    let radii = Vec3::new(0.115, 0.095, 0.14) * look.head * size;
    mesh.blob(
        middle,
        radii,
        |_| 1.0,
        |outwards| {
            let is_face = outwards.x > 0.25 && outwards.z < 0.45;
            if is_face || outwards.z < -0.6 { skin } else { hair }
        },
    );
}
