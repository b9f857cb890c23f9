//! Motorcycles and bicycles, with those who ride them.
//!
//! Body frame: x forward, y left, z up; the origin lies on the ground below the middle.

use glam::{Vec2, Vec3};

use crate::scene::{
    mesh::{Material, Mesh},
    people::{Look, Pose, person},
    solids::{Paint, circle, paint},
};

const FRAME: Paint = paint(Material::Metal, [70, 72, 78]);
const STEEL: Paint = paint(Material::Metal, [150, 152, 156]);
const TYRE: Paint = paint(Material::Rubber, [34, 34, 36]);
const SADDLE: Paint = paint(Material::Rubber, [44, 42, 42]);
const TANK: Paint = paint(Material::Coachwork, [160, 40, 36]);
const HEAD: Paint = paint(Material::HeadLamp, [236, 240, 244]);
const TAIL: Paint = paint(Material::TailLamp, [150, 22, 24]);
const BRAKE: Paint = paint(Material::BrakeLamp, [172, 30, 28]);

/// A wheel in the middle plane: a ring of eight pieces.
fn ring_wheel(x_m: f32, radius_m: f32, half_width_m: f32, depth_m: f32, mesh: &mut Mesh) {
    const SIDES: usize = 12;
    let ring = |y: f32, radius: f32| circle(Vec3::new(x_m, y, radius_m), Vec3::Y, radius, SIDES);
    let right = ring(-half_width_m, radius_m - 0.3 * depth_m);
    let outer = ring(0.0, radius_m);
    let left = ring(half_width_m, radius_m - 0.3 * depth_m);
    let inner = ring(0.0, radius_m - depth_m);
    // Around the section of the tyre.
    mesh.loft(&[right.clone(), outer, left.clone()], |_, _| TYRE);
    mesh.loft(&[left, inner, right], |_, _| TYRE);
}

/// A thin disc in the middle plane: the brakes and spokes of a motorcycle's wheel.
fn disc(x_m: f32, height_m: f32, radius_m: f32, mesh: &mut Mesh) {
    let ring = |y: f32| circle(Vec3::new(x_m, y, height_m), Vec3::Y, radius_m, 8);
    mesh.closed_loft(&[ring(-0.02), ring(0.02)], STEEL);
}

/// A lamp that looks forward or back: a box with a glowing face.
fn lamp(middle: Vec3, half: Vec2, forward: f32, glow: Paint, mesh: &mut Mesh) {
    let front = middle + Vec3::X * forward * 0.03;
    mesh.limb([middle - Vec3::X * forward * 0.05, front], Vec3::Y, [half; 2], FRAME);
    let x = front.x + forward * 0.005;
    let at = |y: f32, z: f32| Vec3::new(x, middle.y + y * half.x * -forward, middle.z + z * half.y);
    mesh.face(&[at(1.0, -1.0), at(-1.0, -1.0), at(-1.0, 1.0), at(1.0, 1.0)].map(|c| c), glow);
}

/// A motorcycle of 2.16 x 0.8 x 1.55 m with its rider.
pub fn motorcycle(look: &Look) -> Mesh {
    let mut mesh = Mesh::default();
    for x_m in [-0.7, 0.7] {
        ring_wheel(x_m, 0.32, 0.065, 0.13, &mut mesh);
        disc(x_m, 0.32, 0.19, &mut mesh);
    }
    let bar = |mesh: &mut Mesh, ends: [Vec3; 2], half: [Vec2; 2], paint: Paint| {
        mesh.limb(ends, Vec3::Y, half, paint);
    };
    // Engine, tank, seat, tail.
    mesh.cuboid(Vec3::new(-0.35, -0.16, 0.22), Vec3::new(0.35, 0.16, 0.55), FRAME);
    let tank = [Vec3::new(0.38, 0.0, 0.78), Vec3::new(-0.12, 0.0, 0.74)];
    bar(&mut mesh, tank, [Vec2::new(0.12, 0.13), Vec2::new(0.14, 0.12)], TANK);
    let seat = [Vec3::new(-0.1, 0.0, 0.74), Vec3::new(-0.8, 0.0, 0.82)];
    bar(&mut mesh, seat, [Vec2::new(0.14, 0.07), Vec2::new(0.1, 0.05)], SADDLE);
    let tail = [Vec3::new(-0.7, 0.0, 0.72), Vec3::new(-1.05, 0.0, 0.76)];
    bar(&mut mesh, tail, [Vec2::new(0.1, 0.07), Vec2::new(0.06, 0.04)], TANK);
    let swing = [Vec3::new(-0.25, 0.12, 0.36), Vec3::new(-0.7, 0.12, 0.32)];
    bar(&mut mesh, swing, [Vec2::new(0.03, 0.05); 2], FRAME);
    let exhaust = [Vec3::new(-0.1, -0.17, 0.3), Vec3::new(-0.95, -0.2, 0.42)];
    bar(&mut mesh, exhaust, [Vec2::splat(0.05); 2], STEEL);
    // The fork, its bar with mirrors, and what covers the wheels.
    for side in [-1.0, 1.0] {
        let fork = [Vec3::new(0.7, side * 0.1, 0.32), Vec3::new(0.46, side * 0.1, 0.95)];
        bar(&mut mesh, fork, [Vec2::splat(0.03); 2], STEEL);
        let handle = [Vec3::new(0.45, 0.0, 0.98), Vec3::new(0.35, side * 0.4, 1.02)];
        mesh.limb(handle, Vec3::Z, [Vec2::splat(0.025); 2], FRAME);
        let mirror = [Vec3::new(0.4, side * 0.28, 1.2), Vec3::new(0.4, side * 0.38, 1.2)];
        mesh.limb(mirror, Vec3::Z, [Vec2::new(0.04, 0.02); 2], FRAME);
    }
    let front = [Vec3::new(0.5, 0.0, 0.68), Vec3::new(1.08, 0.0, 0.56)];
    bar(&mut mesh, front, [Vec2::new(0.08, 0.02); 2], TANK);
    let cowl = [Vec3::new(0.42, 0.0, 0.9), Vec3::new(0.66, 0.0, 0.92)];
    bar(&mut mesh, cowl, [Vec2::new(0.15, 0.16), Vec2::new(0.12, 0.12)], TANK);
    lamp(Vec3::new(0.66, 0.0, 0.92), Vec2::new(0.09, 0.08), 1.0, HEAD, &mut mesh);
    lamp(Vec3::new(-1.04, 0.05, 0.76), Vec2::new(0.05, 0.05), -1.0, TAIL, &mut mesh);
    lamp(Vec3::new(-1.04, -0.05, 0.76), Vec2::new(0.05, 0.05), -1.0, BRAKE, &mut mesh);
    let rider = Pose {
        thigh_rad: [1.25; 2],
        knee_rad: [1.6; 2],
        upper_arm_rad: [0.75; 2],
        elbow_rad: [0.55; 2],
        lean_rad: 0.28,
        spread_rad: 0.16,
        hip_m: Some(0.88),
        flight_m: 0.0,
    };
    let back_m = Vec3::X * -0.22;
    mesh.append(&person(look, &rider), |place| place + back_m);
    mesh
}

/// A bicycle of 1.76 x 0.64 x 1.7 m with its rider.
pub fn bicycle(look: &Look) -> Mesh {
    let mut mesh = Mesh::default();
    for x_m in [-0.53, 0.53] {
        ring_wheel(x_m, 0.345, 0.022, 0.05, &mut mesh);
    }
    let (rear, crank) = (Vec3::new(-0.53, 0.0, 0.345), Vec3::new(-0.08, 0.0, 0.28));
    let (saddle, neck) = (Vec3::new(-0.24, 0.0, 0.88), Vec3::new(0.36, 0.0, 0.82));
    let front = Vec3::new(0.53, 0.0, 0.345);
    let tubes = [[rear, crank], [rear, saddle], [crank, saddle], [crank, neck], [saddle, neck]];
    for ends in tubes {
        mesh.sleeve(ends, Vec3::Y, [Vec2::splat(0.02); 2], TANK);
    }
    mesh.sleeve([front, neck + Vec3::Z * 0.16], Vec3::Y, [Vec2::splat(0.02); 2], FRAME);
    for side in [-1.0, 1.0] {
        let stem = neck + Vec3::Z * 0.16;
        let grip = Vec3::new(0.26, side * 0.32, 1.0);
        mesh.sleeve([stem, grip], Vec3::Z, [Vec2::splat(0.02); 2], FRAME);
        let pedal = crank + Vec3::new(side * 0.15, side * 0.14, side * -0.08);
        mesh.cuboid(
            pedal - Vec3::new(0.05, 0.05, 0.012),
            pedal + Vec3::new(0.05, 0.05, 0.012),
            FRAME,
        );
    }
    let seat = [saddle + Vec3::new(0.12, 0.0, 0.03), saddle + Vec3::new(-0.14, 0.0, 0.04)];
    mesh.limb(seat, Vec3::Y, [Vec2::new(0.03, 0.025), Vec2::new(0.09, 0.03)], SADDLE);
    lamp(Vec3::new(0.45, 0.0, 0.9), Vec2::splat(0.035), 1.0, HEAD, &mut mesh);
    lamp(Vec3::new(-0.5, 0.0, 0.74), Vec2::splat(0.035), -1.0, TAIL, &mut mesh);
    // One foot is down, one is up.
    let rider = Pose {
        thigh_rad: [0.62, 1.1],
        knee_rad: [0.75, 1.35],
        upper_arm_rad: [0.95; 2],
        elbow_rad: [0.2; 2],
        lean_rad: 0.42,
        spread_rad: 0.05,
        hip_m: Some(0.97),
        flight_m: 0.0,
    };
    let back_m = Vec3::X * -0.24;
    mesh.append(&person(look, &rider), |place| place + back_m);
    mesh
}
