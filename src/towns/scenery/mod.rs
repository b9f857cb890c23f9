//! What stands beside the roads of any map: buildings, trees, lamps, posts, kerbs, fields.
//!
//! Derived from the map and a seed, as plain boxes with an index. Nothing stands on what is
//! driven or walked on, nor within a junction. Every stretch of road draws from a stream of
//! random numbers of its own, so that a road added elsewhere changes nothing here.

pub mod footprint;
pub mod things;
pub mod ground;
pub mod roadside;
pub mod furniture;
pub mod buildings;
pub mod planting;

use glam::DVec2;
use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use crate::{
    map::road_map::RoadMap,
    towns::scenery::{ground::Ground, roadside::Roadside, things::Thing},
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
