//! What drives and walks beside the ego vehicle: sizes and manners by kind.

use glam::DVec2;
use serde::{Deserialize, Serialize};

use crate::{noise::Noise, world::car_following::Idm};

/// Kinds of vehicles in traffic (paper, section III.B).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VehicleKind {
    Car,
    Jeep,
    Van,
    Truck,
    Bus,
    Motorcycle,
    Bicycle,
}

/// Kinds of pedestrians.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WalkerKind {
    Adult,
    Child,
}

impl VehicleKind {
    /// In a word, as logs and tables have it.
    pub fn name(self) -> &'static str {
        match self {
            VehicleKind::Car => "car",
            VehicleKind::Jeep => "jeep",
            VehicleKind::Van => "van",
            VehicleKind::Truck => "truck",
            VehicleKind::Bus => "bus",
            VehicleKind::Motorcycle => "motorcycle",
            VehicleKind::Bicycle => "bicycle",
        }
    }
}

impl WalkerKind {
    /// In a word, as logs and tables have it.
    pub fn name(self) -> &'static str {
        match self {
            WalkerKind::Adult => "adult",
            WalkerKind::Child => "child",
        }
    }
}

/// What holds for all vehicles of a kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VehicleModel {
    pub kind: VehicleKind,
    /// Of a hundred vehicles in traffic.
    pub share: f64,
    /// Half of length and width, m, and height, m: of common vehicles of the kind.
    pub half_m: DVec2,
    pub height_m: f64,
    /// Wheelbase over length.
    pub wheelbase: f64,
    /// Strongest wanted acceleration and comfortable braking, m/s2.
    pub acceleration_mps2: f64,
    pub comfort_mps2: f64,
    /// Time gap to the vehicle ahead, s.
    pub time_gap_s: f64,
    /// What it can or may drive at most, m/s.
    pub fastest_mps: f64,
    /// Lateral acceleration that it takes curves with, m/s2.
    pub lateral_mps2: f64,
}

/// Acceleration, braking and time gaps in the range of Treiber and Kesting, Traffic Flow Dynamics,
/// table 11.2: cars in town and trucks.
pub const VEHICLES: [VehicleModel; 7] = [
    VehicleModel {
        kind: VehicleKind::Car,
        share: 50.0,
        half_m: DVec2::new(2.3, 0.92),
        height_m: 1.48,
        wheelbase: 0.6,
        acceleration_mps2: 1.6,
        comfort_mps2: 2.0,
        time_gap_s: 1.2,
        fastest_mps: 36.0,
        lateral_mps2: 2.2,
    },
    VehicleModel {
        kind: VehicleKind::Jeep,
        share: 12.0,
        half_m: DVec2::new(2.25, 0.95),
        height_m: 1.85,
        wheelbase: 0.6,
        acceleration_mps2: 1.4,
        comfort_mps2: 2.0,
        time_gap_s: 1.3,
        fastest_mps: 33.0,
        lateral_mps2: 2.0,
    },
    VehicleModel {
        kind: VehicleKind::Van,
        share: 11.0,
        half_m: DVec2::new(2.7, 0.99),
        height_m: 2.4,
        wheelbase: 0.6,
        acceleration_mps2: 1.2,
        comfort_mps2: 1.8,
        time_gap_s: 1.3,
        fastest_mps: 30.0,
        lateral_mps2: 1.8,
    },
    VehicleModel {
        kind: VehicleKind::Truck,
        share: 6.0,
        half_m: DVec2::new(4.1, 1.22),
        height_m: 3.4,
        wheelbase: 0.58,
        acceleration_mps2: 0.9,
        comfort_mps2: 1.6,
        time_gap_s: 1.6,
        fastest_mps: 24.0,
        lateral_mps2: 1.3,
    },
    VehicleModel {
        kind: VehicleKind::Bus,
        share: 4.0,
        half_m: DVec2::new(5.6, 1.25),
        height_m: 3.1,
        wheelbase: 0.52,
        acceleration_mps2: 1.0,
        comfort_mps2: 1.5,
        time_gap_s: 1.6,
        fastest_mps: 24.0,
        lateral_mps2: 1.2,
    },
    VehicleModel {
        kind: VehicleKind::Motorcycle,
        share: 8.0,
        half_m: DVec2::new(1.08, 0.4),
        height_m: 1.55,
        wheelbase: 0.65,
        acceleration_mps2: 2.0,
        comfort_mps2: 2.2,
        time_gap_s: 1.2,
        fastest_mps: 36.0,
        lateral_mps2: 2.4,
    },
    VehicleModel {
        kind: VehicleKind::Bicycle,
        share: 9.0,
        half_m: DVec2::new(0.88, 0.32),
        height_m: 1.7,
        wheelbase: 0.6,
        acceleration_mps2: 0.8,
        comfort_mps2: 1.6,
        time_gap_s: 1.1,
        fastest_mps: 6.0,
        lateral_mps2: 1.5,
    },
];

/// Gap at rest, m.
pub const REST_GAP_M: f64 = 2.0;

impl VehicleModel {
    /// Any kind, by its share of the traffic.
    pub fn draw(noise: &mut Noise) -> &'static VehicleModel {
        let total: f64 = VEHICLES.iter().map(|model| model.share).sum();
        let mut left = noise.uniform(0.0, total);
        for model in &VEHICLES {
            left -= model.share;
            if left < 0.0 {
                return model;
            }
        }
        &VEHICLES[0]
    }

    /// How drivers of this kind follow.
    pub fn idm(&self) -> Idm {
        Idm {
            acceleration_mps2: self.acceleration_mps2,
            comfort_mps2: self.comfort_mps2,
            time_gap_s: self.time_gap_s,
            rest_gap_m: REST_GAP_M,
        }
    }

    /// From axle to axle, m.
    pub fn wheelbase_m(&self) -> f64 {
        2.0 * self.half_m.x * self.wheelbase
    }
}

impl WalkerKind {
    /// Half of depth and width, m.
    pub fn half_m(self) -> DVec2 {
        match self {
            WalkerKind::Adult => DVec2::new(0.2, 0.27),
            WalkerKind::Child => DVec2::new(0.16, 0.2),
        }
    }

    pub fn height_m(self) -> f64 {
        match self {
            WalkerKind::Adult => 1.75,
            WalkerKind::Child => 1.2,
        }
    }
}
