//! What stands for ever: buildings, trees, poles; and which of it is near.

use std::collections::BTreeMap;

use glam::DVec2;

use crate::world::footprint::Footprint;

/// Side of a cell, m.
const CELL_M: f64 = 16.0;

/// Footprints of all that stands, by cells of the ground.
#[derive(Clone, Debug, Default)]
pub struct Obstacles {
    footprints: Vec<Footprint>,
    /// Indices of those that reach into a cell.
    cells: BTreeMap<(i64, i64), Vec<usize>>,
}

impl Obstacles {
    pub fn new(footprints: Vec<Footprint>) -> Obstacles {
        let mut cells: BTreeMap<(i64, i64), Vec<usize>> = BTreeMap::new();
        for (index, footprint) in footprints.iter().enumerate() {
            let corners = footprint.corners_m();
            let low = corners.iter().copied().fold(DVec2::INFINITY, DVec2::min);
            let high = corners.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
            for x in cell(low.x)..=cell(high.x) {
                for y in cell(low.y)..=cell(high.y) {
                    cells.entry((x, y)).or_default().push(index);
                }
            }
        }
        Obstacles { footprints, cells }
    }

    pub fn len(&self) -> usize {
        self.footprints.len()
    }

    pub fn is_empty(&self) -> bool {
        self.footprints.is_empty()
    }

    /// The first obstacle that a footprint touches.
    pub fn touched_by(&self, footprint: &Footprint) -> Option<&Footprint> {
        let reach_m = DVec2::splat(footprint.radius_m());
        let (low, high) = (footprint.centre_m - reach_m, footprint.centre_m + reach_m);
        let columns = cell(low.x)..=cell(high.x);
        let mut near = columns.flat_map(|x| (cell(low.y)..=cell(high.y)).map(move |y| (x, y)));
        near.find_map(|at| {
            let here = self.cells.get(&at)?.iter().map(|index| &self.footprints[*index]);
            here.into_iter().find(|obstacle| obstacle.touches(footprint))
        })
    }
}

fn cell(value_m: f64) -> i64 {
    (value_m / CELL_M).floor() as i64
}
