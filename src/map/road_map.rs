//! A map that was read, with all that is made of it once.

use std::path::Path;

use glam::{DVec2, DVec3};

use crate::{
    error::Result,
    map::{
        graph::{GraphLane, LaneGraph, LaneId},
        index::{LaneIndex, OnLane},
        links::LaneKey,
        opendrive::{OpenDrive, Road},
        reader,
        road::CentrePoint,
    },
};

/// Roads, the lane graph over them, and the search for lanes.
#[derive(Clone, Debug)]
pub struct RoadMap {
    opendrive: OpenDrive,
    graph: LaneGraph,
    index: LaneIndex,
    mended_lane_offsets: usize,
}

impl RoadMap {
    /// Read an OpenDRIVE file.
    ///
    /// # Errors
    ///
    /// As [`reader::read`].
    pub fn read(path: &Path) -> Result<Self> {
        Ok(RoadMap::new(reader::read(path)?))
    }

    pub fn new(mut opendrive: OpenDrive) -> Self {
        let mended_lane_offsets = opendrive.roads.iter_mut().map(Road::mend_lane_offset).sum();
        let graph = LaneGraph::new(&opendrive);
        let index = LaneIndex::new(&opendrive, &graph);
        RoadMap { opendrive, graph, index, mended_lane_offsets }
    }

    pub fn opendrive(&self) -> &OpenDrive {
        &self.opendrive
    }

    pub fn graph(&self) -> &LaneGraph {
        &self.graph
    }

    pub fn lane(&self, id: LaneId) -> &GraphLane {
        &self.graph.lanes()[id]
    }

    /// The road of a lane.
    pub fn road(&self, id: LaneId) -> &Road {
        &self.opendrive.roads[self.lane(id).key.road]
    }

    /// What was mended or left out, with its count, in words; nothing in a sound map.
    pub fn notes(&self) -> Vec<String> {
        let broken = self.graph.broken_links();
        let counts = [
            (
                self.mended_lane_offsets,
                "steps of a lane offset missed the start of their section and were moved there",
            ),
            (
                self.graph.contracted(),
                "driving lanes shorter than half a metre were contracted into those they lead to",
            ),
            (broken.to_roads, "links to roads or junctions that are not in the map were left out"),
            (broken.to_lanes, "links to lanes that are not in the map were left out"),
        ];
        let told = counts.iter().filter(|(count, _)| *count > 0);
        told.map(|(count, what)| format!("{count} {what}")).collect()
    }

    /// The lane nearest to a place, map frame, m; none in a map without driving lanes.
    pub fn nearest(&self, place_m: DVec2) -> Option<OnLane> {
        self.index.nearest(&self.opendrive, &self.graph, place_m)
    }

    /// All lanes whose centre line comes within `radius_m` of a place, nearest first.
    pub fn within(&self, place_m: DVec2, radius_m: f64) -> Vec<OnLane> {
        self.index.within(&self.opendrive, &self.graph, place_m, radius_m)
    }

    /// The centre line of a lane at `s_m` of its road.
    pub fn centre(&self, id: LaneId, s_m: f64) -> CentrePoint {
        self.lane(id).centre(self.road(id), s_m)
    }

    /// Where traffic comes into a lane, map frame, m.
    pub fn entry_m(&self, id: LaneId) -> DVec3 {
        self.centre(id, self.lane(id).entry_m()).position_m
    }

    /// What a lane is called: `road/section/lane`.
    pub fn name(&self, id: LaneId) -> String {
        let LaneKey { road, section, lane } = self.lane(id).key;
        format!("{}/{section}/{lane}", self.opendrive.roads[road].id)
    }

    /// The lanes that `road/section/lane` stands for: one, or those that a contracted one leads
    /// into; none if the map has no such driving lane.
    pub fn find(&self, name: &str) -> Option<&[LaneId]> {
        let mut parts = name.rsplitn(3, '/');
        let lane = parts.next()?.parse().ok()?;
        let section = parts.next()?.parse().ok()?;
        let id = parts.next()?;
        let road = self.opendrive.roads.iter().position(|road| road.id == id)?;
        let found = self.graph.find(LaneKey { road, section, lane });
        (!found.is_empty()).then_some(found)
    }
}
