//! Odometry: where the car believes itself to be, and how it moves.

use glam::{DQuat, DVec3};

use crate::{noise::Noise, world::ego::Car};

/// Standard deviations of what is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryConfig {
    pub position_std_m: f64,
    pub yaw_std_rad: f64,
    pub velocity_std_mps: f64,
    pub yaw_rate_std_radps: f64,
}

/// Localisation on a map, as good as research cars have it.
impl Default for OdometryConfig {
    fn default() -> OdometryConfig {
        OdometryConfig {
            position_std_m: 0.01,
            yaw_std_rad: 0.0005,
            velocity_std_mps: 0.02,
            yaw_rate_std_radps: 0.002,
        }
    }
}

/// What odometry says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryReading {
    /// Of the ego frame in the world frame, m.
    pub position_m: DVec3,
    /// Of the ego frame in the world frame.
    pub orientation: DQuat,
    /// Of the ego frame's origin, in the ego frame, m/s.
    pub velocity_mps: DVec3,
    /// Positive = left.
    pub yaw_rate_radps: f64,
}

/// Measure a car on ground of a height. The car stays on the ground, so its height is not measured
/// but known, and it neither rolls nor pitches.
pub fn measure(
    config: &OdometryConfig,
    ego: &Car,
    ground_m: f64,
    noise: &mut Noise,
) -> OdometryReading {
    let mut near = |value: f64, std: f64| value + noise.normal(std);
    let position_std_m = config.position_std_m;
    let velocity_mps = ego.velocity_ego_mps();
    OdometryReading {
        position_m: DVec3::new(
            near(ego.position_m.x, position_std_m),
            near(ego.position_m.y, position_std_m),
            ground_m,
        ),
        orientation: DQuat::from_rotation_z(near(ego.yaw_rad, config.yaw_std_rad)),
        velocity_mps: DVec3::new(
            near(velocity_mps.x, config.velocity_std_mps),
            near(velocity_mps.y, config.velocity_std_mps),
            0.0,
        ),
        yaw_rate_radps: near(ego.yaw_rate_radps(), config.yaw_rate_std_radps),
    }
}
