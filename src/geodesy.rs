//! Latitudes and longitudes to metres and back: the plane that touches the earth at one place, which
//! ingest and the simulator share.
//!
//! WGS 84, as NIMA TR8350.2 defines it: geodetic to earth-centred coordinates in closed form, and
//! from there into the axes east, north, up of the place. Exact at any distance, as a chord is;
//! the plane leaves the ground by 8 cm in a kilometre.

use glam::{DMat3, DVec3};

/// Semi-major axis, metres.
const EQUATOR_RADIUS_M: f64 = 6_378_137.0;

const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Square of the first eccentricity.
const ECCENTRICITY_2: f64 = FLATTENING * (2.0 - FLATTENING);

/// Earth-centred, earth-fixed coordinates of a place: x towards latitude and longitude 0, z towards
/// the north pole, metres. The height is above the ellipsoid.
pub fn earth_centred(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> DVec3 {
    let (sin_lat, cos_lat) = latitude_deg.to_radians().sin_cos();
    let (sin_lon, cos_lon) = longitude_deg.to_radians().sin_cos();
    let normal_m = EQUATOR_RADIUS_M / (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
    let flat_m = (normal_m + height_m) * cos_lat;
    let z = (normal_m * (1.0 - ECCENTRICITY_2) + height_m) * sin_lat;
    DVec3::new(flat_m * cos_lon, flat_m * sin_lon, z)
}

/// A plane that touches the ellipsoid: x east, y north, z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentPlane {
    origin_m: DVec3,
    enu_from_earth: DMat3,
}

impl TangentPlane {
    /// The plane at a place.
    pub fn new(latitude_deg: f64, longitude_deg: f64, height_m: f64) -> TangentPlane {
        let (sin_lat, cos_lat) = latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = longitude_deg.to_radians().sin_cos();
        let east = DVec3::new(-sin_lon, cos_lon, 0.0);
        let north = DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat);
        let up = DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat);
        TangentPlane {
            origin_m: earth_centred(latitude_deg, longitude_deg, height_m),
            enu_from_earth: DMat3::from_cols(east, north, up).transpose(),
        }
    }

    /// East, north and up of another place, metres.
    pub fn enu(&self, latitude_deg: f64, longitude_deg: f64, height_m: f64) -> DVec3 {
        let place = earth_centred(latitude_deg, longitude_deg, height_m);
        self.enu_from_earth * (place - self.origin_m)
    }

    /// Latitude and longitude, degrees, and height above the ellipsoid, metres, of a place on the
    /// plane or off it: what [`TangentPlane::enu`] undoes.
    pub fn geodetic(&self, enu_m: DVec3) -> [f64; 3] {
        let point = self.enu_from_earth.transpose() * enu_m + self.origin_m;
        let flat_m = point.x.hypot(point.y);
        // Where the normal of the ellipsoid through the point meets the polar axis depends on the
        // latitude; each turn leaves a share of the error as small as the eccentricity's square.
        let mut latitude = point.z.atan2(flat_m * (1.0 - ECCENTRICITY_2));
        let mut normal_m = EQUATOR_RADIUS_M;
        for _ in 0..7 {
            let sin = latitude.sin();
            normal_m = EQUATOR_RADIUS_M / (1.0 - ECCENTRICITY_2 * sin * sin).sqrt();
            latitude = (point.z + ECCENTRICITY_2 * normal_m * sin).atan2(flat_m);
        }
        let (sin, cos) = latitude.sin_cos();
        // Along the normal, which is well defined at the equator and at the poles alike.
        let height_m = flat_m * cos + (point.z + ECCENTRICITY_2 * normal_m * sin) * sin - normal_m;
        [latitude.to_degrees(), point.y.atan2(point.x).to_degrees(), height_m]
    }
}
