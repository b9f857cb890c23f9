//! Lidar and radar onto the picture: the nearest return of each pixel (paper §III.C2).

use glam::{DAffine3, DVec3};
use half::f16;

use crate::{
    dataset::radar,
    error::Result,
    frame::{LidarPixels, RadarPixels},
    log::{
        cloud::Cloud,
        conventions::RadarRule,
        signals::{Kind, Pose, RadarReturn},
        value::Struct,
    },
    projection::{Camera, NEAR_M, Nearest},
};

/// Lidar returns of a cloud on the picture.
///
/// `camera` is that of the stored picture; `camera_from_sensor` leads into its optical frame.
///
/// # Errors
///
/// [`Error::Decode`](crate::error::Error::Decode) if the message is no readable cloud.
pub fn lidar_pixels(
    message: &Struct,
    camera_from_sensor: &Pose,
    camera: &Camera,
) -> Result<LidarPixels> {
    let cloud = Cloud::new(message)?;
    let xyz = cloud.xyz()?;
    let camera_from_points = match &cloud.frame_from_points {
        Some(pose) => camera_from_sensor.then(pose),
        None => *camera_from_sensor,
    };
    // A matrix, since there are tens of thousands of points.
    let camera_from_points = DAffine3::from_rotation_translation(
        camera_from_points.rotation,
        camera_from_points.position_m,
    );
    Ok(lidar_on_picture(cloud.positions(xyz), &camera_from_points, camera))
}

/// Places in any frame on the picture, the nearest of each pixel.
///
/// `camera_from_points` leads from their frame into the camera's optical frame.
pub fn lidar_on_picture(
    points_m: impl Iterator<Item = DVec3>,
    camera_from_points: &DAffine3,
    camera: &Camera,
) -> LidarPixels {
    let (depth, ahead_m) = (camera_from_points.matrix3.row(2), camera_from_points.translation.z);
    let mut nearest = Nearest::new(camera);
    for point_m in points_m {
        // Half of a turn lies behind the camera, and one coordinate tells.
        let depth_m = depth.x * point_m.x + depth.y * point_m.y + depth.z * point_m.z + ahead_m;
        if depth_m.is_nan() || depth_m <= NEAR_M {
            continue;
        }
        let camera_m = camera_from_points.transform_point3(point_m);
        nearest.add(camera_m, camera_m);
    }
    let mut pixels = LidarPixels::default();
    for (pixel, point_m) in nearest.finish() {
        pixels.pixel.push(pixel);
        pixels.x.push(f16::from_f64(point_m.x));
        pixels.y.push(f16::from_f64(point_m.y));
        pixels.z.push(f16::from_f64(point_m.z));
    }
    pixels
}

/// Radar returns of a scan, a list of tracks or a cloud on the picture. Returns without a finite
/// speed, of a radar that measures speeds, are none.
///
/// # Errors
///
/// As [`lidar_pixels`]; also if a cloud has neither x, y, z nor range, azimuth and elevation.
pub fn radar_pixels(
    kind: Kind,
    message: &Struct,
    rule: &RadarRule,
    camera_from_sensor: &Pose,
    camera: &Camera,
) -> Result<RadarPixels> {
    let returns = radar::returns(kind, message, rule)?;
    Ok(radar_on_picture(&returns, camera_from_sensor, camera))
}

/// Radar returns on the picture, the nearest of each pixel.
pub fn radar_on_picture(
    returns: &[RadarReturn],
    camera_from_sensor: &Pose,
    camera: &Camera,
) -> RadarPixels {
    let has_speeds = returns.iter().any(|r| r.radial_speed_mps.is_some());
    let mut nearest = Nearest::new(camera);
    for r in returns {
        let speed_mps = r.radial_speed_mps.unwrap_or(0.0);
        if speed_mps.is_finite() {
            nearest.add(camera_from_sensor.transform_point(r.position_m), speed_mps);
        }
    }
    let (mut pixel, mut speed) = (Vec::new(), Vec::new());
    for (at, speed_mps) in nearest.finish() {
        pixel.push(at);
        speed.push(f16::from_f64(speed_mps));
    }
    // An empty scan is one of a radar with speeds: nothing says that it has none.
    let speed_mps = (has_speeds || pixel.is_empty()).then_some(speed);
    RadarPixels { pixel, speed_mps }
}
