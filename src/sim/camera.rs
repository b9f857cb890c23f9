//! The camera: a scene onto a picture of 600 x 250, by our own rasterizer.
//!
//! Sky, ground, shadows, then solids by depth. Floating point only, one thread, no state from
//! picture to picture: the same scene gives the same bytes.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec2, DVec3};

use crate::{
    frame::{IMAGE_HEIGHT, IMAGE_WIDTH},
    projection::Camera,
    sim::{
        ground::{Eye, Ground, mix},
        raster::{Canvas, Cover},
        road::Road,
        scene::{FACES, Rgb, Scene, Solid},
    },
};

/// Horizontal field of view, rad.
const FOV_RAD: f64 = 100.0 / 360.0 * TAU;

/// Towards the sun, and what reaches a face turned away from it.
const SUN: DVec3 = DVec3::new(-0.42, -0.56, 0.71);
const AMBIENT: f64 = 0.56;

/// Colours fade into the horizon's over this distance, m.
const HAZE_M: f64 = 420.0;
const HAZE: [f32; 3] = [200.0, 212.0, 222.0];
const ZENITH: [f32; 3] = [96.0, 142.0, 204.0];
const HILLS: [f32; 3] = [118.0, 142.0, 140.0];

/// Light that is left in a shadow.
const SHADOW: f32 = 0.55;

/// The simulated camera: 600 x 250, 100 degrees wide, no distortion.
pub fn intrinsics() -> Camera {
    Camera::from_fov(IMAGE_WIDTH, IMAGE_HEIGHT, FOV_RAD)
}

/// Where the camera sits, level and looking ahead. Optical frame: x right, y down, z forward.
pub fn ego_from_camera() -> DAffine3 {
    let rotation = DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5);
    DAffine3::from_rotation_translation(rotation, DVec3::new(2.0, 0.0, 1.4))
}

/// The picture from a vehicle on the road; `s_m` is the vehicle's arc length, about.
///
/// RGB, row by row, 3 bytes a pixel.
pub fn picture(scene: &Scene, road: &Road, world_from_ego: &DAffine3, s_m: f64) -> Vec<u8> {
    let camera = intrinsics();
    let world_from_camera = *world_from_ego * ego_from_camera();
    let mut canvas = Canvas::new(camera.width, camera.height);
    paint_background(&mut canvas, &camera, &world_from_camera, road, s_m);

    let camera_from_world = world_from_camera.inverse();
    let seen = |corners: &[DVec3; 4]| corners.map(|p| camera_from_world.transform_point3(p));
    for outline in &scene.shadows_m {
        canvas.polygon(&camera, &seen(outline), Cover::Shadow(SHADOW));
    }
    let eye_m = world_from_camera.translation;
    for solid in &scene.solids {
        paint_solid(&mut canvas, &camera, &camera_from_world, eye_m, solid);
    }
    for decal in &scene.decals {
        let corners_m = seen(&decal.corners_m);
        let light = if decal.glows { 1.0 } else { 0.8 };
        let colour = hazy(decal.colour, light, corners_m[0].z);
        canvas.polygon(&camera, &corners_m, Cover::Solid(colour));
    }
    canvas.rgb
}

fn paint_background(
    canvas: &mut Canvas,
    camera: &Camera,
    world_from_camera: &DAffine3,
    road: &Road,
    s_m: f64,
) {
    let forward = world_from_camera.transform_vector3(DVec3::Z).truncate().normalize();
    let eye = Eye {
        position_m: world_from_camera.translation.truncate(),
        height_m: world_from_camera.translation.z,
        forward,
    };
    let ground = Ground::new(road, eye, s_m);
    let hills: Vec<f64> =
        (0..camera.width).map(|column| hill_rad(camera, forward, column)).collect();
    let mut row = vec![[0.0; 3]; camera.width];
    for v in 0..camera.height {
        let below = (v as f64 + 0.5 - camera.cy) / camera.fy;
        if below > 0.0 {
            let per_column = -1.0 / camera.fx;
            ground.paint_row(&mut row, below, (camera.cx - 0.5) / camera.fx, per_column);
            let haze = 1.0 - (-eye.height_m / below / HAZE_M).exp();
            row.iter_mut().for_each(|pixel| mix(pixel, HAZE, haze as f32));
        } else {
            let up = (-below / 0.5).min(1.0) as f32;
            let mut sky = HAZE;
            mix(&mut sky, ZENITH, up.sqrt());
            for (pixel, hill) in row.iter_mut().zip(&hills) {
                *pixel = if -below < *hill { HILLS } else { sky };
            }
        }
        let bytes = &mut canvas.rgb[3 * v * camera.width..3 * (v + 1) * camera.width];
        for (byte, value) in bytes.iter_mut().zip(row.as_flattened()) {
            *byte = *value as u8;
        }
    }
}

/// Elevation of the far hills in a column of the picture, rad, about: they stand infinitely far.
fn hill_rad(camera: &Camera, forward: DVec2, column: usize) -> f64 {
    let left = (camera.cx - column as f64 - 0.5) / camera.fx;
    let bearing = forward.to_angle() + left.atan();
    let ridge = [(3.0, 0.4, 0.020), (7.0, 2.1, 0.012), (17.0, 5.2, 0.006), (41.0, 1.3, 0.002)];
    let height: f64 = ridge.iter().map(|(n, phase, a)| a * (n * bearing + phase).sin()).sum();
    (0.026 + height).max(0.004)
}

fn paint_solid(
    canvas: &mut Canvas,
    camera: &Camera,
    camera_from_world: &DAffine3,
    eye_m: DVec3,
    solid: &Solid,
) {
    let corners_m = solid.corners_m.map(|p| camera_from_world.transform_point3(p));
    if corners_m.iter().all(|p| p.z < 0.0) {
        return;
    }
    let depth_m = corners_m.iter().map(|p| p.z).sum::<f64>() / 8.0;
    for (face, indices) in FACES.iter().enumerate() {
        let normal = solid.normal(face);
        if normal.dot(solid.corners_m[indices[0]] - eye_m) >= 0.0 {
            continue;
        }
        let paint = if face == 0 { solid.paint.top } else { solid.paint.sides };
        let light = AMBIENT + (1.0 - AMBIENT) * normal.dot(SUN).max(0.0) * 1.3;
        let colour = hazy(paint, light, depth_m);
        canvas.polygon(camera, &indices.map(|i| corners_m[i]), Cover::Solid(colour));
    }
}

fn hazy(paint: Rgb, light: f64, depth_m: f64) -> Rgb {
    let mut colour = paint.map(|c| (f32::from(c) * light as f32).min(255.0));
    mix(&mut colour, HAZE, (1.0 - (-depth_m.max(0.0) / HAZE_M).exp()) as f32);
    colour.map(|c| c as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{car::Car, road::Piece};

    fn straight() -> Road {
        Road::from_pieces(&[Piece { length_m: 600.0, start_per_m: 0.0, end_per_m: 0.0 }])
    }

    fn ego(s_m: f64, lateral_m: f64) -> DAffine3 {
        DAffine3::from_translation(DVec3::new(s_m, lateral_m, 0.0))
    }

    #[test]
    fn a_known_point_of_a_car_is_where_the_projection_says() {
        let (road, world_from_ego) = (straight(), ego(100.0, -1.75));
        let mut scene = Scene::default();
        let paint = [176, 30, 34];
        let world_from_car = ego(114.0, -1.75);
        Car { world_from_car, velocity_mps: DVec3::ZERO, paint, braking: true }.add_to(&mut scene);
        let rgb = picture(&scene, &road, &world_from_ego, 100.0);
        let seen = |car: DVec3| {
            let world = world_from_car.transform_point3(car);
            let optical = (world_from_ego * ego_from_camera()).inverse().transform_point3(world);
            let pixel = 3 * intrinsics().pixel(optical.to_array()).unwrap() as usize;
            [rgb[pixel], rgb[pixel + 1], rgb[pixel + 2]]
        };
        let lamp = seen(DVec3::new(-2.44, 0.66, 0.67));
        assert!(lamp[0] > 220 && lamp[1] < 70, "brake lamp: {lamp:?}");
        let body = seen(DVec3::new(-2.44, 0.37, 0.7));
        assert!((80..190).contains(&body[0]) && body[1] < 60, "red body: {body:?}");
        let beside = seen(DVec3::new(-2.44, 1.6, 0.7));
        assert!(beside[1] > 60, "no car beside the car: {beside:?}");
    }

    #[test]
    fn markings_are_where_the_projection_says() {
        let (road, world_from_ego) = (straight(), ego(100.0, -1.75));
        let rgb = picture(&Scene::default(), &road, &world_from_ego, 100.0);
        let brightness = |s: f64, lateral: f64| {
            let world = DVec3::new(s, lateral, 0.0);
            let optical = (world_from_ego * ego_from_camera()).inverse().transform_point3(world);
            let pixel = intrinsics().pixel(optical.to_array()).unwrap() as usize;
            rgb[3 * pixel]
        };
        assert!(brightness(112.0, -3.5) > 180 && brightness(112.0, 3.5) > 180, "edge lines");
        assert!(brightness(109.5, 0.0) > 170, "a dash starts at 108 m");
        assert!(brightness(113.5, 0.0) < 130, "and ends at 111 m");
        assert!(brightness(107.0, -2.0) < 130, "asphalt");
    }

    #[test]
    fn the_same_scene_gives_the_same_bytes() {
        let road = straight();
        let draw = || picture(&Scene::default(), &road, &ego(30.0, 1.0), 30.0);
        assert_eq!(draw(), draw());
    }
}
