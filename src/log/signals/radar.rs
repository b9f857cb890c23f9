//! Radar returns and tracks.

use glam::DVec3;

use crate::{
    error::Result,
    log::{signals::geometry::vector, value::Struct},
};

/// One radar return or track, in the radar's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarReturn {
    pub position_m: DVec3,
    /// Radial speed relative to the sensor, m/s, negative = approaching; `None` of a radar that does
    /// not measure it.
    pub radial_speed_mps: Option<f64>,
}

/// `radar_msgs/RadarScan`: polar returns, elevation and azimuth as REP-103 turns them.
pub fn radar_scan(message: &Struct) -> Result<Vec<RadarReturn>> {
    let one = |part: &Struct| {
        let (range, azimuth) = (part.number("range")?, part.number("azimuth")?);
        Ok(RadarReturn {
            position_m: polar(range, azimuth, part.number("elevation")?),
            radial_speed_mps: Some(part.number("doppler_velocity")?),
        })
    };
    message.parts("returns")?.map(one).collect()
}

/// A place by its distance and two angles: azimuth grows to the left, elevation upwards.
pub fn polar(range_m: f64, azimuth_rad: f64, elevation_rad: f64) -> DVec3 {
    let flat_m = range_m * elevation_rad.cos();
    let (sin, cos) = azimuth_rad.sin_cos();
    DVec3::new(flat_m * cos, flat_m * sin, range_m * elevation_rad.sin())
}

/// `radar_msgs/RadarTracks`: the radial part of each track's velocity.
pub fn radar_tracks(message: &Struct) -> Result<Vec<RadarReturn>> {
    let track = |part: &Struct| {
        let (position_m, velocity) =
            (vector(part.part("position")?)?, vector(part.part("velocity")?)?);
        let radial_speed_mps = velocity.dot(position_m.normalize_or_zero());
        Ok(RadarReturn { position_m, radial_speed_mps: Some(radial_speed_mps) })
    };
    message.parts("tracks")?.map(track).collect()
}
