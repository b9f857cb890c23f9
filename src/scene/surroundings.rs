//! A whole town as triangles: ground, streets, paint, and what stands beside the streets.

use std::{
    collections::{BTreeMap, HashMap},
    sync::Arc,
};

use glam::{DVec2, Vec3};

use crate::{
    map::road_map::RoadMap,
    scene::{
        buildings,
        driven::Driven,
        furniture, junctions, marks,
        mesh::{Mesh, Vertex},
        streets,
        terrain::{BLOCK_M, Terrain},
        trees,
    },
    towns::scenery::{
        collection::Scenery,
        things::{Kind, Thing},
    },
};

/// Roads are looked for so far from trees and lamps, m.
const NEAR_ROAD_M: f64 = 12.0;

/// A piece of a town with its bounds, world frame, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Tile {
    pub low_m: Vec3,
    pub high_m: Vec3,
    pub mesh: Arc<Mesh>,
}

/// All of a town that stands still, in square tiles of 50 m; a triangle belongs to the tile that
/// its middle lies in. Tiles are in order, from west to east and from south to north.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surroundings {
    pub tiles: Vec<Tile>,
}

impl Surroundings {
    pub fn of(map: &RoadMap, scenery: &Scenery) -> Surroundings {
        let terrain = Terrain::of(map);
        let driven = Driven::of(map);
        let mut mesh = Mesh::default();
        terrain.draw(&mut mesh);
        streets::draw(map, &terrain, &driven, &mut mesh);
        junctions::draw(map, &terrain, &driven, &mut mesh);
        marks::draw(map, &driven, &mut mesh);
        for (number, thing) in scenery.things().iter().enumerate() {
            draw_thing(map, &terrain, thing, number, &mut mesh);
        }
        Surroundings { tiles: tiles(&mesh) }
    }

    /// Triangles of all tiles.
    pub fn triangles(&self) -> usize {
        self.tiles.iter().map(|tile| tile.mesh.triangles.len()).sum()
    }
}

fn draw_thing(map: &RoadMap, terrain: &Terrain, thing: &Thing, number: usize, mesh: &mut Mesh) {
    let centre_m = thing.footprint.centre_m;
    let ground_m = terrain.height_m(centre_m);
    match thing.kind {
        Kind::House | Kind::Block | Kind::Barn => {
            buildings::draw(thing, number, ground_m as f32, mesh);
        }
        Kind::Tree => {
            let free_m = free_m(map, centre_m);
            trees::draw(thing, number, ground_m as f32, free_m as f32, mesh);
        }
        Kind::Lamp => furniture::lamp(thing, ground_m, to_road(map, thing), mesh),
        Kind::Post => furniture::post(thing, ground_m, mesh),
        Kind::Field => furniture::field(thing, terrain, mesh),
        // Streets have kerbs of their own, without joints.
        Kind::Kerb => {}
    }
}

/// From a place to the nearest edge of a lane, m.
fn free_m(map: &RoadMap, place_m: DVec2) -> f64 {
    let near = map.within(place_m, NEAR_ROAD_M);
    let free = near.iter().map(|on_lane| on_lane.distance_m - 0.5 * on_lane.width_m);
    free.fold(NEAR_ROAD_M, f64::min)
}

/// Unit vector across the road, from a thing beside it.
fn to_road(map: &RoadMap, thing: &Thing) -> DVec2 {
    let left = thing.footprint.left();
    let place_m = thing.footprint.centre_m;
    let Some(lane) = map.nearest(place_m) else { return left };
    let road_m = map.centre(lane.lane, lane.s_m).position_m.truncate();
    left * (road_m - place_m).dot(left).signum()
}

/// Places of the corners of a tile by the bits of their coordinates.
type Known = HashMap<[u32; 5], u32>;

/// Triangles by tile; corners that are the same are one.
fn tiles(mesh: &Mesh) -> Vec<Tile> {
    let mut cells: BTreeMap<[i64; 2], (Mesh, Known)> = BTreeMap::new();
    for triangle in &mesh.triangles {
        let corners = triangle.corners.map(|corner| mesh.vertices[corner as usize]);
        let middle = corners.iter().map(|corner| corner.position_m).sum::<Vec3>() / 3.0;
        let cell = [middle.x, middle.y].map(|at| (f64::from(at) / BLOCK_M).floor() as i64);
        let (tile, known) = cells.entry(cell).or_default();
        let corners = corners.map(|vertex| {
            let Vertex { position_m, texture_m } = vertex;
            let key = [position_m.x, position_m.y, position_m.z, texture_m.x, texture_m.y];
            *known.entry(key.map(f32::to_bits)).or_insert_with(|| {
                tile.vertices.push(vertex);
                tile.vertices.len() as u32 - 1
            })
        });
        tile.triangles.push(crate::scene::mesh::Triangle { corners, ..*triangle });
    }
    let filled = cells.into_values().map(|(mesh, _)| mesh);
    let with_bounds = filled.filter_map(|mesh| {
        let (low_m, high_m) = mesh.bounds_m()?;
        Some(Tile { low_m, high_m, mesh: mesh.into() })
    });
    with_bounds.collect()
}
