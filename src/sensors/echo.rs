//! How much of a laser pulse and of a radar wave comes back from what.
//!
//! Light is that of 905 nm. Roads, side-walks and bark are medians at 0.90 um of 170, 60 and 25
//! spectra measured in Santa Barbara (Herold and others, 2004), leaves that of 2000 canopies
//! modelled with PROSAIL, both as the library of spectra earthlib 1.1.0 has them; a quarter of the
//! roads lie below 0.07, a quarter above 0.15. What is left is chosen between these: paint with its
//! glass beads bright, walls and metal in the middle, rubber dark; coachwork and clothes spread
//! widely, so their colour decides. What the radar is told is chosen as well, so that metal dominates
//! a scan and flat ground hardly shows; gains keep the order of radar cross sections as measured near
//! 77 GHz (cars some +10 dBsm, people some -8 dBsm).

use crate::scene::mesh::Material;

/// Share of laser light, in [0, 1], that a surface sends back: `facing` is the cosine between the
/// beam and the normal. Rough surfaces obey Lambert's law; glass is a mirror but for its dirt.
pub fn laser(material: Material, colour: [u8; 3], facing: f64) -> f64 {
    match material {
        Material::Glass => 0.03 * facing + 0.5 * facing.powi(32),
        _ => diffuse(material, colour) * facing,
    }
}

/// Share of light that a rough surface of a material throws back.
fn diffuse(material: Material, colour: [u8; 3]) -> f64 {
    match material {
        Material::Asphalt => 0.11,
        Material::Marking => 0.6,
        Material::Concrete => 0.31,
        Material::Facade => 0.35,
        Material::Grass | Material::Foliage => 0.45,
        Material::Plaster => 0.5,
        Material::Bark => 0.38,
        Material::Metal | Material::StreetLamp => 0.4,
        Material::Coachwork => 0.1 + 0.7 * brightness(colour),
        Material::Glass => 0.03,
        Material::Rubber => 0.05,
        // Reflectors are part of them.
        Material::HeadLamp => 0.6,
        Material::TailLamp | Material::BrakeLamp => 0.9,
        Material::Skin => 0.55,
        // Most dyes let infrared light through to the fibre.
        Material::Jacket | Material::Trousers => 0.3 + 0.3 * brightness(colour),
    }
}

/// Luma of an sRGB colour, in [0, 1].
fn brightness([red, green, blue]: [u8; 3]) -> f64 {
    (0.299 * f64::from(red) + 0.587 * f64::from(green) + 0.114 * f64::from(blue)) / 255.0
}

/// How a material answers a radar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadarEcho {
    /// Share of rays that come back, in [0, 1].
    pub share: f64,
    /// Strength over that of a body of one square metre, dB.
    pub gain_db: f64,
}

/// The answer of a material: `facing` is the cosine between the ray and the normal. Edges and
/// corners of metal answer at any angle, flat ground throws waves forward.
pub fn radar(material: Material, facing: f64) -> RadarEcho {
    let (at_any_angle, when_facing, gain_db) = match material {
        Material::Asphalt | Material::Marking => (0.01, 0.15, -20.0),
        Material::Concrete => (0.02, 0.3, -12.0),
        Material::Grass => (0.05, 0.15, -16.0),
        Material::Facade | Material::Plaster => (0.15, 0.6, 4.0),
        Material::Bark => (0.15, 0.3, -6.0),
        Material::Foliage => (0.2, 0.2, -8.0),
        Material::Metal | Material::Coachwork => (0.6, 0.35, 10.0),
        Material::HeadLamp | Material::TailLamp | Material::BrakeLamp => (0.4, 0.35, 6.0),
        Material::StreetLamp => (0.4, 0.35, 0.0),
        Material::Glass => (0.1, 0.3, -4.0),
        Material::Rubber => (0.05, 0.2, -10.0),
        Material::Skin | Material::Jacket | Material::Trousers => (0.45, 0.35, -8.0),
    };
    RadarEcho { share: at_any_angle + when_facing * facing, gain_db }
}
