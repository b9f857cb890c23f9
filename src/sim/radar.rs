//! The radar: rays at random through a field of 35 x 20 degrees, ranges and radial speeds.
//!
//! A return's speed is the rate at which its distance to the sensor changes, so it is relative
//! to the ego vehicle and negative when approaching: what stands still ahead of a car driving at
//! v comes back with -v cos(angle).

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};

use crate::{
    noise::Noise,
    sim::{lidar::direction, scene::Scene},
    world::ego::Car,
};

/// Field of view, rad.
pub const WIDTH_RAD: f64 = 35.0 / 360.0 * TAU;
pub const HEIGHT_RAD: f64 = 20.0 / 360.0 * TAU;

/// Furthest return, m.
pub const RANGE_M: f64 = 100.0;

/// Rays in a scan.
const RAYS: usize = 300;

/// Flat ground throws most of the wave forward: share of rays that come back from it.
const GROUND_RETURNS: f64 = 0.04;
const SOLID_RETURNS: f64 = 0.85;

/// Standard deviations of what is measured.
const RANGE_STD_M: f64 = 0.1;
const ANGLE_STD_RAD: f64 = 0.004;
const SPEED_STD_MPS: f64 = 0.08;

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarReturn {
    pub range_m: f64,
    /// Rad, positive = left.
    pub azimuth_rad: f64,
    /// Rad, positive = up.
    pub elevation_rad: f64,
    /// Relative to the ego vehicle, m/s, negative = approaching.
    pub speed_mps: f64,
    pub amplitude_db: f64,
}

/// Where the radar sits: level, in the front bumper.
pub fn ego_from_radar() -> DAffine3 {
    DAffine3::from_translation(DVec3::new(2.4, 0.0, 0.6))
}

/// One scan.
pub fn scan(scene: &Scene, ego: &Car, noise: &mut Noise) -> Vec<RadarReturn> {
    let world_from_radar = ego.world_from_ego() * ego_from_radar();
    let origin_m = world_from_radar.translation;
    let sensor_mps = velocity_mps(ego);
    let ahead = world_from_radar.transform_vector3(DVec3::X);
    let solids: Vec<_> = (scene.solids.iter())
        .filter(|solid| {
            let offset = solid.centre_m() - origin_m;
            let beside = offset.cross(ahead).length();
            // Within the field, with room for the solid's own size.
            offset.length() < RANGE_M + 5.0 && beside < 0.4 * offset.dot(ahead) + 6.0
        })
        .collect();
    let mut returns = Vec::new();
    for _ in 0..RAYS {
        let azimuth = noise.uniform(-0.5, 0.5) * WIDTH_RAD;
        let elevation = noise.uniform(-0.5, 0.5) * HEIGHT_RAD;
        let ray = world_from_radar.transform_vector3(direction(azimuth, elevation));
        let ground = (-origin_m.z / ray.z, DVec3::ZERO, GROUND_RETURNS, -8.0);
        let hits = solids.iter().filter_map(|solid| {
            let (range_m, normal) = solid.hit(origin_m, ray)?;
            let gain_db =
                10.0 * normal.dot(ray).abs().max(0.05).log10() + 10.0 * solid.reflectivity;
            Some((range_m, solid.velocity_mps, SOLID_RETURNS, gain_db))
        });
        let first = std::iter::once(ground)
            .chain(hits)
            .filter(|hit| hit.0 > 0.0 && hit.0 < RANGE_M)
            .reduce(|best, hit| if hit.0 < best.0 { hit } else { best });
        let Some((range_m, velocity_mps, share, gain_db)) = first else { continue };
        if !noise.chance(share) {
            continue;
        }
        let speed_mps = (velocity_mps - sensor_mps).dot(ray);
        returns.push(RadarReturn {
            range_m: (range_m + noise.normal(RANGE_STD_M)).max(0.1),
            azimuth_rad: azimuth + noise.normal(ANGLE_STD_RAD),
            elevation_rad: elevation + noise.normal(ANGLE_STD_RAD),
            speed_mps: speed_mps + noise.normal(SPEED_STD_MPS),
            // The radar equation: power falls with the fourth power of range.
            amplitude_db: 60.0 + gain_db - 40.0 * range_m.max(1.0).log10(),
        });
    }
    returns
}

/// Velocity of the radar in the world frame, with what the car's turning adds, m/s.
fn velocity_mps(ego: &Car) -> DVec3 {
    let turning = DVec3::new(0.0, 0.0, ego.yaw_rate_radps()).cross(ego_from_radar().translation);
    ego.orientation() * (ego.velocity_ego_mps().extend(0.0) + turning)
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::{noise::Purpose, sim::car::Car, world::ego};

    fn ego() -> ego::Car {
        ego::Car { position_m: DVec2::new(5.0, 3.0), speed_mps: 10.0, ..Default::default() }
    }

    fn returns_of_car(speed_mps: f64) -> Vec<RadarReturn> {
        let mut scene = Scene::default();
        let world_from_car = DAffine3::from_translation(DVec3::new(35.0, 3.0, 0.0));
        let velocity_mps = speed_mps * DVec3::X;
        Car { world_from_car, velocity_mps, paint: [9; 3], braking: false }.add_to(&mut scene);
        let mut noise = Noise::new(1, 0, Purpose::Radar);
        let scans = (0..20).flat_map(|_| scan(&scene, &ego(), &mut noise));
        // Higher than the ground that the lowest rays reach at this range.
        scans.filter(|r| r.elevation_rad.abs() < 0.01 && r.range_m < 40.0).collect()
    }

    #[test]
    fn a_standing_car_ahead_approaches_at_the_speed_of_the_ego_vehicle() {
        let returns = returns_of_car(0.0);
        assert!(returns.len() > 5, "{returns:?}");
        for r in returns {
            assert!((r.speed_mps + 10.0).abs() < 0.6, "{r:?}");
            assert!((r.range_m - (30.0 - 2.4 - 2.4)).abs() < 0.8, "{r:?}");
        }
    }

    #[test]
    fn a_faster_car_ahead_goes_away() {
        assert!(returns_of_car(14.0).iter().all(|r| (r.speed_mps - 4.0).abs() < 0.6));
    }

    #[test]
    fn static_things_beside_approach_by_the_cosine_of_their_angle() {
        let mut noise = Noise::new(2, 0, Purpose::Radar);
        let clutter: Vec<_> =
            (0..50).flat_map(|_| scan(&Scene::default(), &ego(), &mut noise)).collect();
        assert!(clutter.len() > 20);
        for r in clutter {
            let cosine = r.azimuth_rad.cos() * r.elevation_rad.cos();
            assert!((r.speed_mps + 10.0 * cosine).abs() < 0.5, "{r:?}");
        }
    }
}
