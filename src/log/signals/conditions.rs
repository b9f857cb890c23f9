//! What the surroundings are like, as the simulator CARLA tells it.

use crate::{error::Result, log::value::Struct};

/// `carla_msgs/CarlaWeatherParameters`, as far as frames say it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weather {
    /// Rain, 0 ... 100; negative: as the map has it.
    pub precipitation: f64,
    /// Height of the sun over the horizon.
    pub sun_altitude_deg: f64,
}

/// `carla_msgs/CarlaWeatherParameters`.
pub fn carla_weather(message: &Struct) -> Result<Weather> {
    Ok(Weather {
        precipitation: message.number("precipitation")?,
        sun_altitude_deg: message.number("sun_altitude_angle")?,
    })
}

/// `carla_msgs/CarlaWorldInfo`: the name of the map, without the folders that newer versions of
/// the simulator put before it (`Carla/Maps/Town01`).
pub fn carla_town(message: &Struct) -> Result<String> {
    let name = message.text("map_name")?;
    Ok(name.rsplit('/').next().unwrap_or(name).to_string())
}
