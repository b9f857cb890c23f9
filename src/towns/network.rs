//! Roads and junctions as OpenDRIVE has them.

use crate::towns::{course::Course, profile::Section};

/// What a road's end is tied to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tie {
    Junction(u32),
    RoadStart(u32),
    RoadEnd(u32),
}

/// Where people cross, over the whole carriageway.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crosswalk {
    /// The middle of it along the road, m.
    pub s_m: f64,
    /// Its kerbs left and right of the reference line, m, positive to the left.
    pub left_m: f64,
    pub right_m: f64,
}

/// A street between two junctions, or a way through one.
#[derive(Clone, Debug, PartialEq)]
pub struct Road {
    pub id: u32,
    pub name: String,
    /// The junction that it lies in.
    pub junction: Option<u32>,
    pub class: &'static str,
    pub limit_kmh: f64,
    pub course: Course,
    /// How far the middle of the lanes lies left of the course, m.
    pub shift_m: f64,
    pub sections: Vec<Section>,
    pub predecessor: Tie,
    pub successor: Tie,
    pub crosswalks: Vec<Crosswalk>,
}

/// A way through a junction: from a road onto one of the junction's own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Connection {
    pub incoming: u32,
    pub connecting: u32,
    /// Lane ids on both.
    pub lanes: Vec<(i32, i32)>,
}

/// A junction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Junction {
    pub id: u32,
    pub connections: Vec<Connection>,
}

/// A town's roads.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    pub name: &'static str,
    pub roads: Vec<Road>,
    pub junctions: Vec<Junction>,
}
