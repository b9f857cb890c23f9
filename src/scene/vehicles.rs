//! Vehicles on four and more wheels, low in detail: bodies drawn through cross-sections, wheels,
//! lamps and plates.
//!
//! Body frame: x forward, y left, z up; the origin lies on the ground below the middle.

use glam::{Vec2, Vec3};

use crate::scene::{
    mesh::{Material, Mesh},
    solids::{Paint, circle, paint},
};

/// Takes the colour of the body.
const COACHWORK: Paint = paint(Material::Coachwork, [200, 200, 200]);
const GLASS: Paint = paint(Material::Glass, [38, 46, 54]);
const RUBBER: Paint = paint(Material::Rubber, [34, 34, 36]);
const RIM: Paint = paint(Material::Metal, [150, 152, 156]);
const TRIM: Paint = paint(Material::Rubber, [52, 53, 56]);
const STEEL: Paint = paint(Material::Metal, [120, 122, 126]);
const PLATE: Paint = paint(Material::Plaster, [232, 232, 226]);
const HEAD: Paint = paint(Material::HeadLamp, [236, 240, 244]);
const TAIL: Paint = paint(Material::TailLamp, [150, 22, 24]);
const BRAKE: Paint = paint(Material::BrakeLamp, [172, 30, 28]);
const WHITE_BOX: Paint = paint(Material::Plaster, [222, 222, 218]);
const CARGO: Paint = paint(Material::Plaster, [124, 104, 82]);

/// What the stretch from one cross-section to the next is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stretch {
    /// Bonnet, boot, or a post between windows.
    Solid,
    /// Windows at the sides, a roof above.
    Cabin,
    /// Windows at the sides and a sloping one above: windscreen, rear window.
    Screen,
}

/// Across the body: heights and half widths of its underside, its widest part, the lower edge of
/// its windows, and its top.
#[derive(Clone, Copy, Debug)]
struct Section {
    x_m: f32,
    z_m: [f32; 4],
    half_m: [f32; 4],
    /// What lies before it.
    then: Stretch,
}

const fn section(x_m: f32, z_m: [f32; 4], half_m: [f32; 4], then: Stretch) -> Section {
    Section { x_m, z_m, half_m, then }
}

use Stretch::{Cabin, Screen, Solid};

impl Section {
    /// From the lower left over the top to the lower right.
    fn ring(&self) -> Vec<Vec3> {
        let left = (0..4).map(|k| Vec3::new(self.x_m, self.half_m[k], self.z_m[k]));
        let right = (0..4).rev().map(|k| Vec3::new(self.x_m, -self.half_m[k], self.z_m[k]));
        left.chain(right).collect()
    }

    /// The band between two of its heights, as seen from the front or from the rear.
    fn band(&self, low: usize, is_front: bool) -> [Vec3; 4] {
        let left = if is_front { -1.0 } else { 1.0 };
        let at = |side: f32, k: usize| Vec3::new(self.x_m, side * self.half_m[k], self.z_m[k]);
        [at(left, low), at(-left, low), at(-left, low + 1), at(left, low + 1)]
    }
}

/// A body through cross-sections from the rear to the front.
fn coachwork(sections: &[Section], skin: Paint, mesh: &mut Mesh) {
    let rings: Vec<Vec<Vec3>> = sections.iter().map(Section::ring).collect();
    mesh.loft(&rings, |index, edge| match (sections[index].then, edge) {
        (_, 7) => TRIM,
        (Cabin | Screen, 2 | 4) => GLASS,
        (Screen, 3) => GLASS,
        _ => skin,
    });
    let (rear, front) = (&sections[0], &sections[sections.len() - 1]);
    // Bumpers with a plate, lamps above them, and what is left up to the top.
    let bumper = |column: usize, _| if column == 1 { PLATE } else { TRIM };
    let plate = [0.36, 0.64];
    mesh.panel(rear.band(0, false), &plate, &[], bumper);
    mesh.panel(front.band(0, true), &plate, &[], bumper);
    mesh.panel(rear.band(1, false), &[0.14, 0.24, 0.76, 0.86], &[], |column, _| match column {
        0 | 4 => TAIL,
        1 | 3 => BRAKE,
        _ => skin,
    });
    mesh.panel(front.band(1, true), &[0.22, 0.3, 0.7, 0.78], &[], |column, _| match column {
        0 | 4 => HEAD,
        2 => TRIM,
        _ => skin,
    });
    mesh.face(&rear.band(2, false), if rear.then == Screen { GLASS } else { skin });
    mesh.face(&front.band(2, true), if front.then == Screen { GLASS } else { skin });
}

/// A wheel whose outer face lies at `y_m`; it is `width_m` wide towards the middle.
fn wheel(x_m: f32, y_m: f32, radius_m: f32, width_m: f32, mesh: &mut Mesh) {
    const SIDES: usize = 8;
    let outwards = Vec3::Y * y_m.signum();
    let outer = Vec3::new(x_m, y_m, radius_m);
    let inner = outer - outwards * width_m;
    let tread = [inner, outer].map(|centre| circle(centre, outwards, radius_m, SIDES));
    mesh.loft(&tread, |_, _| RUBBER);
    let back: Vec<Vec3> = tread[0].iter().rev().copied().collect();
    mesh.face(&back, RUBBER);
    let rim = circle(outer - outwards * 0.03, outwards, 0.62 * radius_m, SIDES);
    mesh.loft(&[tread[1].clone(), rim.clone()], |_, _| RUBBER);
    mesh.face(&rim, RIM);
}

/// Wheels of axles at `axles_m`, on both sides.
fn wheels(axles_m: &[f32], half_width_m: f32, radius_m: f32, width_m: f32, mesh: &mut Mesh) {
    for x_m in axles_m {
        wheel(*x_m, half_width_m, radius_m, width_m, mesh);
        wheel(*x_m, -half_width_m, radius_m, width_m, mesh);
    }
}

/// Mirrors at both sides, m from the middle.
fn mirrors(x_m: f32, y_m: f32, z_m: f32, mesh: &mut Mesh) {
    for side in [-1.0_f32, 1.0] {
        let ends = [y_m - 0.06, y_m + 0.12].map(|y| Vec3::new(x_m, side * y, z_m));
        mesh.limb(ends, Vec3::X, [Vec2::new(0.06, 0.07); 2], TRIM);
    }
}

/// Where a car's outline changes, m from the middle: ends of the boot lid, the roof and the bonnet.
struct Car {
    /// Of the rear end's top edge, and of the rear window's foot and head.
    boot_m: [f32; 2],
    roof_rear_m: f32,
    roof_front_m: f32,
    screen_foot_m: f32,
    /// Of the boot's lid.
    boot_height_m: f32,
    roof_height_m: f32,
}

/// A car of 4.6 x 1.84 x 1.48 m.
fn car(shape: &Car) -> Mesh {
    let Car { boot_m, roof_rear_m, roof_front_m, screen_foot_m, boot_height_m, roof_height_m } =
        *shape;
    let boot = boot_height_m;
    let low = |top: f32| [0.2, 0.62, 0.93, top];
    let (body, roof) = ([0.85, 0.92, 0.87, 0.74], [0.85, 0.92, 0.87, 0.60]);
    let door_m = 0.5 * (roof_rear_m + roof_front_m) - 0.05;
    let mut sections = vec![
        section(-2.3, [0.34, 0.56, 0.84, boot - 0.06], [0.78, 0.84, 0.8, 0.7], Solid),
        section(-2.12, [0.24, 0.6, 0.9, boot], [0.84, 0.91, 0.86, 0.74], Solid),
    ];
    if boot_m[1] > -2.1 {
        sections.push(section(boot_m[1], low(boot.max(0.96)), body, Screen));
    } else {
        sections[1].then = Screen;
    }
    let head = roof_height_m - 0.02;
    sections.extend([
        section(roof_rear_m, low(head), roof, Cabin),
        section(door_m - 0.05, low(roof_height_m), roof, Solid),
        section(door_m + 0.05, low(roof_height_m), roof, Cabin),
        section(roof_front_m, low(head), roof, Screen),
        section(screen_foot_m, low(1.0), [0.85, 0.92, 0.87, 0.76], Solid),
        section(1.95, [0.22, 0.6, 0.82, 0.88], [0.84, 0.91, 0.84, 0.66], Solid),
        section(2.3, [0.32, 0.54, 0.72, 0.75], [0.74, 0.8, 0.76, 0.6], Solid),
    ]);
    let mut mesh = Mesh::default();
    coachwork(&sections, COACHWORK, &mut mesh);
    wheels(&[-1.38, 1.38], 0.92, 0.33, 0.22, &mut mesh);
    mirrors(0.75, 0.9, 1.0, &mut mesh);
    mesh
}

/// Cars: saloon, hatchback, estate, coupe.
pub fn cars() -> Vec<Mesh> {
    let saloon = Car {
        boot_m: [-2.3, -1.5],
        roof_rear_m: -0.85,
        roof_front_m: 0.4,
        screen_foot_m: 1.15,
        boot_height_m: 1.0,
        roof_height_m: 1.48,
    };
    let hatchback = Car {
        boot_m: [-2.3, -2.2],
        roof_rear_m: -1.5,
        boot_height_m: 0.98,
        roof_front_m: 0.45,
        ..saloon
    };
    let estate = Car { roof_rear_m: -1.88, ..hatchback };
    let coupe = Car { boot_m: [-2.3, -1.85], roof_rear_m: -0.55, roof_front_m: 0.2, ..saloon };
    [saloon, hatchback, estate, coupe].iter().map(car).collect()
}

/// Jeeps, 4.5 x 1.9 x 1.85 m: one with corners, one rounder, with a spare wheel.
pub fn jeeps() -> Vec<Mesh> {
    let square = {
        let low = |top: f32| [0.34, 0.78, 1.12, top];
        let (body, roof) = ([0.88, 0.95, 0.92, 0.84], [0.88, 0.95, 0.92, 0.82]);
        vec![
            section(-2.25, [0.42, 0.76, 1.1, 1.7], [0.86, 0.92, 0.9, 0.78], Solid),
            section(-2.12, low(1.82), roof, Cabin),
            section(-1.0, low(1.85), roof, Solid),
            section(-0.9, low(1.85), roof, Cabin),
            section(0.0, low(1.85), roof, Solid),
            section(0.1, low(1.85), roof, Cabin),
            section(0.62, low(1.81), roof, Screen),
            section(0.95, low(1.2), body, Solid),
            section(2.12, [0.36, 0.78, 1.08, 1.14], [0.86, 0.94, 0.9, 0.8], Solid),
            section(2.25, [0.42, 0.72, 1.0, 1.05], [0.84, 0.9, 0.88, 0.78], Solid),
        ]
    };
    let round = {
        let low = |top: f32| [0.28, 0.72, 1.06, top];
        let (body, roof) = ([0.87, 0.95, 0.9, 0.78], [0.87, 0.95, 0.9, 0.66]);
        vec![
            section(-2.25, [0.4, 0.66, 1.0, 1.06], [0.8, 0.87, 0.84, 0.74], Solid),
            section(-2.1, [0.3, 0.7, 1.04, 1.14], [0.85, 0.93, 0.88, 0.76], Screen),
            section(-1.7, low(1.78), roof, Cabin),
            section(-0.75, low(1.84), roof, Solid),
            section(-0.65, low(1.85), roof, Cabin),
            section(0.4, low(1.79), roof, Screen),
            section(1.1, low(1.15), body, Solid),
            section(1.95, [0.3, 0.7, 0.98, 1.04], [0.85, 0.94, 0.88, 0.72], Solid),
            section(2.25, [0.38, 0.64, 0.86, 0.9], [0.78, 0.84, 0.8, 0.66], Solid),
        ]
    };
    [square, round]
        .iter()
        .map(|sections| {
            let mut mesh = Mesh::default();
            coachwork(sections, COACHWORK, &mut mesh);
            wheels(&[-1.35, 1.35], 0.95, 0.39, 0.25, &mut mesh);
            mirrors(0.85, 0.93, 1.2, &mut mesh);
            mesh
        })
        .collect()
}

/// Vans, 5.4 x 1.98 x 2.4 m: for goods, and with windows all along.
pub fn vans() -> Vec<Mesh> {
    [Solid, Cabin]
        .iter()
        .map(|behind| {
            let low = |top: f32| [0.26, 0.7, 1.2, top];
            let (body, roof) = ([0.92, 0.99, 0.96, 0.84], [0.92, 0.99, 0.97, 0.86]);
            let sections = [
                section(-2.7, [0.36, 0.66, 1.2, 2.3], [0.9, 0.96, 0.94, 0.84], Solid),
                section(-2.6, low(2.38), roof, *behind),
                section(-1.2, low(2.4), roof, Solid),
                section(-1.1, low(2.4), roof, *behind),
                section(0.25, low(2.4), roof, Solid),
                section(0.4, low(2.4), roof, Cabin),
                section(1.15, low(2.3), roof, Screen),
                section(1.95, low(1.35), body, Solid),
                section(2.5, [0.28, 0.68, 1.05, 1.12], [0.9, 0.96, 0.92, 0.78], Solid),
                section(2.7, [0.36, 0.62, 0.92, 0.96], [0.84, 0.9, 0.86, 0.74], Solid),
            ];
            let mut mesh = Mesh::default();
            coachwork(&sections, COACHWORK, &mut mesh);
            wheels(&[-1.62, 1.62], 0.99, 0.36, 0.24, &mut mesh);
            mirrors(1.6, 0.97, 1.45, &mut mesh);
            mesh
        })
        .collect()
}

/// Trucks, 8.2 x 2.44 x 3.4 m: with a box, and with a tipping body.
pub fn trucks() -> Vec<Mesh> {
    [true, false]
        .iter()
        .map(|has_box| {
            let mut mesh = Mesh::default();
            let low = |top: f32| [0.6, 1.0, 1.7, top];
            let (wall, top) = ([1.14, 1.18, 1.18, 1.12], [1.14, 1.18, 1.18, 1.08]);
            let cab = [
                section(2.05, low(2.75), wall, Solid),
                section(2.45, low(2.85), top, Cabin),
                section(3.5, low(2.82), top, Screen),
                section(3.98, [0.55, 1.0, 1.62, 1.72], [1.14, 1.18, 1.16, 1.1], Solid),
                section(4.1, [0.55, 0.95, 1.5, 1.6], [1.1, 1.14, 1.12, 1.06], Solid),
            ];
            coachwork(&cab, COACHWORK, &mut mesh);
            // The frame, and below its end lamps, a plate and a bar.
            mesh.cuboid(Vec3::new(-4.0, -0.45, 0.72), Vec3::new(2.1, 0.45, 1.02), STEEL);
            truck_end(&mut mesh);
            if *has_box {
                mesh.cuboid(Vec3::new(-4.1, -1.22, 1.0), Vec3::new(1.95, 1.22, 3.4), WHITE_BOX);
            } else {
                tipper(&mut mesh);
            }
            wheels(&[-3.0, -1.9, 2.95], 1.2, 0.5, 0.42, &mut mesh);
            mirrors(3.55, 1.16, 2.1, &mut mesh);
            mesh
        })
        .collect()
}

fn truck_end(mesh: &mut Mesh) {
    mesh.cuboid(Vec3::new(-4.06, -1.1, 0.5), Vec3::new(-3.96, 1.1, 0.62), STEEL);
    // Its rear face is the panel with the lamps.
    let (low, high) = (Vec3::new(-4.08, -1.18, 0.66), Vec3::new(-3.9, 1.18, 0.96));
    let corners = [
        Vec3::new(low.x, high.y, low.z),
        Vec3::new(low.x, low.y, low.z),
        Vec3::new(low.x, low.y, high.z),
        Vec3::new(low.x, high.y, high.z),
    ];
    let rear: Vec<Vec3> = [0, 3, 2, 1].map(|corner: usize| corners[corner]).to_vec();
    let front: Vec<Vec3> = rear.iter().map(|corner| Vec3 { x: high.x, ..*corner }).collect();
    mesh.loft(&[rear, front.clone()], |_, _| TRIM);
    mesh.face(&front, TRIM);
    mesh.panel(corners, &[0.1, 0.2, 0.42, 0.58, 0.8, 0.9], &[], |column, _| match column {
        0 | 6 => TAIL,
        1 | 5 => BRAKE,
        3 => PLATE,
        _ => TRIM,
    });
}

/// A body of steel for gravel, with a shield above the cab.
fn tipper(mesh: &mut Mesh) {
    let ring = |x: f32, top: f32| {
        vec![
            Vec3::new(x, 1.05, 1.02),
            Vec3::new(x, 1.22, top),
            Vec3::new(x, -1.22, top),
            Vec3::new(x, -1.05, 1.02),
        ]
    };
    let steel = COACHWORK;
    mesh.closed_loft(&[ring(-4.1, 2.15), ring(-3.9, 2.3), ring(1.8, 2.3)], steel);
    mesh.cuboid(Vec3::new(1.72, -1.22, 1.1), Vec3::new(1.92, 1.22, 3.4), steel);
    mesh.cuboid(Vec3::new(1.9, -1.15, 3.3), Vec3::new(3.2, 1.15, 3.4), steel);
    let heap = |x: f32, half: f32, z: f32| Vec3::new(x, half, z);
    let foot = [
        heap(-3.8, -1.1, 2.28),
        heap(1.7, -1.1, 2.28),
        heap(1.7, 1.1, 2.28),
        heap(-3.8, 1.1, 2.28),
    ];
    let ridge = [heap(-2.3, 0.0, 2.85), heap(0.6, 0.0, 2.95)];
    mesh.face(&[foot[0], foot[1], ridge[1], ridge[0]], CARGO);
    mesh.face(&[foot[2], foot[3], ridge[0], ridge[1]], CARGO);
    mesh.face(&[foot[1], foot[2], ridge[1]], CARGO);
    mesh.face(&[foot[3], foot[0], ridge[0]], CARGO);
    mesh.face(&[foot[3], foot[2], foot[1], foot[0]], CARGO);
}

/// Buses, 11.2 x 2.5 x 3.1 m: for towns, with doors, and for journeys.
pub fn buses() -> Vec<Mesh> {
    [[0.38, 0.95], [0.4, 1.35]]
        .iter()
        .map(|[floor_m, sill_m]| {
            let low = |top: f32| [*floor_m, 0.8, *sill_m + 0.05, top];
            let (wall, half) = ([1.2, 1.25, 1.24, 1.14], [1.18, 1.22, 1.21, 1.1]);
            let mut sections =
                vec![section(-5.6, low(2.96), half, Screen), section(-5.5, low(3.06), wall, Solid)];
            let pitch_m = 1.72;
            for window in 0..6 {
                let x_m = -5.2 + pitch_m * window as f32;
                sections.push(section(x_m, low(3.1), wall, Cabin));
                sections.push(section(x_m + pitch_m - 0.12, low(3.1), wall, Solid));
            }
            sections.extend([
                section(5.15, low(3.08), wall, Cabin),
                section(5.5, low(3.04), wall, Screen),
                section(5.6, [*floor_m, 0.75, *sill_m, 2.75], half, Screen),
            ]);
            let mut mesh = Mesh::default();
            coachwork(&sections, COACHWORK, &mut mesh);
            wheels(&[-2.9, 2.92], 1.25, 0.5, 0.3, &mut mesh);
            mesh
        })
        .collect()
}
