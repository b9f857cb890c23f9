//! What stands beside the road: delineator posts, trees, and the signs of stop lines.

use glam::{DAffine3, DQuat, DVec2, DVec3};

use crate::{
    noise::Noise,
    sim::{
        road::{LANE_WIDTH_M, Road, SHOULDER_M},
        scene::{Decal, Paint, Rgb, Scene, Shape, Solid},
    },
};

const POST_EVERY_M: f64 = 25.0;

/// Nothing grows nearer to the edge of the road than this, m.
const CLEAR_M: f64 = 3.0;

/// All that never moves, world frame.
pub fn build(noise: &mut Noise, road: &Road) -> Scene {
    let mut scene = Scene::default();
    let edge_m = LANE_WIDTH_M + SHOULDER_M;
    for i in 0..(road.length_m() / POST_EVERY_M) as usize {
        for side in [-1.0, 1.0] {
            add_post(&mut scene, &beside(road, i as f64 * POST_EVERY_M, side * (edge_m + 0.8)));
        }
    }
    for line_m in road.stop_lines_m() {
        add_sign(&mut scene, &beside(road, line_m + 0.5, -(edge_m + 0.6)));
    }
    let mut s = 0.0;
    while s < road.length_m() {
        let lateral = noise.pick(&[-1.0, 1.0]) * noise.uniform(edge_m + CLEAR_M, edge_m + 32.0);
        let (height_m, green) = (noise.uniform(4.0, 9.0), noise.uniform(0.75, 1.15));
        let foot = road.place(s, lateral);
        // The inside of a curve may reach another part of the road.
        if road.project(foot).1.abs() > edge_m + CLEAR_M {
            let turned = DQuat::from_rotation_z(noise.uniform(0.0, 1.5));
            let frame = DAffine3::from_rotation_translation(turned, foot.extend(0.0));
            add_tree(&mut scene, &frame, height_m, green);
        }
        s += noise.uniform(2.0, 12.0);
    }
    scene
}

/// A frame on the ground beside the road, x along it.
pub fn beside(road: &Road, s_m: f64, lateral_m: f64) -> DAffine3 {
    let turned = DQuat::from_rotation_z(road.at(s_m).heading_rad);
    DAffine3::from_rotation_translation(turned, road.place(s_m, lateral_m).extend(0.0))
}

fn add_post(scene: &mut Scene, frame: &DAffine3) {
    let mut add = |from_m: f64, height_m: f64, colour: Rgb, reflectivity: f64| {
        let shape = Shape::block(DVec3::new(0.0, 0.0, from_m), [0.06, 0.06], height_m);
        scene.solids.push(Solid::new(frame, shape, paint(colour), reflectivity));
    };
    add(0.0, 0.72, [232, 232, 230], 0.7);
    add(0.72, 0.14, [30, 30, 32], 0.9);
    add(0.86, 0.12, [232, 232, 230], 0.7);
}

/// A red board on a pole, facing those who come along the road.
fn add_sign(scene: &mut Scene, frame: &DAffine3) {
    let pole = Shape::block(DVec3::ZERO, [0.04, 0.04], 1.9);
    let board = Shape::block(DVec3::new(0.0, 0.0, 1.9), [0.03, 0.42], 0.84);
    scene.solids.push(Solid::new(frame, pole, paint([150, 152, 154]), 0.5));
    scene.solids.push(Solid::new(frame, board, paint([196, 24, 28]), 0.95));
    let corner = |y: f64, z: f64| frame.transform_point3(DVec3::new(-0.035, y, z));
    let corners_m = [corner(0.3, 2.22), corner(-0.3, 2.22), corner(-0.3, 2.42), corner(0.3, 2.42)];
    scene.decals.push(Decal { corners_m, colour: [245, 245, 245], glows: false });
}

fn add_tree(scene: &mut Scene, frame: &DAffine3, height_m: f64, green: f64) {
    let shade = |rgb: [f64; 3]| rgb.map(|c| (c * green) as u8);
    let trunk = Shape::block(DVec3::ZERO, [0.16, 0.16], 0.3 * height_m);
    scene.solids.push(Solid::new(frame, trunk, paint([86, 66, 48]), 0.3));
    let crowns = [(0.2, 0.45, 0.24, 0.17), (0.5, 0.3, 0.19, 0.12), (0.72, 0.28, 0.14, 0.01)];
    for (from, height, lower, upper) in crowns {
        let turn = DQuat::from_rotation_z(from * 1.7);
        let frame = *frame * DAffine3::from_quat(turn);
        let shape = Shape {
            foot_m: DVec3::new(0.0, 0.0, from * height_m),
            height_m: height * height_m,
            lower_m: [lower * height_m; 2],
            upper_m: [upper * height_m; 2],
            lean_m: 0.0,
        };
        let sides = shade([52.0, 92.0, 44.0]);
        scene.solids.push(Solid::new(
            &frame,
            shape,
            Paint { top: shade([74.0, 122.0, 56.0]), sides },
            0.35,
        ));
    }
    let corner = |x: f64, y: f64| {
        frame.transform_point3(DVec3::ZERO) + (0.26 * height_m * DVec2::new(x, y)).extend(0.0)
    };
    scene.shadows_m.push([
        corner(1.2, 0.7),
        corner(0.1, 1.5),
        corner(-0.9, 0.6),
        corner(0.1, -0.5),
    ]);
}

fn paint(colour: Rgb) -> Paint {
    Paint { top: colour, sides: colour }
}
