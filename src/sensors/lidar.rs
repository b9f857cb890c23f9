//! The lidar: beams turning on the roof.
//!
//! A turn is taken at one instant, as CARLA's is in synchronous mode: nothing is smeared by the
//! car's own motion. Which points are lost follows CARLA's ray-cast lidar (its reference of sensors,
//! `dropoff_*`): a general share of all, whatever they meet, and of those that are left a share that
//! falls in a straight line from `dropped_at_zero` at no intensity to none at `kept_intensity`. The
//! intensity is CARLA's, exp(-attenuation x range), times what the surface sends back, and what rain
//! lets through there and back. Light and darkness change nothing: a lidar brings its own light.

use std::f64::consts::TAU;

use glam::{DAffine3, DVec2, DVec3};

use crate::{
    noise::Noise,
    scene::conditions::Sky,
    sensors::{
        echo,
        fan::Fan,
        rain::Rain,
        rays::Reach,
        sweep::{Met, Sweep},
    },
};

/// Drops that send light back are further than this from the lens, m, and most of them nearer than
/// the second length beyond it.
const NEAREST_DROP_M: f64 = 0.6;
const DROPS_M: f64 = 1.5;

/// Intensity of a drop at most.
const DROP_INTENSITY: f64 = 0.1;

/// A lidar and where it sits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarConfig {
    pub ego_from_lidar: DAffine3,
    /// 32 or 64 are common.
    pub beams: usize,
    /// Elevations of the highest and the lowest beam, degrees.
    pub top_deg: f64,
    pub bottom_deg: f64,
    /// Turns in a second.
    pub rate_hz: f64,
    /// Points that each beam tries in a turn.
    pub columns: usize,
    pub range_m: f64,
    /// Standard deviation of a range, m.
    pub range_std_m: f64,
    /// Light lost to clear air, over both ways, 1/m.
    pub attenuation_per_m: f64,
    /// Share of all points that are lost.
    pub dropped: f64,
    /// Share of points of no intensity that are lost besides, and the intensity from which on none
    /// is.
    pub dropped_at_zero: f64,
    pub kept_intensity: f64,
}

/// CARLA's figures, with the paper's range; level, in the middle of the roof.
impl Default for LidarConfig {
    fn default() -> LidarConfig {
        LidarConfig {
            ego_from_lidar: DAffine3::from_translation(DVec3::new(0.0, 0.0, 1.8)),
            beams: 32,
            top_deg: 10.0,
            bottom_deg: -30.0,
            rate_hz: 10.0,
            columns: 1000,
            range_m: 50.0,
            range_std_m: 0.02,
            attenuation_per_m: 0.004,
            dropped: 0.45,
            dropped_at_zero: 0.4,
            kept_intensity: 0.8,
        }
    }
}

/// One return.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LidarReturn {
    /// Lidar frame (x forward, y left, z up), m.
    pub position_m: [f32; 3],
    /// In [0, 1].
    pub intensity: f32,
    /// 0 is the lowest beam.
    pub ring: u16,
}

impl LidarConfig {
    /// Elevation of a beam, rad, positive = up.
    pub fn elevation_rad(&self, ring: usize) -> f64 {
        let share = ring as f64 / (self.beams.max(2) - 1) as f64;
        (self.bottom_deg + (self.top_deg - self.bottom_deg) * share).to_radians()
    }

    /// Azimuth of a column, rad, positive = left, from the tail around the right side.
    pub fn azimuth_rad(&self, column: usize) -> f64 {
        ((column as f64 + 0.5) / self.columns as f64 - 0.5) * TAU
    }

    /// Share of points of an intensity that are lost for it.
    pub fn dropped_for(&self, intensity: f64) -> f64 {
        self.dropped_at_zero * (1.0 - intensity / self.kept_intensity).max(0.0)
    }

    /// Intensity of what a beam has met, in [0, 1].
    fn intensity(&self, met: &Met, rain: &Rain) -> f64 {
        let lost_per_m = self.attenuation_per_m + 2.0 * rain.laser_per_m;
        let arrived = (-lost_per_m * f64::from(met.range_m)).exp();
        (echo::laser(met.material, met.colour, f64::from(met.facing)) * arrived).clamp(0.0, 1.0)
    }
}

/// A full turn, column by column from the tail around the right side, each from the lowest beam up.
///
/// `world_from_ego` stands at the height of the ground. The turn draws from `noise` in the order of
/// its points.
pub fn turn(
    config: &LidarConfig,
    reach: &Reach,
    world_from_ego: &DAffine3,
    sky: Sky,
    noise: &mut Noise,
) -> Vec<LidarReturn> {
    let world_from_lidar = *world_from_ego * config.ego_from_lidar;
    let origin_m = world_from_lidar.translation.as_vec3();
    let lidar_from_world = world_from_lidar.matrix3.as_mat3().transpose();
    let rain = Rain::of(sky.weather);
    let rings: Vec<(f64, f64)> =
        (0..config.beams).map(|ring| config.elevation_rad(ring).sin_cos()).collect();
    let columns: Vec<DVec2> =
        (0..config.columns).map(|column| DVec2::from_angle(config.azimuth_rad(column))).collect();
    let fan = Fan::new(
        rings.iter().map(|(up, level)| (up / level) as f32).collect(),
        columns.iter().map(|level| level.as_vec2()).collect(),
    );
    let sweep = Sweep::new(&fan, reach, lidar_from_world, origin_m, config.range_m as f32);
    let mut returns = Vec::with_capacity(config.beams * config.columns / 2);
    let mut spare_m = None;
    for (column, axis) in columns.iter().enumerate() {
        for (ring, (up, level)) in rings.iter().enumerate() {
            // One draw for both losses: those that the first leaves are spread evenly again.
            let luck = noise.uniform(0.0, 1.0) - config.dropped;
            if luck < 0.0 {
                continue;
            }
            let met = sweep.met(column, ring);
            let seen = if rain.scattered > 0.0 && noise.chance(rain.scattered) {
                Some(drop(met, noise))
            } else {
                met.map(|met| (f64::from(met.range_m), config.intensity(&met, &rain)))
            };
            let Some((range_m, intensity)) = seen else { continue };
            if luck < (1.0 - config.dropped) * config.dropped_for(intensity) {
                continue;
            }
            let error_m = spare_m.take().unwrap_or_else(|| {
                let [now_m, then_m] = noise.normal_pair(config.range_std_m);
                spare_m = Some(then_m);
                now_m
            });
            let beam = (*level * *axis).extend(*up) * (range_m + error_m);
            returns.push(LidarReturn {
                position_m: beam.as_vec3().to_array(),
                intensity: intensity as f32,
                ring: ring as u16,
            });
        }
    }
    returns
}

/// Range and intensity of a drop of rain before what a beam would have met.
fn drop(met: Option<Met>, noise: &mut Noise) -> (f64, f64) {
    let range_m = NEAREST_DROP_M - DROPS_M * (1.0 - noise.uniform(0.0, 1.0)).ln();
    let behind_m = met.map_or(f64::INFINITY, |met| f64::from(met.range_m));
    (range_m.min(behind_m), noise.uniform(0.0, DROP_INTENSITY))
}
