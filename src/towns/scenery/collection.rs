//! The whole scenery of a map, in one list that can be searched.

use glam::DVec2;
use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use crate::{
    footprint::Footprint,
    map::road_map::RoadMap,
    towns::scenery::{
        buildings, furniture, ground::Ground, planting, roadside::Roadside, things::Thing,
    },
};

/// All that stands beside the roads of a map.
#[derive(Clone, Debug)]
pub struct Scenery {
    things: Vec<Thing>,
    index: RTree<GeomWithData<Rectangle<[f64; 2]>, usize>>,
}

impl Scenery {
    /// The scenery of a map. The same map and seed give the same things in the same order.
    pub fn derive(map: &RoadMap, seed: u64) -> Scenery {
        let mut ground = Ground::new(map);
        let mut things = Vec::new();
        let sides = Roadside::all(map);
        furniture::kerbs(map, &ground, &mut things);
        sides.iter().for_each(|side| furniture::along(side, seed, &mut ground, &mut things));
        sides.iter().for_each(|side| buildings::along(side, seed, &mut ground, &mut things));
        sides.iter().for_each(|side| planting::fields(side, seed, &mut ground, &mut things));
        planting::trees(seed, &mut ground, &mut things);
        let boxes = things.iter().enumerate().map(|(i, thing)| {
            let (low_m, high_m) = thing.footprint.bounds_m();
            GeomWithData::new(Rectangle::from_corners(low_m.into(), high_m.into()), i)
        });
        Scenery { index: RTree::bulk_load(boxes.collect()), things }
    }

    /// All things.
    pub fn things(&self) -> &[Thing] {
        &self.things
    }

    /// The first thing that stops a car and is touched by a footprint.
    pub fn touched_by(&self, footprint: &Footprint) -> Option<&Thing> {
        let (low_m, high_m) = footprint.bounds_m();
        let near = self.within(low_m, high_m).into_iter().map(|index| &self.things[index]);
        near.into_iter()
            .find(|thing| thing.kind.is_obstacle() && thing.footprint.touches(footprint))
    }

    /// Indices of the things whose bounds come within a box of the map, given by its south-west
    /// and north-east corner (m), ascending.
    pub fn within(&self, low_m: DVec2, high_m: DVec2) -> Vec<usize> {
        let window = AABB::from_corners(low_m.into(), high_m.into());
        let found = self.index.locate_in_envelope_intersecting(window);
        let mut indices: Vec<usize> = found.map(|entry| entry.data).collect();
        indices.sort_unstable();
        indices
    }
}
