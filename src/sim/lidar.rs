//! The lidar: 32 beams turning on the roof, by exact rays against solids and flat ground.
//!
//! A turn is taken at one instant, as CARLA's is in synchronous mode: nothing is smeared by the
//! car's own motion. The car does not see itself.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec3};

use crate::{
    noise::Noise,
    sim::{
        road::{Road, Surface},
        scene::{Scene, Solid},
    },
};

/// Beams, and the elevation of the lowest and the highest, rad.
pub const BEAMS: usize = 32;
pub const LOWEST_RAD: f64 = -30.0 / 360.0 * TAU;
pub const HIGHEST_RAD: f64 = 10.0 / 360.0 * TAU;

/// Firings in a turn: 0.8 degrees apart.
pub const FIRINGS: usize = 450;

/// Furthest return, m.
pub const RANGE_M: f64 = 50.0;

/// Standard deviation of a range, m, and share of returns that are lost.
const RANGE_STD_M: f64 = 0.02;
const LOST: f64 = 0.05;

/// Light lost to the air, 1/m (CARLA's default).
const ATTENUATION_PER_M: f64 = 0.004;

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarReturn {
    /// Lidar frame (x forward, y left, z up), m.
    pub position_m: DVec3,
    /// In [0, 1].
    pub intensity: f64,
    /// 0 is the lowest beam.
    pub ring: u16,
}

/// Where the lidar sits: level, in the middle of the roof.
pub fn ego_from_lidar() -> DAffine3 {
    DAffine3::from_translation(DVec3::new(0.0, 0.0, 1.8))
}

/// A full turn, firing by firing, anticlockwise from the car's tail.
///
/// `s_m` is the vehicle's arc length, about.
pub fn turn(
    scene: &Scene,
    road: &Road,
    world_from_ego: &DAffine3,
    s_m: f64,
    noise: &mut Noise,
) -> Vec<LidarReturn> {
    let world_from_lidar = *world_from_ego * ego_from_lidar();
    let origin_m = world_from_lidar.translation;
    let candidates = by_firing(scene, &world_from_lidar);
    let mut returns = Vec::with_capacity(BEAMS * FIRINGS / 2);
    for (firing, solids) in candidates.iter().enumerate() {
        let azimuth = azimuth_rad(firing);
        for ring in 0..BEAMS {
            let beam = direction(azimuth, elevation_rad(ring));
            let ray = world_from_lidar.transform_vector3(beam);
            let Some((range_m, reflectivity)) = cast(solids, road, s_m, origin_m, ray) else {
                continue;
            };
            if noise.chance(LOST) {
                continue;
            }
            let measured_m = range_m + noise.normal(RANGE_STD_M);
            let intensity = reflectivity * (-ATTENUATION_PER_M * range_m).exp();
            returns.push(LidarReturn {
                position_m: measured_m * beam,
                intensity,
                ring: ring as u16,
            });
        }
    }
    returns
}

/// Range and the share of light that comes back, of what a ray meets first.
fn cast(
    solids: &[&Solid],
    road: &Road,
    s_m: f64,
    origin_m: DVec3,
    ray: DVec3,
) -> Option<(f64, f64)> {
    // Facing away costs light, but no surface is a mirror.
    let facing = |normal: DVec3| 0.3 + 0.7 * normal.dot(ray).abs();
    let mut nearest = (RANGE_M, None);
    for solid in solids {
        if let Some((range_m, normal)) = solid.hit(origin_m, ray)
            && range_m < nearest.0
        {
            nearest = (range_m, Some(solid.reflectivity * facing(normal)));
        }
    }
    let to_ground_m = -origin_m.z / ray.z;
    if to_ground_m > 0.0 && to_ground_m < nearest.0 {
        let place = (origin_m + to_ground_m * ray).truncate();
        let (s, lateral) = road.project_within(place, s_m - 80.0, s_m + 80.0);
        let reflectivity = match road.surface(s, lateral) {
            Surface::Grass => 0.45,
            Surface::Asphalt => 0.15,
            Surface::Marking => 0.8,
        };
        return Some((to_ground_m, reflectivity * facing(DVec3::Z)));
    }
    nearest.1.map(|reflectivity| (nearest.0, reflectivity))
}

/// The solids that each firing could meet.
fn by_firing<'a>(scene: &'a Scene, world_from_lidar: &DAffine3) -> Vec<Vec<&'a Solid>> {
    let lidar_from_world = world_from_lidar.inverse();
    let mut firings = vec![Vec::new(); FIRINGS];
    for solid in &scene.solids {
        let corners = solid.corners_m.map(|p| lidar_from_world.transform_point3(p).truncate());
        if corners.iter().all(|p| p.length() > RANGE_M + 5.0) {
            continue;
        }
        let centre = lidar_from_world.transform_point3(solid.centre_m()).truncate();
        let half_width = corners.iter().map(|p| centre.angle_to(*p).abs()).fold(0.0, f64::max);
        let first = ((centre.to_angle() - half_width + TAU / 2.0) / STEP_RAD).floor() as i64;
        let count = (2.0 * half_width / STEP_RAD).ceil() as i64 + 1;
        for firing in first..=first + count {
            firings[firing.rem_euclid(FIRINGS as i64) as usize].push(solid);
        }
    }
    firings
}

const STEP_RAD: f64 = TAU / FIRINGS as f64;

fn azimuth_rad(firing: usize) -> f64 {
    (firing as f64 + 0.5) * STEP_RAD - TAU / 2.0
}

fn elevation_rad(ring: usize) -> f64 {
    LOWEST_RAD + (HIGHEST_RAD - LOWEST_RAD) * ring as f64 / (BEAMS - 1) as f64
}

/// Unit vector of an azimuth (positive left) and an elevation (positive up).
pub fn direction(azimuth_rad: f64, elevation_rad: f64) -> DVec3 {
    let (sin, cos) = elevation_rad.sin_cos();
    DVec3::new(cos * azimuth_rad.cos(), cos * azimuth_rad.sin(), sin)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Purpose;
    use crate::sim::{car::Car, road::Piece};

    fn straight() -> Road {
        Road::from_pieces(&[Piece { length_m: 600.0, start_per_m: 0.0, end_per_m: 0.0 }])
    }

    fn returns_of(scene: &Scene) -> (Vec<DVec3>, Vec<LidarReturn>) {
        let world_from_ego = DAffine3::from_translation(DVec3::new(100.0, -1.75, 0.0));
        let mut noise = Noise::new(1, 0, Purpose::Lidar);
        let returns = turn(scene, &straight(), &world_from_ego, 100.0, &mut noise);
        let world = world_from_ego * ego_from_lidar();
        (returns.iter().map(|r| world.transform_point3(r.position_m)).collect(), returns)
    }

    #[test]
    fn returns_lie_on_the_ground_or_on_the_car_and_the_car_has_some() {
        let mut scene = Scene::default();
        for (s, lateral) in [(112.0, -1.75), (88.0, -1.75), (100.0, 1.9)] {
            let world_from_car = DAffine3::from_translation(DVec3::new(s, lateral, 0.0));
            Car { world_from_car, velocity_mps: DVec3::ZERO, paint: [9; 3], braking: false }
                .add_to(&mut scene);
        }
        let (points, _) = returns_of(&scene);
        let mut on_car = [0; 3];
        for point in points {
            let outside = scene.solids.iter().map(|s| s.outside_m(point).abs());
            let (nearest, distance) = outside
                .enumerate()
                .fold((0, f64::INFINITY), |best, (i, d)| if d < best.1 { (i, d) } else { best });
            assert!(distance < 0.1 || point.z.abs() < 0.1, "{point} is on nothing");
            if distance < 0.1 && point.z > 0.3 {
                on_car[nearest / 6] += 1;
            }
        }
        assert!(on_car.iter().all(|hits| *hits > 40), "ahead, behind, beside: {on_car:?}");
    }

    #[test]
    fn beams_look_up_and_down_as_far_as_they_should_and_no_further_than_the_range() {
        let (points, returns) = returns_of(&Scene::default());
        assert!(points.iter().all(|p| p.z.abs() < 0.1), "an empty world is flat ground");
        assert!(returns.iter().all(|r| r.position_m.length() < RANGE_M + 0.1));
        let lowest = returns.iter().filter(|r| r.ring == 0).count();
        assert!(lowest > 400, "the lowest beam meets the ground all around: {lowest}");
        assert!(returns.iter().all(|r| r.ring < 23), "beams above the horizon meet nothing");
    }
}
