//! What surfaces look like from close and from afar: colour by place, window, slab and tile.

use glam::{Vec2, Vec3A};

use crate::{
    scene::mesh::Material,
    sensors::camera::{
        curves::{Bars, floor, linear, lot, smooth},
        facets::Facet,
        grain::Grain,
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
    /// What is particular to a wall.
    wall: Wall,
    is_roof: bool,
}

#[derive(Clone, Copy, Debug)]
struct Wall {
    number: u32,
    bay_m: f32,
    has_shops: bool,
    windows: Windows,
    shops: Windows,
}

/// Windows in bays and storeys: where glass is, and where glass and frames are.
#[derive(Clone, Copy, Debug)]
struct Windows {
    margin_m: f32,
    sill_m: f32,
    glass: [Bars; 2],
    framed: [Bars; 2],
}

impl Windows {
    fn new(bay_m: f32, size_m: Vec2, sill_m: f32) -> Windows {
        let outer_m = size_m + 2.0 * FRAME_M;
        let bars = |size_m: Vec2| [Bars::new(size_m.x, bay_m), Bars::new(size_m.y, STOREY_M)];
        let margin_m = 0.5 * (bay_m - size_m.x);
        Windows { margin_m, sill_m, glass: bars(size_m), framed: bars(outer_m) }
    }

    /// Shares of a pixel that show glass, and frames.
    #[inline]
    fn shares(&self, along_m: f32, up_m: f32, footprint_m: f32) -> [f32; 2] {
        let (along_m, up_m) = (along_m - self.margin_m, up_m - self.sill_m);
        let [across, upward] = &self.framed;
        let framed = across.share(along_m + FRAME_M, footprint_m)
            * upward.share(up_m + FRAME_M, footprint_m);
        if framed == 0.0 {
            return [0.0; 2];
        }
        let [across, upward] = &self.glass;
        let glass = across.share(along_m, footprint_m) * upward.share(up_m, footprint_m);
        [glass, (framed - glass).max(0.0)]
    }
}

impl Surface {
    pub fn new(facet: &Facet) -> Surface {
        let [r, g, b] = facet.colour.map(u32::from);
        let number = r << 16 | g << 8 | b;
        let draw = |of: i32| lot(of, 0, number);
        let bay_m = 2.3 + 1.0 * draw(1);
        let window_m = Vec2::new(1.05 + 0.35 * draw(2), 1.35 + 0.35 * draw(3));
        let wall = Wall {
            number,
            has_shops: draw(4) < 0.3,
            windows: Windows::new(bay_m, window_m, 0.95),
            shops: Windows::new(bay_m, Vec2::new(bay_m - 0.35, 2.2), 0.35),
            bay_m,
        };
        let is_roof = facet.normal.z > 0.15;
        Surface { material: facet.material, colour: linear(facet.colour), wall, is_roof }
    }

    /// At a place (world frame, m), seen by a pixel that covers `footprint_m`; `texture_m` gives
    /// coordinates on a wall.
    #[inline]
    pub fn look(
        &self,
        grain: &Grain,
        place_m: Vec3A,
        texture_m: impl Fn() -> Vec2,
        footprint_m: f32,
    ) -> Look {
        let at = |texel_m: f32| {
            let scale = 1.0 / texel_m;
            grain.at(place_m.x * scale, place_m.y * scale, footprint_m * scale)
        };
        let plain = |albedo: Vec3A| Look { albedo, mirror: 0.0, lit: 0.0 };
        match self.material {
            Material::Asphalt => {
                let (fine, broad) = (at(0.02), at(0.35));
                let patches = smooth(0.12, 0.2, broad) * 0.1;
                let crack = smooth(0.035, 0.0, broad.abs()) * smooth(0.12, 0.03, footprint_m);
                let shade = 1.0 + 0.25 * fine + 0.22 * broad - patches - 0.2 * crack;
                plain(self.colour * (1.25 * shade))
            }
            Material::Marking => {
                let (fine, broad) = (at(0.03), at(0.12));
                plain(self.colour * (0.92 + 0.1 * fine - 0.3 * smooth(0.25, 0.6, broad)))
            }
            Material::Concrete => {
                let joints =
                    JOINTS.share(place_m.x, footprint_m).max(JOINTS.share(place_m.y, footprint_m));
                let shade = 1.0 + 0.14 * at(0.03) + 0.14 * at(0.3) - 0.4 * joints;
                plain(self.colour * shade)
            }
            Material::Grass => {
                let (fine, broad) = (at(0.03), at(0.5));
                let dry = Vec3A::new(1.25, 1.05, 0.8);
                let tint = Vec3A::ONE.lerp(dry, smooth(-0.3, 0.5, broad));
                plain(self.colour * tint * (1.0 + 0.5 * fine + 0.25 * broad))
            }
            Material::Facade => self.wall(grain, texture_m(), footprint_m),
            Material::Plaster if self.is_roof => {
                let courses = COURSES.share(place_m.z, footprint_m);
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

    /// Windows in bays and storeys, each with its own blinds.
    fn wall(&self, grain: &Grain, texture_m: Vec2, footprint_m: f32) -> Look {
        let Wall { number, bay_m, has_shops, windows, shops } = &self.wall;
        let (along, up) = (texture_m.x, texture_m.y);
        let (bay, storey) = (floor(along / bay_m), floor(up * (1.0 / STOREY_M)));
        let kind = if *has_shops && storey == 0 { shops } else { windows };
        let [window, frame] = kind.shares(along, up, footprint_m);
        let draw = lot(bay, storey, *number);
        // Far away the windows of a wall run together, and so does their light.
        let near = smooth(2.5, 1.0, footprint_m);
        let lights = if draw < 0.28 { 0.5 + draw } else { 0.0 };
        let lit = window * (near * lights + (1.0 - near) * 0.15);
        let stains = grain.at(along * 7.0, up * 3.0, 7.0 * footprint_m);
        let plaster = self.colour * (1.0 + 0.13 * stains);
        let blind = if draw > 0.7 { 0.35 } else { 0.03 + 0.04 * draw };
        let pane_colour = Vec3A::new(0.9, 1.0, 1.1) * blind;
        let light_frame = Vec3A::splat(0.62).lerp(self.colour, 0.3);
        let albedo =
            plaster * (1.0 - window - frame).max(0.0) + light_frame * frame + pane_colour * window;
        Look { albedo, mirror: 0.35 * window, lit }
    }
}
