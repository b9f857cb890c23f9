//! The receiver of satellites: latitude, longitude and altitude.
//!
//! The map lies on the plane that touches the earth at its origin, x east and y north. What is wrong
//! with a fix is noise, new each time, and an offset that wanders: satellites move, and so does the
//! air between, within minutes (a first-order Gauss-Markov process).

use glam::{DAffine3, DVec3};

use crate::{geodesy::TangentPlane, noise::Noise, world::ego::Car};

/// A receiver, where its antenna sits, and where on earth the map lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssConfig {
    pub ego_from_antenna: DAffine3,
    /// Of the map's origin, degrees, and metres above the ellipsoid.
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    pub altitude_m: f64,
    /// Fixes in a second.
    pub rate_hz: f64,
    /// Standard deviations of the noise: east and north, up, m.
    pub level_std_m: f64,
    pub up_std_m: f64,
    /// The same of the wandering offset, and the time in which it forgets, s.
    pub level_offset_std_m: f64,
    pub up_offset_std_m: f64,
    pub forgets_s: f64,
}

/// A receiver with corrections, on the roof; the origin is that of CARLA's towns.
impl Default for GnssConfig {
    fn default() -> GnssConfig {
        GnssConfig {
            ego_from_antenna: DAffine3::from_translation(DVec3::new(-0.5, 0.0, 1.4)),
            latitude_deg: 49.0,
            longitude_deg: 8.0,
            altitude_m: 0.0,
            rate_hz: 10.0,
            level_std_m: 0.05,
            up_std_m: 0.1,
            level_offset_std_m: 0.5,
            up_offset_std_m: 1.0,
            forgets_s: 300.0,
        }
    }
}

/// A receiver on a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gnss {
    config: GnssConfig,
    plane: TangentPlane,
    offset_m: DVec3,
}

/// What the receiver says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssFix {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    /// Above the ellipsoid.
    pub altitude_m: f64,
    /// Standard deviations of all that is wrong with it: east, north, up, m.
    pub std_m: DVec3,
}

impl Gnss {
    /// A receiver with the offset that it begins this drive with.
    pub fn new(config: GnssConfig, noise: &mut Noise) -> Gnss {
        let plane = TangentPlane::new(config.latitude_deg, config.longitude_deg, config.altitude_m);
        let offset_m = config.offset_std_m() * normal(noise);
        Gnss { config, plane, offset_m }
    }

    /// Measure a car on ground of a height, `elapsed_s` after the last fix (0 for the first).
    pub fn measure(
        &mut self,
        ego: &Car,
        ground_m: f64,
        elapsed_s: f64,
        noise: &mut Noise,
    ) -> GnssFix {
        let config = &self.config;
        let kept = (-elapsed_s / config.forgets_s).exp();
        let renewed = (1.0 - kept * kept).sqrt();
        self.offset_m = kept * self.offset_m + renewed * config.offset_std_m() * normal(noise);
        let on_ground = ego.world_from_ego(ground_m);
        let antenna_m = on_ground.transform_point3(config.ego_from_antenna.translation);
        let noise_m = config.noise_std_m() * normal(noise);
        let [latitude_deg, longitude_deg, altitude_m] =
            self.plane.geodetic(antenna_m + self.offset_m + noise_m);
        let (noise_std_m, offset_std_m) = (config.noise_std_m(), config.offset_std_m());
        let std_m = (noise_std_m * noise_std_m + offset_std_m * offset_std_m).map(f64::sqrt);
        GnssFix { latitude_deg, longitude_deg, altitude_m, std_m }
    }
}

impl GnssConfig {
    fn noise_std_m(&self) -> DVec3 {
        DVec3::new(self.level_std_m, self.level_std_m, self.up_std_m)
    }

    fn offset_std_m(&self) -> DVec3 {
        DVec3::new(self.level_offset_std_m, self.level_offset_std_m, self.up_offset_std_m)
    }
}

/// A vector of independent normal numbers.
fn normal(noise: &mut Noise) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| noise.normal(1.0)))
}
