//! Roadsides: one side of a stretch of road, seen from its edge outwards.

use glam::DVec2;
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use crate::map::{
    opendrive::{LaneKind, Road},
    road_map::RoadMap,
};

/// Limits from here on are those of motorways, m/s (75 km/h).
const MOTORWAY_MPS: f64 = 75.0 / 3.6;

/// What a roadside is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Character {
    /// A side-walk lies there.
    Town,
    /// No side-walk on either side.
    Country,
    /// No side-walk, and fast or one-way: motorways and their ramps.
    Motorway,
    /// A side-walk only on the other side: the inside of a ring.
    Bare,
}

/// One side of one section of a road outside junctions.
#[derive(Clone, Copy, Debug)]
pub struct Roadside<'map> {
    pub road: &'map Road,
    pub section: usize,
    pub is_left: bool,
    pub character: Character,
    /// Driving lanes of the section, in both directions.
    pub lanes: usize,
    stream: u64,
}

/// What a stream of random numbers is for.
#[derive(Clone, Copy, Debug)]
pub enum Purpose {
    Furniture,
    Buildings,
    Planting,
}

impl<'map> Roadside<'map> {
    /// All roadsides of a map, in the order of the file.
    pub fn all(map: &'map RoadMap) -> Vec<Roadside<'map>> {
        let mut all = Vec::new();
        for (number, road) in map.opendrive().roads.iter().enumerate() {
            if road.junction.is_some() {
                continue;
            }
            for section in 0..road.sections.len() {
                for is_left in [false, true] {
                    let stream = (number as u64) << 32 | (section as u64) << 8 | u64::from(is_left);
                    all.push(Roadside::new(road, section, is_left, stream));
                }
            }
        }
        all
    }

    fn new(road: &'map Road, section: usize, is_left: bool, stream: u64) -> Self {
        let lanes = &road.sections[section].lanes;
        let is_walked = |is_left: bool| {
            lanes.iter().any(|lane| lane.kind == LaneKind::Sidewalk && (lane.id > 0) == is_left)
        };
        let driving = lanes.iter().filter(|lane| lane.kind == LaneKind::Driving);
        let (from_m, _) = road.section_range_m(section);
        let limit_mps = road.speed_limit_mps(section, 0, from_m);
        let is_driven = |is_left: bool| driving.clone().any(|lane| (lane.id > 0) == is_left);
        let is_fast = limit_mps.is_some_and(|mps| mps > MOTORWAY_MPS);
        let is_one_way = !(is_driven(true) && is_driven(false));
        let character = match (is_walked(is_left), is_walked(!is_left)) {
            (true, _) => Character::Town,
            (false, false) if is_fast || is_one_way => Character::Motorway,
            (false, true) => Character::Bare,
            (false, false) => Character::Country,
        };
        Roadside { road, section, is_left, character, lanes: driving.count(), stream }
    }

    /// The random numbers of this roadside.
    pub fn noise(&self, seed: u64, purpose: Purpose) -> ChaCha8Rng {
        let mut noise = ChaCha8Rng::seed_from_u64(seed);
        noise.set_stream(self.stream << 2 | purpose as u64);
        noise
    }

    /// Where it begins and ends, m of the road's `s`.
    pub fn range_m(&self) -> (f64, f64) {
        self.road.section_range_m(self.section)
    }

    /// Direction of the road, rad.
    pub fn heading_rad(&self, s_m: f64) -> f64 {
        self.road.reference_line.at(s_m).heading_rad
    }

    /// A place `out_m` outside of the outermost lane.
    pub fn beyond_m(&self, s_m: f64, out_m: f64) -> DVec2 {
        let lanes = &self.road.sections[self.section].lanes;
        let outermost = lanes
            .iter()
            .enumerate()
            .filter(|(_, lane)| (lane.id > 0) == self.is_left && lane.kind != LaneKind::Other);
        let middle_m = self.road.lane_offset.at(s_m);
        let edge_m = outermost
            .map(|(index, _)| self.road.borders(self.section, index, s_m).outer_t_m)
            .fold(middle_m, if self.is_left { f64::max } else { f64::min });
        self.road.place(s_m, edge_m + self.outwards() * out_m).truncate()
    }

    /// The sign of `t` on this side.
    pub fn outwards(&self) -> f64 {
        if self.is_left { 1.0 } else { -1.0 }
    }

    /// The lanes of this side by their place in the section, from the middle outwards.
    pub fn own_lanes(&self) -> Vec<usize> {
        let lanes = &self.road.sections[self.section].lanes;
        let mut own: Vec<usize> =
            (0..lanes.len()).filter(|index| (lanes[*index].id > 0) == self.is_left).collect();
        own.sort_by_key(|index| lanes[*index].id.abs());
        own
    }
}
