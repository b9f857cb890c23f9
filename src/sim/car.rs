//! What a car looks like: body, cabin, wheels, windows and lamps.

use glam::{DAffine3, DVec3};

use crate::{
    sim::scene::{Decal, Paint, Rgb, Scene, Shape, Solid},
    world::ego::SEDAN,
};

/// Colours that cars come in.
pub const PAINTS: [Rgb; 7] = [
    [176, 30, 34],
    [34, 66, 140],
    [222, 222, 226],
    [46, 48, 52],
    [140, 146, 152],
    [196, 150, 40],
    [40, 104, 72],
];

const GLASS: Rgb = [38, 48, 58];
const TYRE: Rgb = [26, 26, 28];
const BODY_FROM_M: f64 = 0.28;
const BODY_HEIGHT_M: f64 = 0.58;
const CABIN_HEIGHT_M: f64 = 0.54;

/// Height of the whole car, m.
pub const HEIGHT_M: f64 = BODY_FROM_M + BODY_HEIGHT_M + CABIN_HEIGHT_M;

/// A car at one instant; its frame sits on the ground below its middle, x forward.
#[derive(Clone, Copy, Debug)]
pub struct Car {
    pub world_from_car: DAffine3,
    /// World frame, m/s.
    pub velocity_mps: DVec3,
    pub paint: Rgb,
    pub braking: bool,
}

impl Car {
    /// Put the car into a scene.
    pub fn add_to(&self, scene: &mut Scene) {
        let mut add = |shape: Shape, top: Rgb, sides: Rgb, reflectivity: f64| {
            let solid = Solid::new(&self.world_from_car, shape, Paint { top, sides }, reflectivity);
            scene.solids.push(solid.moving(self.velocity_mps));
        };
        let body = Shape {
            foot_m: DVec3::new(0.0, 0.0, BODY_FROM_M),
            height_m: BODY_HEIGHT_M,
            lower_m: [SEDAN.half_length_m, SEDAN.half_width_m],
            upper_m: [SEDAN.half_length_m - 0.12, SEDAN.half_width_m - 0.06],
            lean_m: 0.0,
        };
        let cabin = Shape {
            foot_m: DVec3::new(-0.25, 0.0, BODY_FROM_M + BODY_HEIGHT_M),
            height_m: CABIN_HEIGHT_M,
            lower_m: [1.45, SEDAN.half_width_m - 0.08],
            upper_m: [0.85, SEDAN.half_width_m - 0.24],
            lean_m: -0.1,
        };
        add(body, self.paint, self.paint, 0.6);
        add(cabin, self.paint, GLASS, 0.3);
        for (x, y) in [(1.45, 0.835), (1.45, -0.835), (-1.44, 0.835), (-1.44, -0.835)] {
            add(Shape::block(DVec3::new(x, y, 0.0), [0.32, 0.11], 0.62), TYRE, TYRE, 0.1);
        }
        self.add_lamps(scene);
        let spread = |x: f64, y: f64| {
            let ground = self.world_from_car.transform_point3(DVec3::new(x, y, 0.0));
            // The sun stands to the south-west, so shadows fall a little the other way.
            ground + DVec3::new(0.12, 0.25, 0.0)
        };
        let (x, y) = (SEDAN.half_length_m + 0.1, SEDAN.half_width_m + 0.12);
        scene.shadows_m.push([spread(x, y), spread(-x, y), spread(-x, -y), spread(x, -y)]);
    }

    fn add_lamps(&self, scene: &mut Scene) {
        let tail: Rgb = if self.braking { [255, 40, 30] } else { [120, 14, 16] };
        let mut add = |x: f64, y: [f64; 2], z: [f64; 2], colour: Rgb, glows: bool| {
            // The body tapers towards its roof; its lamps stand half a centimetre proud of it.
            let out = |z: f64| {
                let slope = 0.12 * (z - BODY_FROM_M) / BODY_HEIGHT_M;
                x.signum() * (x.abs() - slope + 0.005)
            };
            let corner =
                |y: f64, z: f64| self.world_from_car.transform_point3(DVec3::new(out(z), y, z));
            let (a, b) = if x > 0.0 { (y[0], y[1]) } else { (y[1], y[0]) };
            let corners_m = [corner(a, z[0]), corner(b, z[0]), corner(b, z[1]), corner(a, z[1])];
            scene.decals.push(Decal { corners_m, colour, glows });
        };
        for y in [[0.48, 0.84], [-0.84, -0.48]] {
            add(-SEDAN.half_length_m, y, [0.58, 0.76], tail, self.braking);
            add(SEDAN.half_length_m, y, [0.55, 0.72], [250, 248, 225], true);
        }
        add(-SEDAN.half_length_m, [-0.26, 0.26], [0.5, 0.62], [235, 232, 200], false);
        add(SEDAN.half_length_m, [-0.4, 0.4], [0.4, 0.56], [30, 30, 32], false);
    }
}
