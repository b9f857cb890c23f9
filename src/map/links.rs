//! What each driving lane of a file leads into, by the links that the file gives.

use std::collections::HashMap;

use glam::DVec3;

use crate::map::opendrive::{LaneKind, OpenDrive, RoadLink};

/// Sections shorter than this are degenerate: left-overs of an export, not lanes to drive on, m.
pub const DEGENERATE_M: f64 = 0.5;

/// Lanes without a link are taken to join if their ends are this close, m; only at degenerate
/// sections.
const JOINED_M: f64 = 0.5;

/// A lane of a file: indices of road and section, id of the lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LaneKey {
    pub road: usize,
    pub section: usize,
    pub lane: i32,
}

/// Links that lead nowhere, left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BrokenLinks {
    /// To roads or junctions that the file does not have.
    pub to_roads: usize,
    /// To lanes that their road does not have.
    pub to_lanes: usize,
}

/// The driving lanes of a file and its roads and junctions by id.
pub struct Links<'map> {
    map: &'map OpenDrive,
    roads: HashMap<&'map str, usize>,
    junctions: HashMap<&'map str, usize>,
    broken: BrokenLinks,
}

impl<'map> Links<'map> {
    pub fn new(map: &'map OpenDrive) -> Self {
        let roads = map.roads.iter().enumerate().map(|(i, road)| (road.id.as_str(), i));
        let junctions = map.junctions.iter().enumerate().map(|(i, j)| (j.id.as_str(), i));
        Links {
            map,
            roads: roads.collect(),
            junctions: junctions.collect(),
            broken: BrokenLinks::default(),
        }
    }

    pub fn broken(&self) -> BrokenLinks {
        self.broken
    }

    /// All driving lanes: roads and sections in the order of the file, lanes from left to right.
    pub fn driving_lanes(&self) -> Vec<LaneKey> {
        let mut keys = Vec::new();
        for (road, data) in self.map.roads.iter().enumerate() {
            for (section, data) in data.sections.iter().enumerate() {
                let driving = data.lanes.iter().filter(|lane| lane.kind == LaneKind::Driving);
                keys.extend(driving.map(|lane| LaneKey { road, section, lane: lane.id }));
            }
        }
        keys
    }

    pub fn is_degenerate(&self, key: LaneKey) -> bool {
        let (from_m, to_m) = self.map.roads[key.road].section_range_m(key.section);
        to_m - from_m < DEGENERATE_M
    }

    /// The lanes that traffic in `key` can go on in, ascending; lanes that nobody drives in are
    /// none.
    pub fn successors(&mut self, key: LaneKey) -> Vec<LaneKey> {
        let road = &self.map.roads[key.road];
        let along = road.runs_along_s(key.lane);
        let lane = road.sections[key.section].lane(key.lane);
        let linked = lane.and_then(|lane| if along { lane.successor } else { lane.predecessor });
        let is_last = if along { key.section + 1 == road.sections.len() } else { key.section == 0 };
        let mut next = if is_last {
            self.beyond_road(key, along, linked)
        } else {
            self.next_section(key, along, linked)
        };
        next.retain(|key| {
            let lane = self.map.roads[key.road].sections[key.section].lane(key.lane);
            lane.is_some_and(|lane| lane.kind == LaneKind::Driving)
        });
        next.sort_unstable();
        next.dedup();
        next
    }

    fn next_section(&mut self, key: LaneKey, along: bool, linked: Option<i32>) -> Vec<LaneKey> {
        let road = &self.map.roads[key.road];
        let Some(lane) = linked else {
            let section = if along { key.section + 1 } else { key.section - 1 };
            return self.joined(key, key.road, section);
        };
        // Sections without the lane are passed over: exports split them off for other lanes.
        let has_lane = |section: &usize| road.sections[*section].lane(lane).is_some();
        let section = if along {
            (key.section + 1..road.sections.len()).find(has_lane)
        } else {
            (0..key.section).rev().find(has_lane)
        };
        self.broken.to_lanes += usize::from(section.is_none());
        section.map(|section| LaneKey { section, lane, ..key }).into_iter().collect()
    }

    fn beyond_road(&mut self, key: LaneKey, along: bool, linked: Option<i32>) -> Vec<LaneKey> {
        let road = &self.map.roads[key.road];
        match if along { &road.successor } else { &road.predecessor } {
            None => Vec::new(),
            Some(RoadLink::Road(id)) => match (self.roads.get(id.as_str()).copied(), linked) {
                (None, _) => {
                    self.broken.to_roads += 1;
                    Vec::new()
                }
                (Some(next), Some(lane)) => self.entered(next, lane).into_iter().collect(),
                (Some(next), None) => {
                    let last = self.map.roads[next].sections.len() - 1;
                    let mut joined = self.joined(key, next, 0);
                    joined.extend(self.joined(key, next, last));
                    joined
                }
            },
            Some(RoadLink::Junction(id)) => {
                let Some(junction) = self.junctions.get(id.as_str()) else {
                    self.broken.to_roads += 1;
                    return Vec::new();
                };
                let mut next = Vec::new();
                for connection in &self.map.junctions[*junction].connections {
                    let from_here = connection.lane_links.iter().filter(|(from, _)| {
                        connection.incoming_road == road.id && *from == key.lane
                    });
                    for (_, to) in from_here {
                        match self.roads.get(connection.connecting_road.as_str()).copied() {
                            Some(road) => next.extend(self.entered(road, *to)),
                            None => self.broken.to_roads += 1,
                        }
                    }
                }
                next
            }
        }
    }

    /// The lane of a road at the end at which its traffic enters.
    fn entered(&mut self, road: usize, lane: i32) -> Option<LaneKey> {
        let data = &self.map.roads[road];
        let has_lane = |section: &usize| data.sections[*section].lane(lane).is_some();
        let section = if data.runs_along_s(lane) {
            (0..data.sections.len()).find(has_lane)
        } else {
            (0..data.sections.len()).rev().find(has_lane)
        };
        self.broken.to_lanes += usize::from(section.is_none());
        section.map(|section| LaneKey { road, section, lane })
    }

    /// Lanes of a section that begin where `key` ends, if one of the two is degenerate.
    fn joined(&self, key: LaneKey, road: usize, section: usize) -> Vec<LaneKey> {
        let lanes = &self.map.roads[road].sections[section].lanes;
        let keys = lanes.iter().map(|lane| LaneKey { road, section, lane: lane.id });
        keys.filter(|next| *next != key && (self.is_degenerate(key) || self.is_degenerate(*next)))
            .filter(|next| {
                let (end, start) = (self.end_m(key, false), self.end_m(*next, true));
                end.zip(start).is_some_and(|(end, start)| end.distance(start) < JOINED_M)
            })
            .collect()
    }

    /// Where traffic in a lane comes in or goes out, map frame, m.
    fn end_m(&self, key: LaneKey, coming_in: bool) -> Option<DVec3> {
        let road = &self.map.roads[key.road];
        let (from_m, to_m) = road.section_range_m(key.section);
        let s_m = if road.runs_along_s(key.lane) == coming_in { from_m } else { to_m };
        let index = road.sections[key.section].index_of(key.lane)?;
        Some(road.centre(key.section, index, s_m).position_m)
    }
}
