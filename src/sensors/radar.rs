//! The radar: rays at random through a field, ranges and radial speeds.
//!
//! A return's speed is the rate at which its distance to the sensor changes, so it is relative
//! to the ego vehicle and negative when approaching: what stands still ahead of a car driving at
//! v comes back with -v cos(angle).

use glam::{DAffine3, DVec3};

use crate::{
    noise::Noise,
    scene::conditions::Sky,
    sensors::{echo, rain::Rain, rays::Reach},
    world::{ego::Car, reservation::ActorId},
};

/// A radar and where it sits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarConfig {
    pub ego_from_radar: DAffine3,
    /// Field of view, degrees.
    pub width_deg: f64,
    pub height_deg: f64,
    pub range_m: f64,
    /// Rays in a second; not all come back.
    pub points_per_s: f64,
    /// Scans in a second.
    pub rate_hz: f64,
    /// Standard deviations of what is measured.
    pub range_std_m: f64,
    pub angle_std_rad: f64,
    pub speed_std_mps: f64,
    pub amplitude_std_db: f64,
}

/// The field of CARLA's example of manual control, with the points and range of its sensor; level, in
/// the front bumper.
impl Default for RadarConfig {
    fn default() -> RadarConfig {
        RadarConfig {
            ego_from_radar: DAffine3::from_translation(DVec3::new(2.4, 0.0, 0.6)),
            width_deg: 35.0,
            height_deg: 20.0,
            range_m: 100.0,
            points_per_s: 1500.0,
            rate_hz: 13.0,
            range_std_m: 0.1,
            angle_std_rad: 0.004,
            speed_std_mps: 0.08,
            amplitude_std_db: 1.0,
        }
    }
}

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarReturn {
    pub range_m: f64,
    /// Rad, positive = left.
    pub azimuth_rad: f64,
    /// Rad, positive = up.
    pub elevation_rad: f64,
    /// Relative to the radar, m/s, negative = approaching.
    pub speed_mps: f64,
    pub amplitude_db: f64,
    /// Who was hit, if anybody: what no radar knows, and tests ask.
    pub actor: Option<ActorId>,
}

impl RadarConfig {
    /// Rays in a scan.
    pub fn rays(&self) -> usize {
        (self.points_per_s / self.rate_hz).round() as usize
    }

    /// Velocity of the radar on a car, with what the car's turning adds; world frame, m/s.
    pub fn velocity_world_mps(&self, ego: &Car) -> DVec3 {
        let turning = DVec3::Z * ego.yaw_rate_radps();
        let velocity_mps = ego.velocity_ego_mps().extend(0.0);
        ego.orientation() * (velocity_mps + turning.cross(self.ego_from_radar.translation))
    }
}

/// Unit vector of an azimuth (positive left) and an elevation (positive up).
pub fn direction(azimuth_rad: f64, elevation_rad: f64) -> DVec3 {
    let (up, level) = elevation_rad.sin_cos();
    let (left, ahead) = azimuth_rad.sin_cos();
    DVec3::new(level * ahead, level * left, up)
}

/// One scan.
///
/// `world_from_ego` stands at the height of the ground; `radar_mps` is the velocity of the radar
/// itself in the world frame, as [`RadarConfig::velocity_world_mps`] has it. Rain weakens returns a
/// little and loses none.
pub fn scan(
    config: &RadarConfig,
    reach: &Reach,
    world_from_ego: &DAffine3,
    radar_mps: DVec3,
    sky: Sky,
    noise: &mut Noise,
) -> Vec<RadarReturn> {
    let world_from_radar = *world_from_ego * config.ego_from_radar;
    let origin_m = world_from_radar.translation.as_vec3();
    let (width_rad, height_rad) = (config.width_deg.to_radians(), config.height_deg.to_radians());
    let rain = Rain::of(sky.weather);
    let ahead = world_from_radar.matrix3.x_axis.as_vec3();
    let rays = reach.rays_towards(ahead, (0.5 * width_rad.hypot(height_rad)) as f32);
    let mut returns = Vec::new();
    for _ in 0..config.rays() {
        let azimuth_rad = noise.uniform(-0.5, 0.5) * width_rad;
        let elevation_rad = noise.uniform(-0.5, 0.5) * height_rad;
        let ray = world_from_radar.transform_vector3(direction(azimuth_rad, elevation_rad));
        let Some(hit) = rays.hit(origin_m, ray.as_vec3(), config.range_m as f32) else {
            continue;
        };
        let facing = hit.normal.as_dvec3().dot(ray).abs();
        let echo = echo::radar(hit.material, facing);
        if !noise.chance(echo.share) {
            continue;
        }
        let range_m = f64::from(hit.range_m);
        // The radar equation: power falls with the fourth power of range.
        let lost_db = 40.0 * range_m.max(1.0).log10() + rain.radar_db_per_m * 2.0 * range_m;
        let speed_mps = (hit.velocity_mps.as_dvec3() - radar_mps).dot(ray);
        returns.push(RadarReturn {
            range_m: (range_m + noise.normal(config.range_std_m)).max(0.1),
            azimuth_rad: azimuth_rad + noise.normal(config.angle_std_rad),
            elevation_rad: elevation_rad + noise.normal(config.angle_std_rad),
            speed_mps: speed_mps + noise.normal(config.speed_std_mps),
            amplitude_db: 60.0 + echo.gain_db - lost_db + noise.normal(config.amplitude_std_db),
            actor: hit.actor,
        });
    }
    returns
}
