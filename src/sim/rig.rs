//! The sensors of the recorded car, and where they sit on it.

use glam::DAffine3;

use crate::sensors::{
    camera::CameraConfig, gnss::GnssConfig, imu::ImuConfig, lidar::LidarConfig,
    odometry::OdometryConfig, radar::RadarConfig,
};

/// All sensors of a car.
#[derive(Clone, Debug, Default)]
pub struct Rig {
    pub camera: CameraConfig,
    pub lidar: LidarConfig,
    pub radar: RadarConfig,
    pub odometry: OdometryConfig,
    pub imu: ImuConfig,
    pub gnss: GnssConfig,
}

/// What sits on the car at a place of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mounted {
    Camera,
    Lidar,
    Radar,
    Gnss,
}

impl Rig {
    /// Where everything sits: `ego_from_sensor`; that of the camera is its optical frame.
    pub fn mounts(&self) -> [(Mounted, DAffine3); 4] {
        [
            (Mounted::Camera, self.camera.ego_from_camera),
            (Mounted::Lidar, self.lidar.ego_from_lidar),
            (Mounted::Radar, self.radar.ego_from_radar),
            (Mounted::Gnss, self.gnss.ego_from_antenna),
        ]
    }
}
