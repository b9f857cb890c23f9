//! What an OpenDRIVE file says, as far as pmp uses it; names and signs are the standard's.
//!
//! ASAM OpenDRIVE 1.4 to 1.8. Lanes have ids: 0 is the line between the directions, positive ids
//! count to the left, negative ones to the right.

use crate::map::{profile::Profile, reference_line::ReferenceLine};

/// A file, in its order.
#[derive(Clone, Debug)]
pub struct OpenDrive {
    pub roads: Vec<Road>,
    pub junctions: Vec<Junction>,
}

#[derive(Clone, Debug)]
pub struct Road {
    pub id: String,
    pub length_m: f64,
    /// The junction that this road leads through.
    pub junction: Option<String>,
    /// Traffic keeps left (`rule="LHT"`).
    pub left_hand: bool,
    pub predecessor: Option<RoadLink>,
    pub successor: Option<RoadLink>,
    pub speed_limits: Vec<SpeedLimit>,
    pub reference_line: ReferenceLine,
    pub elevation: Profile,
    pub lane_offset: Profile,
    /// Ascending in `s_m`; of sections with one `s`, all but the last have no length.
    pub sections: Vec<Section>,
    pub crosswalks: Vec<Crosswalk>,
}

/// What a road leads into.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RoadLink {
    Road(String),
    Junction(String),
}

/// A limit from `s_m` on; none where the file sets no limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedLimit {
    pub s_m: f64,
    pub limit_mps: Option<f64>,
}

#[derive(Clone, Debug)]
pub struct Section {
    pub s_m: f64,
    /// From left to right: ids descend, without lane 0.
    pub lanes: Vec<Lane>,
    /// Marks of the line between the directions.
    pub centre_marks: Vec<RoadMark>,
}

impl Section {
    /// The place of a lane in `lanes`.
    pub fn index_of(&self, id: i32) -> Option<usize> {
        self.lanes.iter().position(|lane| lane.id == id)
    }

    pub fn lane(&self, id: i32) -> Option<&Lane> {
        self.index_of(id).map(|index| &self.lanes[index])
    }

    /// Marks on the border between `id` and its outer neighbour; of lane 0, the middle ones.
    pub fn marks(&self, id: i32) -> &[RoadMark] {
        match self.lane(id) {
            Some(lane) => &lane.marks,
            None if id == 0 => &self.centre_marks,
            None => &[],
        }
    }
}

#[derive(Clone, Debug)]
pub struct Lane {
    pub id: i32,
    pub kind: LaneKind,
    /// Over the distance from the start of the section, m.
    pub width: Profile,
    /// Id of the lane before, in the direction of `s`.
    pub predecessor: Option<i32>,
    /// Id of the lane after, in the direction of `s`.
    pub successor: Option<i32>,
    /// Marks of the outer border, by the distance from the start of the section.
    pub marks: Vec<RoadMark>,
    /// Limits of this lane, by the distance from the start of the section.
    pub speed_limits: Vec<SpeedLimit>,
}

/// What a lane is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaneKind {
    Driving,
    Sidewalk,
    Shoulder,
    Border,
    Biking,
    Parking,
    Median,
    Curb,
    /// Anything else that lies there: `none`, `restricted`, `rail`, ...
    Other,
}

impl LaneKind {
    /// The kind that a file names; unknown names are [`LaneKind::Other`].
    pub fn from_name(name: &str) -> Self {
        match name.to_ascii_lowercase().as_str() {
            "driving" => LaneKind::Driving,
            "sidewalk" | "walking" => LaneKind::Sidewalk,
            "shoulder" | "stop" => LaneKind::Shoulder,
            "border" => LaneKind::Border,
            "biking" => LaneKind::Biking,
            "parking" => LaneKind::Parking,
            "median" => LaneKind::Median,
            "curb" => LaneKind::Curb,
            _ => LaneKind::Other,
        }
    }
}

/// A line on the road, from `start_m` after the start of its section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoadMark {
    pub start_m: f64,
    pub kind: MarkKind,
    pub yellow: bool,
    pub width_m: f64,
    pub change: LaneChange,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkKind {
    None,
    Solid,
    Broken,
    /// Two lines, from the middle of the road outwards, each broken or not.
    Double {
        inner_broken: bool,
        outer_broken: bool,
    },
    Curb,
}

impl MarkKind {
    /// The kind that a file names; what is no line on the asphalt is [`MarkKind::None`].
    pub fn from_name(name: &str) -> Self {
        let double = |inner_broken, outer_broken| MarkKind::Double { inner_broken, outer_broken };
        match name.to_ascii_lowercase().as_str() {
            "solid" | "botts dots" => MarkKind::Solid,
            "broken" => MarkKind::Broken,
            "solid solid" => double(false, false),
            "solid broken" => double(false, true),
            "broken solid" => double(true, false),
            "broken broken" => double(true, true),
            "curb" => MarkKind::Curb,
            _ => MarkKind::None,
        }
    }
}

/// Across a mark, lanes may be changed towards higher ids, lower ids, both or not at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LaneChange {
    Increase,
    Decrease,
    Both,
    None,
}

impl LaneChange {
    pub fn allows(self, to_higher_id: bool) -> bool {
        match self {
            LaneChange::Both => true,
            LaneChange::Increase => to_higher_id,
            LaneChange::Decrease => !to_higher_id,
            LaneChange::None => false,
        }
    }
}

#[derive(Clone, Debug)]
pub struct Junction {
    pub id: String,
    pub connections: Vec<Connection>,
}

/// Ways from the end of an incoming road onto a connecting road.
#[derive(Clone, Debug)]
pub struct Connection {
    pub incoming_road: String,
    pub connecting_road: String,
    /// Ids of an incoming lane and of the lane that it leads into.
    pub lane_links: Vec<(i32, i32)>,
}

/// A place to cross, as an outline.
#[derive(Clone, Debug)]
pub struct Crosswalk {
    pub s_m: f64,
    pub t_m: f64,
    /// Of the object's u axis, from the direction of the road, rad.
    pub heading_rad: f64,
    /// Corners in the object's axes, m.
    pub corners_m: Vec<[f64; 2]>,
}
