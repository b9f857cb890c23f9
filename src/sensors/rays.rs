//! What a sensor can reach, and what its rays meet first: trees of boxes over the triangles of a
//! town, and over those of all that moves.
//!
//! The tree of a town is built once, with time spent on its quality. What moves is few triangles,
//! and of those only the bodies near a sensor count, so their tree is built anew at every instant.

use std::{f32::consts::PI, time::Duration};

use glam::{Affine3A, Vec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    bvh2::{Bvh2, builder::build_bvh2_from_tris},
    ray::{Ray, RayHit},
    rt_triangle::RtTriangle,
    triangle,
};

use crate::{
    scene::{
        instant::{Body, Instant, LARGEST_BODY_M},
        mesh::{Material, Mesh, Triangle},
        surroundings::{Surroundings, Tile},
    },
    world::reservation::ActorId,
};

/// What a ray has met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub range_m: f32,
    /// Unit vector that leaves the surface on the side of the ray; world frame.
    pub normal: Vec3,
    pub material: Material,
    /// `None` for what stands.
    pub actor: Option<ActorId>,
    /// World frame, m/s.
    pub velocity_mps: Vec3,
}

/// All that stands in a town, ready for rays.
pub struct Standing {
    tiles: Vec<Tile>,
    tree: Tree,
}

impl Standing {
    pub fn new(surroundings: &Surroundings) -> Standing {
        let mut corners = Vec::new();
        let mut surfaces = Vec::new();
        for tile in &surroundings.tiles {
            add(&tile.mesh, &Affine3A::IDENTITY, &mut corners);
            surfaces.extend(tile.mesh.triangles.iter().map(|triangle| Surface::of(triangle, None)));
        }
        let tree = Tree::new(&corners, &surfaces, BvhBuildParams::slow_build());
        Standing { tiles: surroundings.tiles.clone(), tree }
    }
}

/// All that a sensor can reach at one instant.
#[derive(Clone, Copy)]
pub struct Reach<'a> {
    standing: &'a Standing,
    bodies: &'a [Body],
    place_m: Vec3,
    range_m: f32,
}

impl<'a> Reach<'a> {
    /// What stands, and the bodies, within `range_m` of a place.
    pub fn new(
        standing: &'a Standing,
        instant: &'a Instant,
        place_m: Vec3,
        range_m: f32,
    ) -> Reach<'a> {
        Reach { standing, bodies: &instant.bodies, place_m, range_m }
    }

    /// What stands, in tiles that come within the range.
    pub fn tiles(&self) -> impl Iterator<Item = &'a Tile> {
        let Reach { place_m, range_m, .. } = *self;
        self.standing.tiles.iter().filter(move |tile| {
            let gap_m = (tile.low_m - place_m).max(place_m - tile.high_m).max(Vec3::ZERO);
            gap_m.length_squared() <= range_m * range_m
        })
    }

    /// The bodies that may come within the range, with their places in the instant.
    pub fn bodies(&self) -> impl Iterator<Item = (usize, &'a Body)> {
        let (place_m, reach_m) = (self.place_m, self.range_m + LARGEST_BODY_M);
        self.bodies.iter().enumerate().filter(move |(_, body)| {
            let origin_m: Vec3 = body.world_from_body.translation.into();
            origin_m.distance_squared(place_m) <= reach_m * reach_m
        })
    }

    /// Ready for rays from the place, in any direction.
    pub fn rays(&self) -> Rays<'a> {
        self.rays_towards(Vec3::X, PI)
    }

    /// Ready for rays from near the place that turn from a direction (unit length) by `most_rad` at
    /// most.
    pub fn rays_towards(&self, direction: Vec3, most_rad: f32) -> Rays<'a> {
        let mut corners = Vec::new();
        let mut surfaces = Vec::new();
        let place_m = self.place_m;
        let may_be_met = |body: &Body| {
            let way_m = Vec3::from(body.world_from_body.translation) - place_m;
            // It, and the ray's beginning, lie within this.
            let reach_m = 2.0 * LARGEST_BODY_M;
            let distance_m = way_m.length();
            distance_m < reach_m
                || way_m.angle_between(direction) < most_rad + (reach_m / distance_m).asin()
        };
        for (index, body) in self.bodies().filter(|(_, body)| may_be_met(body)) {
            add(&body.mesh, &body.world_from_body, &mut corners);
            let triangles = body.mesh.triangles.iter();
            surfaces.extend(triangles.map(|triangle| Surface::of(triangle, Some(index))));
        }
        let moving = Tree::new(&corners, &surfaces, BvhBuildParams::fastest_build());
        Rays { standing: &self.standing.tree, bodies: self.bodies, moving }
    }
}

/// What stands and what moves, for rays.
pub struct Rays<'a> {
    standing: &'a Tree,
    bodies: &'a [Body],
    moving: Tree,
}

impl Rays<'_> {
    /// What a ray meets first within `max_m`; `direction` is a unit vector, both in the world frame.
    pub fn hit(&self, origin_m: Vec3, direction: Vec3, max_m: f32) -> Option<Hit> {
        let mut ray = Ray::new(origin_m.into(), direction.into(), 0.0, max_m);
        let moving = self.moving.first(&ray);
        if let Some((range_m, _, _)) = moving {
            ray.tmax = range_m;
        }
        let (range_m, out, surface) = self.standing.first(&ray).or(moving)?;
        let out = if out.dot(ray.direction) > 0.0 { -out } else { out };
        let body = surface.body.map(|index| &self.bodies[index as usize]);
        Some(Hit {
            range_m,
            normal: out.normalize_or_zero().into(),
            material: surface.material,
            actor: body.map(|body| body.actor),
            velocity_mps: body.map_or(Vec3::ZERO, |body| body.velocity_mps.as_vec3()),
        })
    }
}

/// The colour of a triangle, sRGB: of coachwork and jackets its body decides.
pub fn colour(triangle: &Triangle, body: Option<&Body>) -> [u8; 3] {
    match (triangle.material, body) {
        (Material::Coachwork | Material::Jacket, Some(body)) => body.colour,
        _ => triangle.colour,
    }
}

/// What is particular to a triangle besides its place.
#[derive(Clone, Copy)]
struct Surface {
    material: Material,
    /// Index of the body that it belongs to.
    body: Option<u32>,
}

impl Surface {
    fn of(triangle: &Triangle, body: Option<usize>) -> Surface {
        Surface { material: triangle.material, body: body.map(|index| index as u32) }
    }
}

/// Triangles below boxes.
struct Tree {
    boxes: Bvh2,
    /// Both in the order of the leaves.
    triangles: Vec<RtTriangle>,
    surfaces: Vec<Surface>,
}

impl Tree {
    fn new(corners: &[triangle::Triangle], surfaces: &[Surface], params: BvhBuildParams) -> Tree {
        let boxes = build_bvh2_from_tris(corners, params, &mut Duration::default());
        let order = boxes.primitive_indices.iter().map(|index| *index as usize);
        Tree {
            triangles: order.clone().map(|index| RtTriangle::from(&corners[index])).collect(),
            surfaces: order.map(|index| surfaces[index]).collect(),
            boxes,
        }
    }

    /// Range, a normal of any length, and the surface that a ray meets first.
    fn first(&self, ray: &Ray) -> Option<(f32, Vec3A, Surface)> {
        let mut hit = RayHit::none();
        let is_hit = self
            .boxes
            .ray_traverse(*ray, &mut hit, |ray, index| self.triangles[index].intersect(ray));
        let index = hit.primitive_id as usize;
        is_hit.then(|| (hit.t, -self.triangles[index].ng, self.surfaces[index]))
    }
}

/// Append the triangles of a mesh, placed in the world.
fn add(mesh: &Mesh, world_from_mesh: &Affine3A, corners: &mut Vec<triangle::Triangle>) {
    let places_m: Vec<Vec3A> = (mesh.vertices.iter())
        .map(|vertex| world_from_mesh.transform_point3a(vertex.position_m.into()))
        .collect();
    corners.extend(mesh.triangles.iter().map(|triangle| {
        let [v0, v1, v2] = triangle.corners.map(|corner| places_m[corner as usize]);
        triangle::Triangle { v0, v1, v2 }
    }));
}
