//! Lamps of streets and vehicles: where they are, and what they throw on the ground.

use glam::{Vec2, Vec3, Vec3A};

use crate::{
    scene::{
        instant::Instant,
        mesh::{Material, Mesh},
        surroundings::Surroundings,
    },
    sensors::{
        camera::{curves::smooth, light::Light},
        floats::floor,
    },
};

/// Lamps further away than this light nothing that can be made out, m.
const REACH_M: f32 = 110.0;

/// Faces of lamps nearer to each other than this are one lamp, m.
const ONE_LAMP_M: f32 = 0.6;

/// Cells of the map of light along a side, and their size, m.
const SIDE: usize = 160;
const CELL_M: f32 = 1.25;

/// Light of a street lamp on the ground below it, and how far it throws, m.
const STREET: Vec3A = Vec3A::new(0.15, 0.115, 0.07);
const POOL_M: f32 = 15.0;

/// Colours of glowing lamps.
const WHITE: Vec3A = Vec3A::new(1.0, 0.93, 0.78);
const RED: Vec3A = Vec3A::new(1.0, 0.04, 0.02);

/// A lamp that shines.
#[derive(Clone, Copy, Debug)]
pub struct Lamp {
    pub place_m: Vec3,
    /// Where it throws its light: ahead for vehicles, down for streets.
    pub direction: Vec3,
    pub material: Material,
    /// How bright it looks.
    pub glow: Vec3A,
}

/// How bright a facet of a lamp looks, linear.
pub fn glow(light: &Light, material: Material, is_braking: bool) -> Vec3A {
    match material {
        Material::HeadLamp => WHITE * 2.5 * light.vehicle_lamps,
        Material::TailLamp => RED * 0.35 * light.vehicle_lamps,
        Material::BrakeLamp if is_braking => RED * 1.6,
        Material::BrakeLamp => RED * 0.2 * light.vehicle_lamps,
        Material::StreetLamp => Vec3A::new(1.0, 0.82, 0.55) * 2.2 * light.street_lamps,
        _ => Vec3A::ZERO,
    }
}

/// All lamps that shine near the eye, in the order of tiles and bodies.
pub fn find(
    light: &Light,
    surroundings: &Surroundings,
    instant: &Instant,
    eye_m: Vec3,
    lamps: &mut Vec<Lamp>,
) {
    lamps.clear();
    if light.street_lamps > 0.0 {
        for tile in &surroundings.tiles {
            let gap = (tile.low_m - eye_m).max(eye_m - tile.high_m).max(Vec3::ZERO);
            if gap.length() < REACH_M {
                gather(
                    &tile.mesh,
                    &|material| material == Material::StreetLamp,
                    &mut |place, _| {
                        let glow = glow(light, Material::StreetLamp, false);
                        let material = Material::StreetLamp;
                        lamps.push(Lamp { place_m: place, direction: Vec3::NEG_Z, material, glow });
                    },
                );
            }
        }
    }
    for body in &instant.bodies {
        if Vec3::from(body.world_from_body.translation).distance(eye_m) > REACH_M {
            continue;
        }
        let shines = |material| glow(light, material, body.is_braking) != Vec3A::ZERO;
        gather(&body.mesh, &shines, &mut |place, material| {
            let forward = Vec3::from(body.world_from_body.matrix3.x_axis);
            let is_front = material == Material::HeadLamp;
            lamps.push(Lamp {
                place_m: body.world_from_body.transform_point3(place),
                direction: if is_front { forward } else { -forward },
                material,
                glow: glow(light, material, body.is_braking),
            });
        });
    }
}

/// The lamps of a mesh: the middle of each group of faces that touch.
fn gather(mesh: &Mesh, shines: &dyn Fn(Material) -> bool, found: &mut dyn FnMut(Vec3, Material)) {
    let mut group: Option<(Vec3, f32, Material)> = None;
    for triangle in mesh.triangles.iter().filter(|triangle| shines(triangle.material)) {
        let [a, b, c] = triangle.corners.map(|corner| mesh.vertices[corner as usize].position_m);
        let middle = (a + b + c) / 3.0;
        match &mut group {
            Some((sum, count, material))
                if *material == triangle.material
                    && (*sum / *count).distance(middle) < ONE_LAMP_M =>
            {
                *sum += middle;
                *count += 1.0;
            }
            _ => {
                if let Some((sum, count, material)) = group {
                    found(sum / count, material);
                }
                group = Some((middle, 1.0, triangle.material));
            }
        }
    }
    if let Some((sum, count, material)) = group {
        found(sum / count, material);
    }
}

/// Light that lamps throw on the ground, in cells around the eye.
#[derive(Clone, Debug, Default)]
pub struct LightMap {
    low_m: Vec2,
    cells: Vec<Vec3A>,
    is_dark: bool,
}

impl LightMap {
    /// What lamps throw; `middle_m` is the middle of the map.
    pub fn draw(&mut self, light: &Light, lamps: &[Lamp], middle_m: Vec2) {
        // Cells keep their places in the world, so light does not crawl.
        let corner = (middle_m / CELL_M).floor() - SIDE as f32 / 2.0;
        self.low_m = corner * CELL_M;
        self.cells.clear();
        self.cells.resize(SIDE * SIDE, Vec3A::ZERO);
        self.is_dark = true;
        // By day the sun outshines them.
        if light.exposure < 2.0 {
            return;
        }
        for lamp in lamps {
            self.is_dark = false;
            let at = lamp.place_m.truncate();
            let ahead = lamp.direction.truncate().normalize_or_zero();
            match lamp.material {
                Material::StreetLamp => self.add(at, POOL_M, &|offset| {
                    let share = (1.0 - offset.length_squared() / (POOL_M * POOL_M)).max(0.0);
                    STREET * share * share * light.street_lamps
                }),
                Material::HeadLamp => self.add(at + ahead * 14.0, 18.0, &|offset| {
                    let from = offset + ahead * 14.0;
                    let (along, aside) = (from.dot(ahead), from.perp_dot(ahead));
                    let width = 1.0 + 0.22 * along.max(0.0);
                    let beam = smooth(0.3, 4.0, along) * smooth(32.0, 8.0, along);
                    WHITE * (0.09 * beam * smooth(width, 0.3 * width, aside.abs()))
                }),
                _ => {
                    let strength = lamp.glow * 0.012;
                    self.add(at + ahead * 1.5, 3.5, &|offset| {
                        let share = (1.0 - offset.length_squared() / 12.25).max(0.0);
                        strength * share * share
                    });
                }
            }
        }
    }

    fn add(&mut self, middle_m: Vec2, reach_m: f32, thrown: &dyn Fn(Vec2) -> Vec3A) {
        let cell =
            |place_m: f32, low_m: f32| (((place_m - low_m) / CELL_M).max(0.0) as usize).min(SIDE);
        let columns =
            cell(middle_m.x - reach_m, self.low_m.x)..cell(middle_m.x + reach_m, self.low_m.x);
        let rows =
            cell(middle_m.y - reach_m, self.low_m.y)..cell(middle_m.y + reach_m, self.low_m.y);
        for row in rows {
            for column in columns.clone() {
                let place_m = self.low_m + (Vec2::new(column as f32, row as f32) + 0.5) * CELL_M;
                self.cells[row * SIDE + column] += thrown(place_m - middle_m);
            }
        }
    }

    /// Light on the ground at a place, world frame; linear.
    #[inline]
    pub fn at(&self, x_m: f32, y_m: f32) -> Vec3A {
        let (x, y) = ((x_m - self.low_m.x) / CELL_M - 0.5, (y_m - self.low_m.y) / CELL_M - 0.5);
        let (column, row) = (floor(x), floor(y));
        let inside = 0..SIDE as i32 - 1;
        if self.is_dark || !inside.contains(&column) || !inside.contains(&row) {
            return Vec3A::ZERO;
        }
        let (across, up) = (x - column as f32, y - row as f32);
        let start = row as usize * SIDE + column as usize;
        let [a, b] = [self.cells[start], self.cells[start + 1]];
        let [c, d] = [self.cells[start + SIDE], self.cells[start + SIDE + 1]];
        a.lerp(b, across).lerp(c.lerp(d, across), up)
    }
}

/// The ego vehicle's own head lamps, as one: low beams.
#[derive(Clone, Copy, Debug)]
pub struct Beam {
    /// From the eye, world frame, m.
    lamp_m: Vec3A,
    forward: Vec3A,
    left: Vec3A,
    up: Vec3A,
    strength: f32,
}

impl Beam {
    /// `ego` are the axes of the ego frame in the world frame, and its origin from the eye.
    pub fn new(light: &Light, [forward, left, up]: [Vec3A; 3], origin_m: Vec3A) -> Beam {
        let strength = if light.exposure < 2.0 { 0.0 } else { 26.0 * light.vehicle_lamps };
        Beam { lamp_m: origin_m + forward * 2.4 + up * 0.65, forward, left, up, strength }
    }

    /// How strong the beam is in a direction, in [0, 1].
    #[inline]
    fn pattern(&self, ahead: f32, aside: f32, rise: f32) -> f32 {
        if ahead <= 0.0 {
            return 0.0;
        }
        let (aside, rise) = (aside / ahead, rise / ahead);
        let spread = 1.0 / (1.0 + 5.0 * aside * aside);
        // Cut off above; less so on the right, away from those who come.
        let cut = 0.01 - 0.05 * aside.clamp(-0.5, 0.5);
        let below = smooth(cut + 0.05, cut - 0.02, rise);
        spread * spread * (0.14 + 0.86 * below)
    }

    /// Light on a surface with a normal, at a place from the eye; linear.
    #[inline]
    pub fn on(&self, from_eye_m: Vec3A, normal: Vec3A) -> Vec3A {
        if self.strength == 0.0 {
            return Vec3A::ZERO;
        }
        let way = from_eye_m - self.lamp_m;
        let ahead = way.dot(self.forward);
        let squared = way.length_squared();
        // Grazing light brings out the grain of a road, so it is more than the cosine says.
        let facing = (-normal.dot(way) / squared.sqrt().max(0.1)).max(0.0).sqrt();
        let pattern = self.pattern(ahead, way.dot(self.left), way.dot(self.up));
        WHITE * (self.strength * pattern * facing / (squared + 30.0))
    }

    /// What drops and haze throw back from a direction (unit length); linear.
    #[inline]
    pub fn veil(&self, direction: Vec3A) -> f32 {
        if self.strength == 0.0 {
            return 0.0;
        }
        let (aside, rise) = (direction.dot(self.left), direction.dot(self.up));
        let spread = 1.0 / (1.0 + 4.0 * aside * aside + 14.0 * rise * rise);
        if direction.dot(self.forward) > 0.0 { self.strength * spread * spread } else { 0.0 }
    }
}
