//! The triangles of a scene onto the visibility buffer.

use glam::{Affine3A, Mat3, Vec2, Vec3};

use crate::{
    scene::{
        instant::{Body, Instant, LARGEST_BODY_M},
        mesh::{Material, Mesh, Vertex},
        surroundings::Surroundings,
    },
    sensors::camera::{
        raster::{Bounds, Corner, Visibility},
        view::View,
    },
};

/// A triangle that lies in the view.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// World frame, unit length, outwards.
    pub normal: Vec3,
    pub material: Material,
    /// sRGB.
    pub colour: [u8; 3],
    /// Which body it belongs to, if it moves.
    pub body: Option<u32>,
    /// Coordinates on the surface, m: at the eye's foot on the surface's plane, and how they grow
    /// with the place; world frame, from the eye.
    pub texture: Texture,
}

/// An affine map from places, relative to the eye, to coordinates on a surface, m.
#[derive(Clone, Copy, Debug)]
pub struct Texture {
    pub along: Vec3,
    pub up: Vec3,
    pub origin_m: Vec2,
}

/// Draws scenes, and remembers the facets of the last one.
#[derive(Clone, Debug, Default)]
pub struct Facets {
    pub facets: Vec<Facet>,
    corners: Vec<Corner>,
    bounds: Vec<Bounds>,
}

impl Facets {
    pub fn draw(
        &mut self,
        view: &View,
        surroundings: &Surroundings,
        instant: &Instant,
        onto: &mut Visibility,
    ) {
        onto.clear();
        self.facets.clear();
        for (index, body) in instant.bodies.iter().enumerate() {
            self.draw_body(view, body, index as u32, onto);
        }
        for tile in &surroundings.tiles {
            if view.may_see_box(tile.low_m, tile.high_m) {
                self.draw_tile(view, &tile.mesh, onto);
            }
        }
    }

    fn draw_tile(&mut self, view: &View, mesh: &Mesh, onto: &mut Visibility) {
        let corners = mesh.vertices.iter().map(|v| Corner::new(view, view.seen_m(v.position_m)));
        self.corners.clear();
        self.corners.extend(corners);
        self.draw_mesh(view, mesh, None, &|vertex| vertex.position_m - view.eye_m, onto);
    }

    fn draw_body(&mut self, view: &View, body: &Body, index: u32, onto: &mut Visibility) {
        let Affine3A { matrix3, translation } = body.world_from_body;
        let growth =
            matrix3.x_axis.length().max(matrix3.y_axis.length()).max(matrix3.z_axis.length());
        let may_see = |reach_m: f32| view.may_see_ball(translation.into(), growth * reach_m);
        if !may_see(LARGEST_BODY_M) || !may_see(reach_m(&body.mesh)) {
            return;
        }
        let (rotation, shift) = view.camera_from_body(&body.world_from_body);
        let seen_m = |vertex: &Vertex| rotation * vertex.position_m + shift;
        self.corners.clear();
        self.corners.extend(body.mesh.vertices.iter().map(|v| Corner::new(view, seen_m(v))));
        let (rotation, shift) = (Mat3::from(matrix3), Vec3::from(translation) - view.eye_m);
        let from_eye_m = |vertex: &Vertex| rotation * vertex.position_m + shift;
        self.draw_mesh(view, &body.mesh, Some((index, body.colour)), &from_eye_m, onto);
    }

    fn draw_mesh(
        &mut self,
        view: &View,
        mesh: &Mesh,
        body: Option<(u32, [u8; 3])>,
        from_eye_m: &impl Fn(&Vertex) -> Vec3,
        onto: &mut Visibility,
    ) {
        self.bounds.clear();
        self.bounds.extend(self.corners.iter().map(Bounds::of));
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.corners;
            let (a, b, c) = (a as usize, b as usize, c as usize);
            let bounds = &self.bounds[..];
            let (width, height) = (view.width, view.height);
            if !Bounds::hold_a_centre(bounds[a], bounds[b], bounds[c], width, height) {
                continue;
            }
            let corners = [self.corners[a], self.corners[b], self.corners[c]];
            if !onto.draw(view, &corners, self.facets.len() as u32) {
                continue;
            }
            let vertices = [&mesh.vertices[a], &mesh.vertices[b], &mesh.vertices[c]];
            let at_m = [from_eye_m(vertices[0]), from_eye_m(vertices[1]), from_eye_m(vertices[2])];
            let normal = (at_m[1] - at_m[0]).cross(at_m[2] - at_m[0]);
            let painted = matches!(triangle.material, Material::Coachwork | Material::Jacket);
            let colour = body.filter(|_| painted).map_or(triangle.colour, |(_, colour)| colour);
            let texture = match triangle.material {
                Material::Facade => Texture::new(at_m, vertices.map(|v| v.texture_m), normal),
                _ => Texture::NONE,
            };
            self.facets.push(Facet {
                normal: normal.normalize_or(Vec3::Z),
                material: triangle.material,
                colour,
                body: body.map(|(index, _)| index),
                texture,
            });
        }
    }
}

impl Texture {
    const NONE: Texture = Texture { along: Vec3::ZERO, up: Vec3::ZERO, origin_m: Vec2::ZERO };

    /// The map that gives the corners of a triangle their coordinates.
    fn new(at_m: [Vec3; 3], texture_m: [Vec2; 3], normal: Vec3) -> Texture {
        let area_squared = normal.length_squared();
        if area_squared < 1e-12 {
            return Texture { origin_m: texture_m[0], ..Texture::NONE };
        }
        // Dual base of the two sides within the plane.
        let (one, two) = (at_m[1] - at_m[0], at_m[2] - at_m[0]);
        let (dual_one, dual_two) =
            (two.cross(normal) / area_squared, normal.cross(one) / area_squared);
        let (grow_one, grow_two) = (texture_m[1] - texture_m[0], texture_m[2] - texture_m[0]);
        let along = dual_one * grow_one.x + dual_two * grow_two.x;
        let up = dual_one * grow_one.y + dual_two * grow_two.y;
        let origin_m = texture_m[0] - Vec2::new(along.dot(at_m[0]), up.dot(at_m[0]));
        Texture { along, up, origin_m }
    }

    /// How coordinates on the surface change with a way in the world, both m.
    #[inline]
    pub fn growth_m(&self, way_m: Vec3) -> Vec2 {
        Vec2::new(self.along.dot(way_m), self.up.dot(way_m))
    }
}

/// How far from its origin a mesh reaches, m.
fn reach_m(mesh: &Mesh) -> f32 {
    let squares = mesh.vertices.iter().map(|vertex| vertex.position_m.length_squared());
    squares.fold(0.0, f32::max).sqrt()
}
