//! Radar messages to returns with a place and a radial speed, whatever their form and signs.

use glam::DVec3;

use crate::{
    error::{Error, Result},
    log::{
        candidates::{RADIAL_SPEED_FIELDS, RELATIVE_VELOCITY_FIELDS},
        cloud::{Cloud, CloudField, CloudPoint},
        conventions::{RadarRule, Side, Sign},
        signals::{Kind, RadarReturn, polar, radar_scan, radar_tracks},
        value::Struct,
    },
};

/// Names of the fields of clouds in polar coordinates: range, azimuth, elevation.
const POLAR_FIELDS: [&[&str]; 3] = [
    &["range", "distance", "depth"],
    &["azimuth", "azimuth_angle", "azimuthangle"],
    &["elevation", "elevation_angle", "elevationangle", "altitude"],
];

/// Returns of a scan, a list of tracks or a cloud, in the radar's frame (x forward, y left, z up).
///
/// A cloud's x, y, z are taken as they are; without them its range, azimuth and elevation (radians)
/// are, with azimuth growing to the side of the rule. Its speed is a field of that name, or the
/// radial part of the fields vx and vy.
///
/// # Errors
///
/// [`Error::Decode`] if the message is none of these, or a cloud has no places.
pub fn returns(kind: Kind, message: &Struct, rule: &RadarRule) -> Result<Vec<RadarReturn>> {
    let mut returns = match kind {
        Kind::RadarScan => radar_scan(message)?,
        Kind::RadarTracks => radar_tracks(message)?,
        _ => of_cloud(message, rule.azimuth.unwrap_or(Side::Left))?,
    };
    if rule.closing_speed == Some(Sign::Positive) {
        for r in &mut returns {
            r.radial_speed_mps = r.radial_speed_mps.map(|speed| -speed);
        }
    }
    Ok(returns)
}

/// Where a point of a cloud says that it is.
enum Place<'c> {
    Cartesian([&'c CloudField; 3]),
    Polar([&'c CloudField; 3]),
}

/// What a point of a cloud says of its speed.
enum Speed<'c> {
    Radial(&'c CloudField),
    Planar([&'c CloudField; 2]),
    None,
}

fn of_cloud(message: &Struct, azimuth: Side) -> Result<Vec<RadarReturn>> {
    let cloud = Cloud::new(message)?;
    let place = place_of(&cloud)?;
    let speed = speed_of(&cloud);
    let sign = match azimuth {
        Side::Left => 1.0,
        Side::Right => -1.0,
    };
    let returned = |point: CloudPoint| {
        let point_m = match &place {
            Place::Cartesian(xyz) => DVec3::from_array(xyz.map(|field| point.get(field))),
            Place::Polar(fields) => {
                let [range, azimuth, elevation] = fields.map(|field| point.get(field));
                polar(range, sign * azimuth, elevation)
            }
        };
        let radial_speed_mps = match &speed {
            Speed::Radial(field) => Some(point.get(field)),
            Speed::Planar([vx, vy]) => {
                let velocity = DVec3::new(point.get(vx), point.get(vy), 0.0);
                Some(velocity.dot(point_m.normalize_or_zero()))
            }
            Speed::None => None,
        };
        let pose = &cloud.frame_from_points;
        let position_m = pose.as_ref().map_or(point_m, |pose| pose.transform_point(point_m));
        RadarReturn { position_m, radial_speed_mps }
    };
    Ok(cloud.points().map(returned).collect())
}

fn place_of<'c>(cloud: &'c Cloud) -> Result<Place<'c>> {
    if let Ok(xyz) = cloud.xyz() {
        return Ok(Place::Cartesian(xyz));
    }
    let found = POLAR_FIELDS.map(|names| names.iter().find_map(|name| cloud.field(name)));
    let [Some(range), Some(azimuth), Some(elevation)] = found else {
        let have: Vec<_> = cloud.fields.iter().map(|field| field.name.as_str()).collect();
        return Err(Error::Decode {
            schema: "a radar cloud".into(),
            offset: 0,
            what: format!(
                "neither x, y, z nor range, azimuth, elevation; its fields are {}",
                have.join(", ")
            ),
        });
    };
    Ok(Place::Polar([range, azimuth, elevation]))
}

fn speed_of<'c>(cloud: &'c Cloud) -> Speed<'c> {
    if let Some(field) = RADIAL_SPEED_FIELDS.iter().find_map(|name| cloud.field(name)) {
        return Speed::Radial(field);
    }
    match RELATIVE_VELOCITY_FIELDS.map(|name| cloud.field(name)) {
        [Some(vx), Some(vy)] => Speed::Planar([vx, vy]),
        _ => Speed::None,
    }
}
