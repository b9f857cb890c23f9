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
    /// Radial speed relative to the sensor, m/s, negative = approaching.
    pub radial_speed_mps: f64,
}

/// `radar_msgs/RadarScan`: polar returns, elevation and azimuth as REP-103 turns them.
pub fn radar_scan(message: &Struct) -> Result<Vec<RadarReturn>> {
    let polar = |part: &Struct| {
        let (range, azimuth) = (part.number("range")?, part.number("azimuth")?);
        let (sin_elevation, cos_elevation) = part.number("elevation")?.sin_cos();
        let flat = range * cos_elevation;
        Ok(RadarReturn {
            position_m: DVec3::new(
                flat * azimuth.cos(),
                flat * azimuth.sin(),
                range * sin_elevation,
            ),
            radial_speed_mps: part.number("doppler_velocity")?,
        })
    };
    message.parts("returns")?.map(polar).collect()
}

/// `radar_msgs/RadarTracks`: the radial part of each track's velocity.
pub fn radar_tracks(message: &Struct) -> Result<Vec<RadarReturn>> {
    let track = |part: &Struct| {
        let (position_m, velocity) =
            (vector(part.part("position")?)?, vector(part.part("velocity")?)?);
        let radial_speed_mps = velocity.dot(position_m.normalize_or_zero());
        Ok(RadarReturn { position_m, radial_speed_mps })
    };
    message.parts("tracks")?.map(track).collect()
}
