//! Where cars drive, with heights: what is raised beside one road must not stand on another.

use glam::{DVec2, DVec3};
use rstar::{
    AABB, RTree,
    primitives::{GeomWithData, Rectangle},
};

use crate::{
    footprint::Footprint,
    map::{
        opendrive::{LaneKind, Road},
        road_map::RoadMap,
    },
    scene::course::{Cut, cuts},
    towns::scenery::outline::{bounds_m, hull_m, overlaps},
};

/// Length of the pieces, m.
const PIECE_M: f64 = 5.0;

/// Surfaces that differ by more in height have nothing to do with each other, m.
const LEVEL_M: f64 = 2.0;

#[derive(Clone, Debug)]
struct Surface {
    /// Convex.
    outline_m: Vec<DVec2>,
    height_m: f64,
}

/// All surfaces that cars drive on.
#[derive(Clone, Debug)]
pub struct Driven {
    surfaces: RTree<GeomWithData<Rectangle<[f64; 2]>, Surface>>,
}

/// Whether a lane is part of the carriageway.
pub fn is_carriageway(kind: LaneKind) -> bool {
    matches!(kind, LaneKind::Driving | LaneKind::Biking | LaneKind::Parking | LaneKind::Shoulder)
}

impl Driven {
    pub fn of(map: &RoadMap) -> Driven {
        let mut surfaces = Vec::new();
        for road in &map.opendrive().roads {
            for section in 0..road.sections.len() {
                let cuts = cuts(road, section, PIECE_M);
                for pair in cuts.windows(2) {
                    add_piece(road, section, pair, &mut surfaces);
                }
            }
        }
        let entry = |surface: Surface| {
            let (low_m, high_m) = bounds_m(&surface.outline_m);
            GeomWithData::new(Rectangle::from_corners(low_m.into(), high_m.into()), surface)
        };
        Driven { surfaces: RTree::bulk_load(surfaces.into_iter().map(entry).collect()) }
    }

    /// Convex outlines of what is driven on within a box, counter-clockwise, m.
    pub fn outlines(&self, low_m: DVec3, high_m: DVec3) -> Vec<Vec<DVec2>> {
        let corners = [low_m, high_m].map(|corner| corner.truncate().to_array());
        let window = AABB::from_corners(corners[0], corners[1]);
        let near = self.surfaces.locate_in_envelope_intersecting(window);
        let heights = low_m.z - LEVEL_M..high_m.z + LEVEL_M;
        let level = near.into_iter().filter(|entry| heights.contains(&entry.data.height_m));
        level.map(|entry| entry.data.outline_m.clone()).collect()
    }

    /// Whether cars drive over some of a footprint, at a height.
    pub fn covers(&self, footprint: &Footprint, height_m: f64) -> bool {
        let (low_m, high_m) = footprint.bounds_m();
        let window = AABB::from_corners(low_m.into(), high_m.into());
        let mut near = self.surfaces.locate_in_envelope_intersecting(window);
        near.any(|entry| {
            (entry.data.height_m - height_m).abs() < LEVEL_M
                && overlaps(footprint, &entry.data.outline_m)
        })
    }
}

/// Whether a place lies in a convex outline, given counter-clockwise.
pub fn contains(outline_m: &[DVec2], place_m: DVec2) -> bool {
    (0..outline_m.len()).all(|k| {
        let along = outline_m[(k + 1) % outline_m.len()] - outline_m[k];
        along.perp_dot(place_m - outline_m[k]) >= 0.0
    })
}

/// What cars drive on between two cuts: lanes beside each other at once.
fn add_piece(road: &Road, section: usize, pair: &[Cut], surfaces: &mut Vec<Surface>) {
    let lanes = &road.sections[section].lanes;
    let mut index = 0;
    while index < lanes.len() {
        let first = index;
        while index < lanes.len() && is_carriageway(lanes[index].kind) {
            index += 1;
        }
        if index == first {
            index += 1;
            continue;
        }
        let ends = pair.iter().flat_map(|cut| {
            [first, index].map(|border| cut.place(cut.borders_t_m[border], 0.0).truncate())
        });
        let outline_m = hull_m(ends.collect());
        if outline_m.len() > 2 {
            let height_m = 0.5 * (pair[0].height_m() + pair[1].height_m());
            surfaces.push(Surface { outline_m, height_m });
        }
    }
}
