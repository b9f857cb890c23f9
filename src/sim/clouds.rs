//! Returns of lidar and radar as packed points, little-endian.

use crate::sensors::{
    floats::nearest,
    lidar::LidarReturn,
    radar::{RadarReturn, direction},
};

/// The number that a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    F32,
    U16,
}

/// Points of one layout.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packed {
    /// Name, bytes from the start of a point, number.
    pub fields: Vec<(&'static str, u32, Number)>,
    pub point_bytes: u32,
    pub data: Vec<u8>,
}

impl Packed {
    fn new(names: &[(&'static str, Number)], points: usize) -> Packed {
        let mut point_bytes = 0;
        let mut field = |(name, number): &(&'static str, Number)| {
            let offset = point_bytes;
            point_bytes += match number {
                Number::F32 => 4,
                Number::U16 => 2,
            };
            (*name, offset, *number)
        };
        let fields = names.iter().map(&mut field).collect();
        let data = Vec::with_capacity(point_bytes as usize * points);
        Packed { fields, point_bytes, data }
    }

    fn put(&mut self, values: impl IntoIterator<Item = f32>) {
        for value in values {
            self.data.extend_from_slice(&value.to_le_bytes());
        }
    }

    pub fn points(&self) -> u32 {
        self.data.len() as u32 / self.point_bytes
    }
}

/// Places (m) and intensities of lidar returns are told in steps of 1/256, which is finer than the
/// noise: a quarter of the bytes of a drive would otherwise be noise in the last bits.
pub fn told(value: f32) -> f32 {
    nearest(value * 256.0) as f32 / 256.0
}

/// x, y, z, intensity, and the ring where `with_ring`, as they are [`told`].
pub fn of_lidar(returns: &[LidarReturn], with_ring: bool) -> Packed {
    let fields = [
        ("x", Number::F32),
        ("y", Number::F32),
        ("z", Number::F32),
        ("intensity", Number::F32),
        ("ring", Number::U16),
    ];
    let fields = if with_ring { &fields[..] } else { &fields[..4] };
    let mut cloud = Packed::new(fields, returns.len());
    for point in returns {
        let [x, y, z] = point.position_m;
        cloud.put([x, y, z, point.intensity].map(told));
        if with_ring {
            cloud.data.extend_from_slice(&point.ring.to_le_bytes());
        }
    }
    cloud
}

/// Where a radar return is, radar frame, m.
pub fn place(point: &RadarReturn) -> [f32; 3] {
    let place_m = point.range_m * direction(point.azimuth_rad, point.elevation_rad);
    place_m.as_vec3().to_array()
}

/// x, y, z, radial speed (m/s, negative = approaching) and amplitude (dB).
pub fn of_radar(returns: &[RadarReturn]) -> Packed {
    let names = ["x", "y", "z", "velocity", "amplitude"];
    let mut cloud = Packed::new(&names.map(|name| (name, Number::F32)), returns.len());
    for point in returns {
        cloud.put(place(point));
        cloud.put([point.speed_mps as f32, point.amplitude_db as f32]);
    }
    cloud
}

/// The same by the names of CARLA's bridge, whose azimuths grow to the right.
pub fn of_radar_as_carla(returns: &[RadarReturn]) -> Packed {
    let names = ["x", "y", "z", "Range", "Velocity", "AzimuthAngle", "ElevationAngle"];
    let mut cloud = Packed::new(&names.map(|name| (name, Number::F32)), returns.len());
    for point in returns {
        cloud.put(place(point));
        let polar = [point.range_m, point.speed_mps, -point.azimuth_rad, point.elevation_rad];
        cloud.put(polar.map(|value| value as f32));
    }
    cloud
}
