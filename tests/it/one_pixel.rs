//! A point of the world lands on one pixel, whoever puts it there: the renderer, the projection of a
//! lidar return, and ingest of the recorded log.
#![allow(clippy::unwrap_used)]

use glam::DVec3;
use pmp::{
    noise::{Noise, Purpose},
    projection::Nearest,
    scene::{
        conditions::{Illumination, Sky, Weather},
        instant::Instant,
        shapes::Shapes,
    },
    sensors::{camera::Camera, lidar, rays::Reach},
};

use crate::{
    recording::{exact_rig, shared},
    replay::{ingested, known, step_of},
};

const SKY: Sky = Sky { illumination: Illumination::Daytime, weather: Weather::Clear };

/// Depths that agree: ground at a grazing angle is a pixel's height apart from its neighbour.
fn agrees(a_m: f64, b_m: f64) -> bool {
    (a_m - b_m).abs() < 0.1 + 0.04 * b_m
}

/// Of returns on the picture, the share whose depth is that of what the renderer shows there. The lidar
/// looks from above and sees over what hides things from the camera, and others move a little within a
/// tick, so it is not all.
fn share_that_agrees(returns: impl Iterator<Item = (u32, f64)>, depths_m: &[f64]) -> (usize, f64) {
    let verdicts: Vec<bool> =
        returns.map(|(pixel, depth_m)| agrees(depth_m, depths_m[pixel as usize])).collect();
    let agreeing = verdicts.iter().filter(|agrees| **agrees).count();
    (verdicts.len(), agreeing as f64 / verdicts.len().max(1) as f64)
}

#[test]
fn a_point_lands_on_one_pixel_by_renderer_projection_and_ingest() {
    let (stage, rig, shapes) = (&shared().stage, exact_rig(), Shapes::new());
    let mut camera = Camera::new(rig.camera.clone());
    // The car stands at first, so that pictures and clouds of a tick are of one place.
    let frames = ingested().iter().filter(|frame| frame.velocity_mps[0] < 0.05);
    let mut looked = 0;
    for frame in frames.step_by(2).take(3) {
        let known = &known()[step_of(frame.stamp_ns)];
        let instant = Instant::of(&known.snapshot, &shapes);
        let pose = known.car.world_from_ego(known.snapshot.ego_ground_m);
        camera.picture(&stage.surroundings, &instant, &pose, SKY, 0);
        let depths_m: Vec<f64> = camera.depths_m().map(f64::from).collect();

        let mut noise = Noise::new(0, 0, Purpose::Lidar);
        let reach = Reach::new(&stage.standing, &instant, pose.translation.as_vec3(), 50.0);
        let returns = lidar::turn(&rig.lidar, &reach, &pose, SKY, &mut noise);
        let camera_from_lidar = rig.camera.ego_from_camera.inverse() * rig.lidar.ego_from_lidar;
        let mut nearest = Nearest::new(&rig.camera.intrinsics);
        for point in returns {
            let place_m = DVec3::from(point.position_m.map(f64::from));
            let point_m = camera_from_lidar.transform_point3(place_m);
            nearest.add(point_m, point_m.z);
        }
        let (count, share) = share_that_agrees(nearest.finish(), &depths_m);
        assert!(
            count > 1000 && share > 0.9,
            "projection: {share} of {count} in frame {}",
            frame.index
        );

        let lidar = frame.lidar.as_ref().unwrap();
        let stored = lidar.pixel.iter().copied().zip(lidar.z.iter().map(|z| z.to_f64()));
        let (count, share) = share_that_agrees(stored, &depths_m);
        assert!(count > 1000 && share > 0.9, "ingest: {share} of {count} in frame {}", frame.index);

        // What lies a few pixels beside does not agree as well: the test can tell.
        let beside = |pixel: u32| (pixel as usize + 600 * 6) as u32;
        let stored = lidar.pixel.iter().zip(&lidar.z);
        let shifted = stored
            .filter(|(pixel, _)| beside(**pixel) < 600 * 250)
            .map(|(pixel, z)| (beside(*pixel), z.to_f64()));
        let (_, beside) = share_that_agrees(shifted, &depths_m);
        assert!(beside < share - 0.2, "{beside} beside, {share} in place");
        looked += 1;
    }
    assert!(looked > 0, "no frame of a car at rest");
}
