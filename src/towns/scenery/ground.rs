//! The ground of a map: what is driven and walked on, and what stands there already.

use std::collections::BTreeMap;

use glam::DVec2;
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
    towns::scenery::outline::{bounds_m, hull_m, overlaps},
};

/// Length of the pieces that surfaces are cut into, m.
const PIECE_M: f64 = 2.5;

/// Room that a thing leaves, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// To lanes and side-walks.
    pub roads_m: f64,
    /// To junctions: where one must be able to see.
    pub junctions_m: f64,
    /// To what stands there.
    pub things_m: f64,
}

/// What a place is taken by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Taken {
    Driven,
    Walked,
    Junction,
    Thing,
}

#[derive(Clone, Debug)]
struct Surface {
    taken: Taken,
    /// Convex.
    outline_m: Vec<DVec2>,
}

type Entry = GeomWithData<Rectangle<[f64; 2]>, Surface>;

/// All that is taken, ready to be searched.
#[derive(Clone, Debug)]
pub struct Ground {
    taken: RTree<Entry>,
    /// South-west and north-east corner of all roads, m.
    pub bounds_m: (DVec2, DVec2),
}

impl Ground {
    /// The roads and junctions of a map.
    pub fn new(map: &RoadMap) -> Ground {
        let mut surfaces = Vec::new();
        let mut junctions: BTreeMap<&str, Vec<DVec2>> = BTreeMap::new();
        for road in &map.opendrive().roads {
            let before = surfaces.len();
            (0..road.sections.len()).for_each(|section| add_section(road, section, &mut surfaces));
            // Across medians and verges as well.
            surfaces.extend(road.crosswalks.iter().map(|crosswalk| Surface {
                taken: Taken::Walked,
                outline_m: hull_m(road.crosswalk_m(crosswalk)),
            }));
            if let Some(junction) = &road.junction {
                let corners = surfaces[before..].iter().flat_map(|surface| &surface.outline_m);
                junctions.entry(junction).or_default().extend(corners);
            }
        }
        for corners_m in junctions.into_values() {
            surfaces.push(Surface { taken: Taken::Junction, outline_m: hull_m(corners_m) });
        }
        let corners_m: Vec<DVec2> =
            surfaces.iter().flat_map(|surface| surface.outline_m.clone()).collect();
        let taken = RTree::bulk_load(surfaces.into_iter().map(entry).collect());
        Ground { taken, bounds_m: bounds_m(&corners_m) }
    }

    /// Whether a thing may stand here.
    pub fn is_free(&self, footprint: &Footprint, clearance: &Clearance) -> bool {
        let Clearance { roads_m, junctions_m, things_m } = *clearance;
        let widest_m = roads_m.max(junctions_m).max(things_m);
        self.around(&footprint.grown(widest_m)).all(|surface| {
            let margin_m = match surface.taken {
                Taken::Driven | Taken::Walked => roads_m,
                Taken::Junction => junctions_m,
                Taken::Thing => things_m,
            };
            !overlaps(&footprint.grown(margin_m), &surface.outline_m)
        })
    }

    /// Whether cars drive over some of it.
    pub fn is_driven(&self, footprint: &Footprint) -> bool {
        self.around(footprint).any(|surface| {
            surface.taken == Taken::Driven && overlaps(footprint, &surface.outline_m)
        })
    }

    /// Whether a road lies within `reach_m` of a place, about.
    pub fn has_road_near(&self, place_m: DVec2, reach_m: f64) -> bool {
        let reach = DVec2::splat(reach_m);
        let window = AABB::from_corners((place_m - reach).into(), (place_m + reach).into());
        let mut found = self.taken.locate_in_envelope_intersecting(window);
        found.any(|entry| entry.data.taken != Taken::Thing)
    }

    /// Note a thing that stands from now on.
    pub fn take(&mut self, footprint: &Footprint) {
        let outline_m = footprint.corners_m().to_vec();
        self.taken.insert(entry(Surface { taken: Taken::Thing, outline_m }));
    }

    fn around(&self, footprint: &Footprint) -> impl Iterator<Item = &Surface> {
        let (low_m, high_m) = footprint.bounds_m();
        let window = AABB::from_corners(low_m.into(), high_m.into());
        self.taken.locate_in_envelope_intersecting(window).map(|entry| &entry.data)
    }
}

fn entry(surface: Surface) -> Entry {
    let (low_m, high_m) = bounds_m(&surface.outline_m);
    GeomWithData::new(Rectangle::from_corners(low_m.into(), high_m.into()), surface)
}

/// What people drive or walk on; verges, medians and what has no use are left.
fn taken_by(kind: LaneKind) -> Option<Taken> {
    match kind {
        LaneKind::Driving | LaneKind::Biking | LaneKind::Parking | LaneKind::Shoulder => {
            Some(Taken::Driven)
        }
        LaneKind::Sidewalk | LaneKind::Curb => Some(Taken::Walked),
        LaneKind::Border | LaneKind::Median | LaneKind::Other => None,
    }
}

/// Surfaces of a section: lanes of one kind of use that lie beside each other, piece by piece.
fn add_section(road: &Road, section: usize, surfaces: &mut Vec<Surface>) {
    let lanes = &road.sections[section].lanes;
    for ends_m in steps_m(road, section, PIECE_M).windows(2) {
        let mut index = 0;
        while index < lanes.len() {
            let of = |index: usize| (taken_by(lanes[index].kind), lanes[index].id > 0);
            let mut last = index;
            while last + 1 < lanes.len() && of(last + 1) == of(index) {
                last += 1;
            }
            if let Some(taken) = of(index).0 {
                let edges = |s_m: f64| {
                    let (first, last) =
                        (road.borders(section, index, s_m), road.borders(section, last, s_m));
                    let t_m = [first.inner_t_m, first.outer_t_m, last.inner_t_m, last.outer_t_m];
                    let low_m = t_m.iter().copied().fold(f64::INFINITY, f64::min);
                    let high_m = t_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    [low_m, high_m].map(|t_m| road.place(s_m, t_m).truncate())
                };
                let outline_m = hull_m([edges(ends_m[0]), edges(ends_m[1])].concat());
                if outline_m.len() > 2 {
                    surfaces.push(Surface { taken, outline_m });
                }
            }
            index = last + 1;
        }
    }
}

/// Every `s` at which something begins in a section, and more in between, none further apart
/// than `step_m`.
pub fn steps_m(road: &Road, section: usize, step_m: f64) -> Vec<f64> {
    let mut steps = Vec::new();
    for ends_m in road.breaks_m(section).windows(2) {
        let count = ((ends_m[1] - ends_m[0]) / step_m).ceil().max(1.0);
        let at = |i: u32| ends_m[0] + (ends_m[1] - ends_m[0]) * f64::from(i) / count;
        steps.extend((0..count as u32).map(at));
    }
    steps.extend(road.breaks_m(section).last());
    steps
}
