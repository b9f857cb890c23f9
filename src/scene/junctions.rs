//! Asphalt between the ways through a junction: no grass grows where nobody drives but everybody
//! might.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use crate::{
    map::road_map::RoadMap,
    scene::{
        course::cuts,
        driven::{Driven, contains},
        mesh::Mesh,
        streets::ASPHALT,
        terrain::Terrain,
    },
};

/// Side of the cells that are paved or left, m.
const CELL_M: f64 = 1.0;

/// What is paved lies above the ground by so much, and so below all roads, m.
const ABOVE_GROUND_M: f64 = 0.05;

/// A place is between roads if one lies within so many cells in most of eight directions.
const REACH: i64 = 12;
const MOST: usize = 7;
const DIRECTIONS: [(i64, i64); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// Distance between the places by which a junction's extent is known, m.
const SAMPLE_M: f64 = 5.0;

/// Pave all junctions of a map.
pub fn draw(map: &RoadMap, terrain: &Terrain, driven: &Driven, mesh: &mut Mesh) {
    let mut extents: BTreeMap<&str, (DVec3, DVec3)> = BTreeMap::new();
    for road in &map.opendrive().roads {
        let Some(junction) = &road.junction else { continue };
        let extent = extents.entry(junction).or_insert((DVec3::INFINITY, DVec3::NEG_INFINITY));
        for section in 0..road.sections.len() {
            for cut in cuts(road, section, SAMPLE_M) {
                for t_m in cut.borders_t_m.iter().copied() {
                    let place = cut.place(t_m, 0.0);
                    *extent = (extent.0.min(place), extent.1.max(place));
                }
            }
        }
    }
    for (low_m, high_m) in extents.into_values() {
        Cells::within(low_m, high_m, driven).draw(terrain, mesh);
    }
}

/// The cells of a junction, row by row.
struct Cells {
    low_m: DVec2,
    columns: i64,
    rows: i64,
    /// Whether roads cover the middle, and the whole cell as far as its corners tell.
    is_met: Vec<bool>,
    is_full: Vec<bool>,
}

impl Cells {
    fn within(low_m: DVec3, high_m: DVec3, driven: &Driven) -> Cells {
        let corner_m = (low_m.truncate() / CELL_M).floor() * CELL_M;
        let size = ((high_m.truncate() - corner_m) / CELL_M).ceil();
        let (columns, rows) = (size.x.max(0.0) as i64, size.y.max(0.0) as i64);
        let count = (columns * rows) as usize;
        let mut cells = Cells {
            low_m: corner_m,
            columns,
            rows,
            is_met: vec![false; count],
            is_full: vec![false; count],
        };
        // Four corners and the middle, one bit each.
        let mut met = vec![0_u8; count];
        for outline_m in driven.outlines(low_m, high_m) {
            cells.meet(&outline_m, &mut met);
        }
        for (cell, met) in met.into_iter().enumerate() {
            cells.is_met[cell] = met & 1 != 0;
            cells.is_full[cell] = met == 0b11111;
        }
        cells
    }

    fn meet(&self, outline_m: &[DVec2], met: &mut [u8]) {
        const PLACES: [DVec2; 5] = [
            DVec2::new(0.5, 0.5),
            DVec2::new(0.0, 0.0),
            DVec2::new(1.0, 0.0),
            DVec2::new(0.0, 1.0),
            DVec2::new(1.0, 1.0),
        ];
        let low = outline_m.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = outline_m.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let first = ((low - self.low_m) / CELL_M).floor().max(DVec2::ZERO);
        let last = ((high - self.low_m) / CELL_M).floor();
        for row in first.y as i64..=(last.y as i64).min(self.rows - 1) {
            for column in first.x as i64..=(last.x as i64).min(self.columns - 1) {
                let corner = DVec2::new(column as f64, row as f64);
                for (bit, place) in PLACES.iter().enumerate() {
                    let place_m = self.low_m + CELL_M * (corner + *place);
                    if contains(outline_m, place_m) {
                        met[(row * self.columns + column) as usize] |= 1 << bit;
                    }
                }
            }
        }
    }

    fn index(&self, column: i64, row: i64) -> Option<usize> {
        let is_inside = (0..self.columns).contains(&column) && (0..self.rows).contains(&row);
        is_inside.then_some((row * self.columns + column) as usize)
    }

    /// Whether a cell lies between roads and has something left to pave.
    fn is_between(&self, column: i64, row: i64) -> bool {
        let own = self.index(column, row);
        if own.is_none_or(|own| self.is_full[own]) {
            return false;
        }
        let meets = |(dx, dy): &(i64, i64)| {
            (1..=REACH).any(|step| {
                let cell = self.index(column + step * dx, row + step * dy);
                cell.is_some_and(|cell| self.is_met[cell])
            })
        };
        DIRECTIONS.iter().filter(|direction| meets(direction)).count() >= MOST
    }

    /// Cells that are to be paved, joined along the rows.
    fn draw(&self, terrain: &Terrain, mesh: &mut Mesh) {
        let corner = |column: i64, row: i64| {
            let place_m = self.low_m + CELL_M * DVec2::new(column as f64, row as f64);
            place_m.extend(terrain.height_m(place_m) + ABOVE_GROUND_M).as_vec3()
        };
        for row in 0..self.rows {
            let mut column = 0;
            while column < self.columns {
                let first = column;
                while self.is_between(column, row) {
                    column += 1;
                }
                if column > first {
                    let outline = [
                        corner(first, row),
                        corner(column, row),
                        corner(column, row + 1),
                        corner(first, row + 1),
                    ];
                    mesh.ground_face(&outline, ASPHALT);
                }
                column += 1;
            }
        }
    }
}
