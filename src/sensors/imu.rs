//! The inertial unit at the origin of the ego frame: rates of turn, and the forces that it feels.

use glam::{DQuat, DVec2, DVec3};

use crate::{noise::Noise, world::ego::Car};

/// What pushes a car at rest up, m/s2.
pub const GRAVITY_MPS2: f64 = 9.81;

/// Standard deviations of the noise of each sample, and of the offsets that stay for a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuConfig {
    pub yaw_std_rad: f64,
    pub turn_std_radps: f64,
    pub turn_offset_std_radps: f64,
    pub acceleration_std_mps2: f64,
    pub acceleration_offset_std_mps2: f64,
}

/// A unit as cars have it.
impl Default for ImuConfig {
    fn default() -> ImuConfig {
        ImuConfig {
            yaw_std_rad: 0.0005,
            turn_std_radps: 0.002,
            turn_offset_std_radps: 0.0005,
            acceleration_std_mps2: 0.05,
            acceleration_offset_std_mps2: 0.02,
        }
    }
}

/// A unit on a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Imu {
    config: ImuConfig,
    turn_offset_radps: DVec3,
    acceleration_offset_mps2: DVec3,
}

/// What the unit says, in the ego frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImuReading {
    /// Of the ego frame in the world frame.
    pub orientation: DQuat,
    pub turn_radps: DVec3,
    /// With what holds the car up: at rest (0, 0, 9.81).
    pub acceleration_mps2: DVec3,
}

impl Imu {
    /// A unit with the offsets that it has on this drive.
    pub fn new(config: ImuConfig, noise: &mut Noise) -> Imu {
        Imu {
            config,
            turn_offset_radps: shaken(DVec3::ZERO, config.turn_offset_std_radps, noise),
            acceleration_offset_mps2: shaken(
                DVec3::ZERO,
                config.acceleration_offset_std_mps2,
                noise,
            ),
        }
    }

    /// Measure a car now, `elapsed_s` after it was `before`: the acceleration is the mean of that
    /// time, which should be a step of the car.
    pub fn measure(
        &self,
        before: &Car,
        now: &Car,
        elapsed_s: f64,
        noise: &mut Noise,
    ) -> ImuReading {
        let config = &self.config;
        let gained_mps = now.velocity_world_mps() - before.velocity_world_mps();
        // The world's gain, seen from the car midway through its turn.
        let midway_rad = (before.yaw_rad + now.yaw_rad) / 2.0;
        let felt_mps2 = DVec2::from_angle(-midway_rad).rotate(gained_mps / elapsed_s);
        let turn_radps = DVec3::Z * now.yaw_rate_radps() + self.turn_offset_radps;
        let acceleration_mps2 = felt_mps2.extend(GRAVITY_MPS2) + self.acceleration_offset_mps2;
        ImuReading {
            orientation: DQuat::from_rotation_z(now.yaw_rad + noise.normal(config.yaw_std_rad)),
            turn_radps: shaken(turn_radps, config.turn_std_radps, noise),
            acceleration_mps2: shaken(acceleration_mps2, config.acceleration_std_mps2, noise),
        }
    }
}

/// A vector with noise on each of its parts.
fn shaken(vector: DVec3, std: f64, noise: &mut Noise) -> DVec3 {
    let mut part = || noise.normal(std);
    vector + DVec3::new(part(), part(), part())
}
