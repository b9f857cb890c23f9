//! The ground between and around the roads, as a grid of heights.
//!
//! It lies a little below the roads that lead over it. Where one road leads over another, the
//! ground follows the lower one, and the upper one is a bridge.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3, Vec3};
use rstar::{RTree, primitives::GeomWithData};

use crate::{
    map::road_map::RoadMap,
    scene::{
        course::{Cut, cuts},
        mesh::{Material, Mesh},
        solids::{Paint, paint},
    },
};

/// The ground reaches so far beyond the roads, m.
const BEYOND_M: f64 = 300.0;

/// Sides of the cells of the grid, and of the blocks that are drawn at once where they are even, m.
const CELL_M: f64 = 10.0;
const CELLS: usize = 5;
pub const BLOCK_M: f64 = CELL_M * CELLS as f64;

/// The ground lies so far below the roads, m.
const BELOW_M: f64 = 0.08;

/// A road with another one so far below it, and so near, is a bridge, m.
const BRIDGE_M: f64 = 2.5;
const NEAR_M: f64 = 14.0;

/// Distance between the places at which roads are measured, m.
const SAMPLE_M: f64 = 4.0;

/// Roads that have a say in the height of a place: the nearest places on them.
const VOICES: usize = 10;

/// A block whose heights differ from a plane by less is drawn as one, m.
const EVEN_M: f64 = 0.03;

/// Of what grows everywhere.
pub const GRASS: Paint = paint(Material::Grass, [104, 128, 72]);

/// Heights of the ground.
#[derive(Clone, Debug)]
pub struct Terrain {
    low_m: DVec2,
    /// Corners of cells across and up.
    columns: usize,
    rows: usize,
    /// Row by row from the south-west.
    heights_m: Vec<f64>,
    /// All roads lie at one height.
    pub is_flat: bool,
}

impl Terrain {
    pub fn of(map: &RoadMap) -> Terrain {
        let samples_m = samples_m(map);
        let low = samples_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = samples_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        if samples_m.is_empty() {
            let heights_m = vec![0.0; 4];
            return Terrain { low_m: DVec2::ZERO, columns: 2, rows: 2, heights_m, is_flat: true };
        }
        // Blocks begin at whole multiples, so that tiles hold whole blocks.
        let low_m = ((low.truncate() - BEYOND_M) / BLOCK_M).floor() * BLOCK_M;
        let blocks = ((high.truncate() + BEYOND_M - low_m) / BLOCK_M).ceil();
        let [columns, rows] = blocks.to_array().map(|count| count as usize * CELLS + 1);
        let is_flat = high.z - low.z < 0.01;
        let mut terrain = Terrain {
            low_m,
            columns,
            rows,
            heights_m: vec![low.z - BELOW_M; columns * rows],
            is_flat,
        };
        if !is_flat {
            terrain.follow(&samples_m);
        }
        terrain
    }

    /// Height of the ground at a place, m.
    pub fn height_m(&self, place_m: DVec2) -> f64 {
        self.weights(place_m)
            .into_iter()
            .map(|(corner, weight)| self.heights_m[corner] * weight)
            .sum()
    }

    /// The three corners of the triangle that a place lies in, with their weights.
    fn weights(&self, place_m: DVec2) -> [(usize, f64); 3] {
        let most = DVec2::new((self.columns - 1) as f64, (self.rows - 1) as f64);
        let at = ((place_m - self.low_m) / CELL_M).clamp(DVec2::ZERO, most - 1e-9);
        let (cell, within) = (at.floor(), at - at.floor());
        let corner = cell.y as usize * self.columns + cell.x as usize;
        let (east, north, opposite) =
            (corner + 1, corner + self.columns, corner + self.columns + 1);
        // Cells are cut from south-west to north-east.
        match within.x >= within.y {
            true => [(corner, 1.0 - within.x), (east, within.x - within.y), (opposite, within.y)],
            false => [(corner, 1.0 - within.y), (north, within.y - within.x), (opposite, within.x)],
        }
    }

    /// Lay the ground below the roads.
    fn follow(&mut self, samples_m: &[DVec3]) {
        let all = tree(samples_m.iter().copied());
        let is_bridge = |sample: &DVec3| {
            let near = all.locate_within_distance(sample.truncate().to_array(), NEAR_M * NEAR_M);
            near.into_iter().any(|other| other.data < sample.z - BRIDGE_M)
        };
        let grounded: Vec<DVec3> =
            samples_m.iter().filter(|sample| !is_bridge(sample)).copied().collect();
        let voices = tree(grounded.iter().copied());
        for row in 0..self.rows {
            for column in 0..self.columns {
                let place_m = self.low_m + CELL_M * DVec2::new(column as f64, row as f64);
                let nearest = voices.nearest_neighbor_iter_with_distance_2(place_m.to_array());
                let (mut sum, mut weights) = (0.0, 0.0);
                for (sample, distance2) in nearest.take(VOICES) {
                    let weight = 1.0 / (distance2 + 1.0);
                    sum += weight * sample.data;
                    weights += weight;
                }
                self.heights_m[row * self.columns + column] = sum / weights - BELOW_M;
            }
        }
        // What still stands above a road is lowered.
        const ROUNDS: usize = 3;
        for _ in 0..ROUNDS {
            for sample in samples_m {
                let corners = self.weights(sample.truncate());
                let excess_m = self.height_m(sample.truncate()) - (sample.z - BELOW_M);
                if excess_m > 0.0 {
                    corners.iter().for_each(|(corner, _)| self.heights_m[*corner] -= excess_m);
                }
            }
        }
    }

    /// The ground as triangles: blocks that are even in two, others cell by cell.
    pub fn draw(&self, mesh: &mut Mesh) {
        let (blocks_x, blocks_y) = ((self.columns - 1) / CELLS, (self.rows - 1) / CELLS);
        let mut is_even = BTreeMap::new();
        for (x, y) in (0..blocks_y).flat_map(|y| (0..blocks_x).map(move |x| (x, y))) {
            is_even.insert((x as i64, y as i64), self.is_even(x, y));
        }
        for (&(x, y), &even) in &is_even {
            let (column, row) = (x as usize * CELLS, y as usize * CELLS);
            let neighbours = [(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)];
            let is_smooth = |block: &(i64, i64)| is_even.get(block).copied().unwrap_or(true);
            if !even {
                self.draw_cells(column, row, mesh);
            } else if neighbours.iter().all(is_smooth) {
                let outline = [(0, 0), (CELLS, 0), (CELLS, CELLS), (0, CELLS)];
                let outline = outline.map(|(i, j)| self.corner_m(column + i, row + j));
                mesh.ground_face(&outline, GRASS);
            } else {
                self.draw_fan(column, row, mesh);
            }
        }
    }

    fn corner_m(&self, column: usize, row: usize) -> Vec3 {
        let place_m = self.low_m + CELL_M * DVec2::new(column as f64, row as f64);
        place_m.extend(self.heights_m[row * self.columns + column]).as_vec3()
    }

    fn is_even(&self, x: usize, y: usize) -> bool {
        let corner = |i: usize, j: usize| f64::from(self.corner_m(x * CELLS + i, y * CELLS + j).z);
        let ends = [corner(0, 0), corner(CELLS, 0), corner(0, CELLS), corner(CELLS, CELLS)];
        (0..=CELLS).flat_map(|i| (0..=CELLS).map(move |j| (i, j))).all(|(i, j)| {
            let share = |k: usize| k as f64 / CELLS as f64;
            let south = ends[0] + (ends[1] - ends[0]) * share(i);
            let north = ends[2] + (ends[3] - ends[2]) * share(i);
            (south + (north - south) * share(j) - corner(i, j)).abs() < EVEN_M
        })
    }

    fn draw_cells(&self, column: usize, row: usize, mesh: &mut Mesh) {
        for (i, j) in (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| (column + i, row + j))) {
            let outline = [(0, 0), (1, 0), (1, 1), (0, 1)];
            let outline = outline.map(|(di, dj)| self.corner_m(i + di, j + dj));
            mesh.ground_face(&outline, GRASS);
        }
    }

    /// An even block beside one that is not: its edge has all corners of the cells, without gaps.
    fn draw_fan(&self, column: usize, row: usize, mesh: &mut Mesh) {
        let edge = (0..CELLS).map(|k| (k, 0));
        let edge = edge.chain((0..CELLS).map(|k| (CELLS, k)));
        let edge = edge.chain((0..CELLS).map(|k| (CELLS - k, CELLS)));
        let edge = edge.chain((0..CELLS).map(|k| (0, CELLS - k)));
        let edge: Vec<Vec3> = edge.map(|(i, j)| self.corner_m(column + i, row + j)).collect();
        let middle = 0.5 * (edge[0] + edge[2 * CELLS]);
        for (k, corner) in edge.iter().enumerate() {
            mesh.ground_face(&[middle, *corner, edge[(k + 1) % edge.len()]], GRASS);
        }
    }
}

fn tree(samples_m: impl Iterator<Item = DVec3>) -> RTree<GeomWithData<[f64; 2], f64>> {
    let points = samples_m.map(|sample| GeomWithData::new(sample.truncate().to_array(), sample.z));
    RTree::bulk_load(points.collect())
}

/// Places all over the roads, world frame, m.
fn samples_m(map: &RoadMap) -> Vec<DVec3> {
    let mut samples = Vec::new();
    for road in &map.opendrive().roads {
        for section in 0..road.sections.len() {
            let cuts = cuts(road, section, SAMPLE_M);
            cuts.iter().for_each(|cut| add_across(cut, &mut samples));
        }
    }
    samples
}

fn add_across(cut: &Cut, samples: &mut Vec<DVec3>) {
    let (Some(left_m), Some(right_m)) = (cut.borders_t_m.first(), cut.borders_t_m.last()) else {
        return;
    };
    let steps = ((left_m - right_m).abs() / SAMPLE_M).ceil().max(1.0);
    for step in 0..=steps as usize {
        samples.push(cut.place(left_m + (right_m - left_m) * step as f64 / steps, 0.0));
    }
}
