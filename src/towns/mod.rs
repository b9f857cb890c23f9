//! Seven towns of our own, as OpenDRIVE.
//!
//! A town is a plan: streets drawn from place to place, each with a profile of lanes. Laying it
//! out trims the streets where they meet and fills the crossings with a road for every way
//! through. Map frame: x east, y north, metres; traffic keeps right.

pub mod course;
pub mod profile;
pub mod plan;
pub mod movement;
pub mod network;
pub mod junction;
pub mod layout;
pub mod markings;
pub mod xml_text;
pub mod opendrive;
pub mod cross_sections;
pub mod town01;
pub mod town02;
pub mod town03;
pub mod town04;
pub mod town05;
pub mod town06;
pub mod town07;
pub mod catalogue;
pub mod scenery;
