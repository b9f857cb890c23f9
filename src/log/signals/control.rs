//! What the driver did.

use crate::{error::Result, log::value::Struct};

/// What a driver did, as far as one message type says it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// In [-1, 1], positive = right.
    pub steer: Option<f64>,
    pub throttle: Option<f64>,
    pub brake: Option<f64>,
    /// Angle of the front wheels, rad, positive = left (REP-103).
    pub wheel_angle_rad: Option<f64>,
}

/// `carla_msgs/CarlaEgoVehicleStatus`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CarlaStatus {
    pub speed_mps: f64,
    pub control: Control,
}

/// `ackermann_msgs/AckermannDriveStamped`.
pub fn ackermann(message: &Struct) -> Result<Control> {
    let angle = message.part("drive")?.number("steering_angle")?;
    Ok(Control { steer: None, throttle: None, brake: None, wheel_angle_rad: Some(angle) })
}

/// `carla_msgs/CarlaEgoVehicleControl`.
pub fn carla_control(message: &Struct) -> Result<Control> {
    Ok(Control {
        steer: Some(message.number("steer")?),
        throttle: Some(message.number("throttle")?),
        brake: Some(message.number("brake")?),
        wheel_angle_rad: None,
    })
}

/// `carla_msgs/CarlaEgoVehicleStatus`.
pub fn carla_status(message: &Struct) -> Result<CarlaStatus> {
    let control = carla_control(message.part("control")?)?;
    Ok(CarlaStatus { speed_mps: message.number("velocity")?, control })
}

/// `autoware_vehicle_msgs/SteeringReport` (before: `autoware_auto_vehicle_msgs`): the angle of the
/// front wheels, positive to the left.
pub fn steering_report(message: &Struct) -> Result<Control> {
    let angle = message.number("steering_tire_angle")?;
    Ok(Control { steer: None, throttle: None, brake: None, wheel_angle_rad: Some(angle) })
}

/// `tier4_vehicle_msgs/ActuationStatusStamped`: the pedals. What its steering means differs from
/// car to car.
pub fn actuation(message: &Struct) -> Result<Control> {
    let status = message.part("status")?;
    Ok(Control {
        steer: None,
        throttle: Some(status.number("accel_status")?),
        brake: Some(status.number("brake_status")?),
        wheel_angle_rad: None,
    })
}
