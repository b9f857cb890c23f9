//! Shadows: of the sun, by looking from it, and below bodies, where little of the sky is seen.

use std::sync::Arc;

use glam::{Affine3A, Mat3, Vec3, Vec3A};

use crate::{
    scene::{
        instant::Instant,
        mesh::{Material, Mesh, Vertex},
        surroundings::Surroundings,
    },
    sensors::{
        camera::{
            light::{Light, luminance},
            raster::{Bounds, Visibility},
        },
        floats::split,
    },
};

/// Size of the texels of the shadow map, m, and how many lie on either side of what it is asked for.
const TEXEL_M: f32 = 0.18;
const REACH: usize = 256;

/// The map stays where it is while its middle moves within so many texels, so that what stands is drawn
/// once for many pictures.
const STEP: usize = 128;

/// Texels along a side.
const SIDE: usize = 2 * REACH + STEP;

/// What stands further from the middle of the map throws no shadow onto it, m.
const CASTERS_M: f32 = 112.0;

/// What reaches further from its origin does so outside the map, m.
const BODY_M: f32 = 7.0;

/// A surface does not shade itself within this, m.
const BIAS_M: f32 = 0.12;

/// Heights along the light are counted from so far below, m.
const DEPTH_M: f32 = 1000.0;

/// The area that the map covers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Area {
    /// Rows: across, up, towards the sun.
    sun_from_world: Mat3,
    middle_m: Vec3,
    /// From the world frame, m: texels, and height towards the sun, m.
    map_from_world: Affine3A,
}

/// How near to the sun the first surface is that meets its light, over an area ahead of the camera.
#[derive(Clone, Debug)]
pub struct Shadows {
    map: Visibility,
    standing: Standing,
    places_px: Vec<Vec3>,
    bounds: Vec<Bounds>,
    /// `None` where no sun shines.
    area: Option<Area>,
}

/// The map of what stands, as it was drawn last, and of what.
#[derive(Clone, Debug, Default)]
struct Standing {
    nearness: Vec<f32>,
    area: Option<Area>,
    meshes: Vec<Arc<Mesh>>,
}

impl Default for Shadows {
    fn default() -> Shadows {
        Shadows {
            map: Visibility::flat(SIDE, SIDE),
            standing: Standing::default(),
            places_px: Vec::new(),
            bounds: Vec::new(),
            area: None,
        }
    }
}

impl Area {
    fn new(light: &Light, middle_m: Vec3) -> Area {
        let sun = Vec3::from(light.sun_direction);
        let across = Vec3::Z.cross(sun).normalize_or(Vec3::X);
        let world_from_sun = Mat3::from_cols(across, sun.cross(across), sun);
        let sun_from_world = world_from_sun.transpose();
        // Texels keep their places in the world, so edges do not crawl.
        let step_m = STEP as f32 * TEXEL_M;
        let snapped = ((sun_from_world * middle_m / step_m).floor() + 0.5) * step_m;
        let middle_m = world_from_sun * snapped;
        let to_texels = Mat3::from_diagonal(Vec3::new(1.0 / TEXEL_M, 1.0 / TEXEL_M, 1.0));
        let scaled = to_texels * sun_from_world;
        let middle = Vec3::new(SIDE as f32 / 2.0, SIDE as f32 / 2.0, DEPTH_M);
        let map_from_world = Affine3A::from_mat3_translation(scaled, middle - scaled * middle_m);
        Area { sun_from_world, middle_m, map_from_world }
    }

    /// Whether a box (world frame) may throw a shadow onto the map.
    fn may_be_shaded_by(&self, low_m: Vec3, high_m: Vec3) -> bool {
        let (centre, half) = ((low_m + high_m) * 0.5 - self.middle_m, (high_m - low_m) * 0.5);
        let reach = SIDE as f32 / 2.0 * TEXEL_M;
        let meets = |axis: Vec3| centre.dot(axis).abs() < reach + (axis.abs() * half).element_sum();
        let world_from_sun = self.sun_from_world.transpose();
        centre.length() < CASTERS_M + half.length()
            && meets(world_from_sun.x_axis)
            && meets(world_from_sun.y_axis)
    }
}

/// Whether it stands up from the ground.
fn throws_shadow(material: Material) -> bool {
    use Material::{Asphalt, Concrete, Grass, Marking};
    !matches!(material, Asphalt | Marking | Concrete | Grass)
}

impl Shadows {
    /// Look from the sun at what lies around `middle_m` (world frame).
    pub fn draw(
        &mut self,
        light: &Light,
        surroundings: &Surroundings,
        instant: &Instant,
        middle_m: Vec3,
    ) {
        self.area = (luminance(light.sun) > 0.1).then(|| Area::new(light, middle_m));
        let Some(area) = self.area else { return };
        let tiles = surroundings.tiles.iter();
        let casters = tiles.filter(|tile| area.may_be_shaded_by(tile.low_m, tile.high_m));
        let meshes: Vec<&Arc<Mesh>> = casters.map(|tile| &tile.mesh).collect();
        // No other mesh can have the place of one that is held.
        let is_same = |(held, now): (&Arc<Mesh>, &&Arc<Mesh>)| Arc::ptr_eq(held, now);
        let is_drawn = self.standing.area == Some(area)
            && self.standing.meshes.len() == meshes.len()
            && self.standing.meshes.iter().zip(&meshes).all(is_same);
        if is_drawn {
            self.map.nearness.copy_from_slice(&self.standing.nearness);
        } else {
            self.map.clear();
            meshes.iter().for_each(|mesh| self.draw_mesh(mesh, &area.map_from_world));
            self.standing.nearness.clone_from(&self.map.nearness);
            self.standing.meshes = meshes.into_iter().cloned().collect();
            self.standing.area = Some(area);
        }
        for body in &instant.bodies {
            let centre_m = Vec3::from(body.world_from_body.translation);
            if area.may_be_shaded_by(centre_m - BODY_M, centre_m + BODY_M) {
                self.draw_mesh(&body.mesh, &(area.map_from_world * body.world_from_body));
            }
        }
    }

    fn draw_mesh(&mut self, mesh: &Mesh, map_from_mesh: &Affine3A) {
        let place_px = |vertex: &Vertex| map_from_mesh.transform_point3(vertex.position_m);
        self.places_px.clear();
        self.places_px.extend(mesh.vertices.iter().map(place_px));
        self.bounds.clear();
        self.bounds.extend(self.places_px.iter().map(|place| Bounds::at(place.truncate())));
        for triangle in mesh.triangles.iter().filter(|triangle| throws_shadow(triangle.material)) {
            let [a, b, c] = triangle.corners;
            let (a, b, c) = (a as usize, b as usize, c as usize);
            let (bounds, places_px) = (&self.bounds[..], &self.places_px[..]);
            if Bounds::hold_a_centre(bounds[a], bounds[b], bounds[c], SIDE, SIDE) {
                self.map.draw_flat([places_px[a], places_px[b], places_px[c]]);
            }
        }
    }

    /// A place of the world frame, m, on the map: texels, and height towards the sun, m.
    #[inline]
    pub fn place(&self, place_m: Vec3A) -> Vec3A {
        self.area.map_or(Vec3A::ZERO, |area| area.map_from_world.transform_point3a(place_m))
    }

    /// How places on the map change with a way in the world, m.
    #[inline]
    pub fn change(&self, way_m: Vec3A) -> Vec3A {
        self.area.map_or(Vec3A::ZERO, |area| area.map_from_world.transform_vector3a(way_m))
    }

    /// Share of the sun's light that arrives at a place on the map.
    #[inline]
    pub fn sunlight(&self, place: Vec3A) -> f32 {
        if self.area.is_none() {
            return 1.0;
        }
        let ((column, across), (row, up)) = (split(place.x - 0.5), split(place.y - 0.5));
        let inside = 0..SIDE as i32 - 1;
        if !inside.contains(&column) || !inside.contains(&row) {
            return 1.0;
        }
        let height_m = place.z + BIAS_M;
        let start = row as usize * SIDE + column as usize;
        let [near, far] = [start, start + SIDE].map(|start| &self.map.nearness[start..start + 2]);
        let open = |nearness: f32| if nearness < height_m { 1.0 } else { 0.0 };
        let [a, b, c, d] = [near[0], near[1], far[0], far[1]].map(open);
        let (below, above) = (a + (b - a) * across, c + (d - c) * across);
        below + (above - below) * up
    }
}
