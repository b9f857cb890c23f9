//! What surfaces look like from close and from afar: colour by place, window, slab and tile.

use glam::{Vec2, Vec3A};

use crate::{
    scene::mesh::Material,
    sensors::{
        camera::{
            curves::{Bars, Stretch, linear, lot, smooth},
            facets::Facet,
            grain::Grain,
        },
        floats::split,
    },
};

/// From floor to floor, m.
const STOREY_M: f32 = 3.1;

/// Joints between the slabs of side-walks, and shadows between courses of tiles, m.
const JOINTS: Bars = Bars::new(0.03, 1.2);
const COURSES: Bars = Bars::new(0.05, 0.22);

/// Breadth of window frames, m.
const FRAME_M: f32 = 0.09;

/// How a place on a surface meets light.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Share of light that comes back in all directions, linear.
    pub albedo: Vec3A,
    /// Share of the sky that is mirrored, facing it.
    pub mirror: f32,
    /// How much of it is a window of a lit room.
    pub lit: f32,
}

/// A facet, prepared for many pixels.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    pub material: Material,
    colour: Vec3A,
    /// What is particular to a wall with windows.
    wall: Option<Wall>,
    is_roof: bool,
}

#[derive(Clone, Copy, Debug)]
struct Wall {
    number: u32,
    per_bay: f32,
    has_shops: bool,
    windows: Windows,
    shops: Windows,
}

/// Windows in bays and storeys: where glass is.
#[derive(Clone, Copy, Debug)]
struct Windows {
    margin_m: f32,
    sill_m: f32,
    across: Bars,
    upward: Bars,
}

impl Windows {
    fn new(bay_m: f32, size_m: Vec2, sill_m: f32) -> Windows {
        let margin_m = 0.5 * (bay_m - size_m.x);
        let (across, upward) = (Bars::new(size_m.x, bay_m), Bars::new(size_m.y, STOREY_M));
        Windows { margin_m, sill_m, across, upward }
    }

    /// Shares of a pixel that show glass, and frames.
    #[inline]
    fn shares(&self, along_m: f32, up_m: f32, footprint_m: f32) -> [f32; 2] {
        let footprint = Stretch::new(footprint_m);
        let upward = self.upward.shares(up_m - self.sill_m, FRAME_M, footprint);
        if upward[1] == 0.0 {
            return [0.0; 2];
        }
        let across = self.across.shares(along_m - self.margin_m, FRAME_M, footprint);
        let (glass, framed) = (across[0] * upward[0], across[1] * upward[1]);
        [glass, (framed - glass).max(0.0)]
    }
}

impl Wall {
    fn new(colour: [u8; 3]) -> Wall {
        let [r, g, b] = colour.map(u32::from);
        let number = r << 16 | g << 8 | b;
        let draw = |of: i32| lot(of, 0, number);
        let bay_m = 2.3 + 1.0 * draw(1);
        let window_m = Vec2::new(1.05 + 0.35 * draw(2), 1.35 + 0.35 * draw(3));
        Wall {
            number,
            per_bay: 1.0 / bay_m,
            has_shops: draw(4) < 0.3,
            windows: Windows::new(bay_m, window_m, 0.95),
            shops: Windows::new(bay_m, Vec2::new(bay_m - 0.35, 2.2), 0.35),
        }
    }
}

impl Surface {
    pub fn new(facet: &Facet) -> Surface {
        let wall = (facet.material == Material::Facade).then(|| Wall::new(facet.colour));
        let is_roof = facet.normal.z > 0.15;
        Surface { material: facet.material, colour: linear(facet.colour), wall, is_roof }
    }

    /// Whether it mirrors the sky.
    pub fn is_shiny(&self) -> bool {
        use Material::{Coachwork, Facade, Glass, Metal};
        matches!(self.material, Coachwork | Facade | Glass | Metal)
    }

    /// At a place (world frame, m), seen by a pixel that covers `footprint_m`; `texture_m` gives
    /// coordinates on a wall.
    #[inline]
    pub fn look(&self, grain: &Grain, place_m: Vec3A, texture_m: Vec2, footprint_m: f32) -> Look {
        let at = |texel_m: f32| {
            let scale = 1.0 / texel_m;
            grain.at(place_m.x * scale, place_m.y * scale, footprint_m * scale)
        };
        let plain = |albedo: Vec3A| Look { albedo, mirror: 0.0, lit: 0.0 };
        match self.material {
            Material::Asphalt => {
                let (fine, broad) = (at(0.02), at(0.35));
                let patches = smooth(0.12, 0.2, broad) * 0.1;
                // Seen from close alone.
                let crack = if footprint_m < 0.12 {
                    smooth(0.035, 0.0, broad.abs()) * smooth(0.12, 0.03, footprint_m)
                } else {
                    0.0
                };
                let shade = 1.0 + 0.25 * fine + 0.22 * broad - patches - 0.2 * crack;
                plain(self.colour * (1.25 * shade))
            }
            Material::Marking => {
                let (fine, broad) = (at(0.03), at(0.12));
                plain(self.colour * (0.92 + 0.1 * fine - 0.3 * smooth(0.25, 0.6, broad)))
            }
            Material::Concrete => {
                let joints = {
                    let footprint = Stretch::new(footprint_m);
                    JOINTS.share(place_m.x, footprint).max(JOINTS.share(place_m.y, footprint))
                };
                let shade = 1.0 + 0.14 * at(0.03) + 0.14 * at(0.3) - 0.4 * joints;
                plain(self.colour * shade)
            }
            Material::Grass => {
                let (fine, broad) = (at(0.03), at(0.5));
                let dry = Vec3A::new(1.25, 1.05, 0.8);
                let tint = Vec3A::ONE.lerp(dry, smooth(-0.3, 0.5, broad));
                plain(self.colour * tint * (1.0 + 0.5 * fine + 0.25 * broad))
            }
            Material::Facade => match &self.wall {
                Some(wall) => wall.look(self.colour, grain, texture_m, footprint_m),
                None => plain(self.colour),
            },
            Material::Plaster if self.is_roof => {
                let courses = COURSES.share(place_m.z, Stretch::new(footprint_m));
                plain(self.colour * (1.0 - 0.3 * courses + 0.2 * at(0.2)))
            }
            Material::Foliage => {
                let scale = 1.0 / 0.14;
                let (x, y) = (place_m.x + 0.6 * place_m.z, place_m.y - 0.8 * place_m.z);
                let leaves = grain.at(x * scale, y * scale, footprint_m * scale);
                let clumps = grain.at(y * 1.1, x * 1.1 + place_m.z, footprint_m);
                plain(self.colour * (0.85 + 0.9 * leaves + 0.4 * clumps).max(0.1))
            }
            Material::Bark | Material::Plaster => plain(self.colour * (1.0 + 0.2 * at(0.08))),
            Material::Glass => Look { albedo: self.colour * 0.5, mirror: 0.5, lit: 0.0 },
            Material::Coachwork => Look { albedo: self.colour, mirror: 0.1, lit: 0.0 },
            Material::Metal => Look { albedo: self.colour, mirror: 0.12, lit: 0.0 },
            _ => plain(self.colour),
        }
    }
}

impl Wall {
    /// Windows in bays and storeys, each with its own blinds.
    #[inline]
    fn look(&self, colour: Vec3A, grain: &Grain, texture_m: Vec2, footprint_m: f32) -> Look {
        let (along, up) = (texture_m.x, texture_m.y);
        let ((bay, _), (storey, _)) = (split(along * self.per_bay), split(up * (1.0 / STOREY_M)));
        let kind = if self.has_shops && storey == 0 { &self.shops } else { &self.windows };
        let [window, frame] = kind.shares(along, up, footprint_m);
        let stains = grain.at(along * 7.0, up * 3.0, 7.0 * footprint_m);
        let plaster = colour * (1.0 + 0.13 * stains);
        if window + frame == 0.0 {
            return Look { albedo: plaster, mirror: 0.0, lit: 0.0 };
        }
        let draw = lot(bay, storey, self.number);
        // Far away the windows of a wall run together, and so does their light.
        let near = smooth(2.5, 1.0, footprint_m);
        let lights = if draw < 0.28 { 0.5 + draw } else { 0.0 };
        let lit = window * (near * lights + (1.0 - near) * 0.15);
        let blind = if draw > 0.7 { 0.35 } else { 0.03 + 0.04 * draw };
        let pane_colour = Vec3A::new(0.9, 1.0, 1.1) * blind;
        let light_frame = Vec3A::splat(0.62).lerp(colour, 0.3);
        let albedo =
            plaster * (1.0 - window - frame).max(0.0) + light_frame * frame + pane_colour * window;
        Look { albedo, mirror: 0.35 * window, lit }
    }
}
