//! Houses, blocks and barns: walls with storeys, and roofs.

use glam::{DVec2, Vec2, Vec3};

use crate::{
    footprint::Footprint,
    scene::{
        mesh::{Material, Mesh},
        solids::{Paint, paint},
    },
    towns::scenery::things::{Kind, Thing},
};

/// Height of a storey, and width of the part of a wall that one window belongs to, m. Walls hold
/// whole numbers of both: their texture coordinates begin at 0 at the lower left corner and are
/// stretched to end on a multiple.
pub const STOREY_M: f32 = 3.1;
pub const BAY_M: f32 = 3.0;

/// Walls reach so far below the ground, m.
const FOOT_M: f32 = 1.0;

/// How far a roof stands out over the walls, m, and its rise to half of its span.
const EAVES_M: f32 = 0.4;
const PITCH: [f32; 3] = [0.75, 0.9, 0.6];

const PARAPET_M: f32 = 0.6;
const PARAPET_WIDTH_M: f32 = 0.35;

/// Colours of roofs, sRGB: tiles, slate, bitumen.
const TILES: [[u8; 3]; 4] = [[142, 74, 56], [120, 62, 52], [92, 84, 82], [84, 72, 66]];
const FLAT_ROOF: [u8; 3] = [112, 112, 110];
const CHIMNEY: [u8; 3] = [128, 84, 70];

/// A building on the ground at `ground_m`; `number` makes it differ from its neighbours.
pub fn draw(thing: &Thing, number: usize, ground_m: f32, mesh: &mut Mesh) {
    let shade = 0.92 + 0.04 * (number * 7 % 5) as f32;
    let colour = thing.kind.colours()[usize::from(thing.colour)];
    let body = Body { footprint: thing.footprint, ground_m, number };
    let roof = paint(Material::Plaster, TILES[number * 5 % TILES.len()]).shaded(shade);
    match thing.kind {
        Kind::Block => {
            let walls = paint(Material::Facade, colour).shaded(shade);
            body.block(thing.height_m as f32, walls, mesh);
        }
        Kind::Barn => {
            let walls = paint(Material::Plaster, colour).shaded(shade);
            let rise = 0.4 * thing.height_m as f32;
            body.gabled(thing.height_m as f32 - rise, rise, walls, roof, mesh);
        }
        _ => {
            let walls = paint(Material::Facade, colour).shaded(shade);
            // Whole storeys; the roof stands on them.
            let storeys = (thing.height_m as f32 / STOREY_M).floor().max(1.0);
            let span = thing.footprint.half_m.min_element() as f32;
            let rise = PITCH[number % PITCH.len()] * span.min(5.0);
            let eaves_m = storeys * STOREY_M + 0.3;
            match number % 4 {
                0 => body.hipped(eaves_m, rise, walls, roof, mesh),
                _ => body.gabled(eaves_m, rise, walls, roof, mesh),
            }
            body.chimney(eaves_m + rise, mesh);
        }
    }
}

struct Body {
    footprint: Footprint,
    ground_m: f32,
    number: usize,
}

impl Body {
    /// A place from the middle, along the front, inwards and up, m.
    fn place(&self, along_m: f32, aside_m: f32, up_m: f32) -> Vec3 {
        let Footprint { centre_m, forward, .. } = self.footprint;
        let place = centre_m + forward * f64::from(along_m) + forward.perp() * f64::from(aside_m);
        place.extend(f64::from(self.ground_m + up_m)).as_vec3()
    }

    fn half_m(&self) -> Vec2 {
        let DVec2 { x, y } = self.footprint.half_m;
        Vec2::new(x as f32, y as f32)
    }

    /// Four walls up to a height.
    fn walls(&self, height_m: f32, paint: Paint, mesh: &mut Mesh) {
        let Vec2 { x, y } = self.half_m();
        // Counter-clockwise from above: outside is on the right of each.
        let corners = [[-x, -y], [x, -y], [x, y], [-x, y]];
        for (k, from) in corners.iter().enumerate() {
            let to = corners[(k + 1) % 4];
            let length_m = Vec2::from(*from).distance(Vec2::from(to));
            let bays_m = (length_m / BAY_M).round().max(1.0) * BAY_M;
            let corner = |[along, aside]: [f32; 2], at_m: f32, up_m: f32| {
                (self.place(along, aside, up_m), Vec2::new(at_m, up_m))
            };
            let outline = [
                corner(*from, 0.0, -FOOT_M),
                corner(to, bays_m, -FOOT_M),
                corner(to, bays_m, height_m),
                corner(*from, 0.0, height_m),
            ];
            mesh.textured_face(&outline, paint);
        }
    }

    /// A flat roof behind a parapet, with a box of machines on it.
    fn block(&self, height_m: f32, walls: Paint, mesh: &mut Mesh) {
        let roof = paint(Material::Plaster, FLAT_ROOF);
        let rim = Paint { material: Material::Plaster, ..walls }.shaded(0.9);
        self.walls(height_m, walls, mesh);
        let outer = self.half_m();
        let inner = outer - PARAPET_WIDTH_M;
        let low_m = height_m - PARAPET_M;
        let ring = |half: Vec2, up_m: f32| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(i, j)| self.place(i * half.x, j * half.y, up_m))
        };
        let (outside, inside, floor) =
            (ring(outer, height_m), ring(inner, height_m), ring(inner, low_m));
        mesh.face(&floor, roof);
        for k in 0..4 {
            let next = (k + 1) % 4;
            mesh.face(&[outside[k], outside[next], inside[next], inside[k]], rim);
            mesh.face(&[inside[k], inside[next], floor[next], floor[k]], rim);
        }
        let half = Vec2::new(2.0, 1.6).min(0.4 * inner);
        let aside = 0.3 * inner * if self.number.is_multiple_of(2) { 1.0 } else { -1.0 };
        let corners = |up_m: f32| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(i, j)| self.place(aside.x + i * half.x, aside.y + j * half.y, up_m))
                .to_vec()
        };
        mesh.closed_loft(&[corners(low_m - 0.1), corners(height_m + 1.2)], roof.shaded(1.2));
    }

    /// The outline of the eaves, from the lower left corner, and the ends of the ridge.
    fn roof(&self, eaves_m: f32, rise_m: f32, hip_m: f32) -> ([Vec3; 4], [Vec3; 2]) {
        let half = self.half_m();
        let is_long = half.x >= half.y;
        let (long, short) = if is_long { (half.x, half.y) } else { (half.y, half.x) };
        let at = |along: f32, across: f32, up: f32| match is_long {
            true => self.place(along, across, up),
            // Turned a quarter, so that the outline stays counter-clockwise.
            false => self.place(-across, along, up),
        };
        let (long_m, short_m) = (long + EAVES_M, short + EAVES_M);
        let low_m = eaves_m - EAVES_M * rise_m / short;
        let eaves =
            [(-long_m, -short_m), (long_m, -short_m), (long_m, short_m), (-long_m, short_m)];
        let ridge = [-1.0, 1.0].map(|end: f32| at(end * (long_m - hip_m), 0.0, eaves_m + rise_m));
        (eaves.map(|(along, across)| at(along, across, low_m)), ridge)
    }

    fn gabled(&self, eaves_m: f32, rise_m: f32, walls: Paint, roof: Paint, mesh: &mut Mesh) {
        self.walls(eaves_m, walls, mesh);
        let (eaves, ridge) = self.roof(eaves_m, rise_m, 0.0);
        let board = roof.shaded(0.8);
        mesh.face(&[eaves[0], eaves[1], ridge[1], ridge[0]], roof);
        mesh.face(&[eaves[2], eaves[3], ridge[0], ridge[1]], roof);
        // Seen from below.
        mesh.face(&[eaves[1], eaves[0], ridge[0], ridge[1]], board);
        mesh.face(&[eaves[3], eaves[2], ridge[1], ridge[0]], board);
        // The gables stand on the walls, within the roof.
        let plain = Paint { material: Material::Plaster, ..walls };
        for (from, to, end) in [(1, 2, 1), (3, 0, 0)] {
            let middle = 0.5 * (eaves[from] + eaves[to]);
            let inwards = (ridge[1 - end] - ridge[end]).normalize_or(Vec3::X) * EAVES_M;
            let top = ridge[end] + inwards;
            let share = (eaves[from].distance(middle) - EAVES_M) / eaves[from].distance(middle);
            let foot = |corner: Vec3| {
                let place = middle.lerp(corner, share) + inwards;
                Vec3::new(place.x, place.y, self.ground_m + eaves_m)
            };
            mesh.face(&[foot(eaves[from]), foot(eaves[to]), top], plain);
        }
    }

    fn hipped(&self, eaves_m: f32, rise_m: f32, walls: Paint, roof: Paint, mesh: &mut Mesh) {
        self.walls(eaves_m, walls, mesh);
        let short_m = self.half_m().min_element() + EAVES_M;
        let (eaves, ridge) = self.roof(eaves_m, rise_m, short_m);
        mesh.face(&[eaves[0], eaves[1], ridge[1], ridge[0]], roof);
        mesh.face(&[eaves[2], eaves[3], ridge[0], ridge[1]], roof);
        mesh.face(&[eaves[1], eaves[2], ridge[1]], roof.shaded(0.95));
        mesh.face(&[eaves[3], eaves[0], ridge[0]], roof.shaded(0.95));
        let below: Vec<Vec3> = eaves.iter().rev().copied().collect();
        mesh.face(&below, roof.shaded(0.8));
    }

    fn chimney(&self, top_m: f32, mesh: &mut Mesh) {
        let along = 0.35 * self.half_m().x * if self.number.is_multiple_of(2) { 1.0 } else { -1.0 };
        let ring = |up_m: f32| {
            [(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)]
                .map(|(i, j)| self.place(along + i, 0.4 + j, up_m))
                .to_vec()
        };
        let paint = paint(Material::Plaster, CHIMNEY);
        let rings = [ring(top_m - 1.8), ring(top_m + 0.7)];
        mesh.closed_loft(&rings, paint);
    }
}
