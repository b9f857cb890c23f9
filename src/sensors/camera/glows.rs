//! The light around lamps that look into the camera.

use glam::Vec3A;

use crate::{
    scene::mesh::Material,
    sensors::camera::{
        curves::fade,
        lamps::Lamp,
        light::Light,
        raster::Visibility,
        view::{NEAR_M, View},
    },
};

/// Add the glow of each lamp that is not hidden.
pub fn add(
    view: &View,
    visibility: &Visibility,
    light: &Light,
    lamps: &[Lamp],
    radiance: &mut [Vec3A],
) {
    // By day eye and sensor hardly notice.
    let dazzle = if light.exposure > 2.0 { 1.0 } else { 0.4 };
    for lamp in lamps {
        let seen_m = view.seen_m(lamp.place_m);
        if seen_m.z < NEAR_M {
            continue;
        }
        let at_px = view.project_px(seen_m);
        let (width, height) = (view.width as f32, view.height as f32);
        if at_px.x < 0.0 || at_px.y < 0.0 || at_px.x >= width || at_px.y >= height {
            continue;
        }
        let place = at_px.y as usize * view.width + at_px.x as usize;
        let distance_m = seen_m.length();
        // Its own glass lies around the middle of a lamp.
        if visibility.nearness[place] > 1.0 / (seen_m.z - 0.5).max(NEAR_M) {
            continue;
        }
        let to_eye = (view.eye_m - lamp.place_m) / distance_m;
        let facing = lamp.direction.dot(to_eye);
        let share = match lamp.material {
            Material::StreetLamp => 0.7,
            Material::HeadLamp => facing.max(0.0).powi(4) * 1.2,
            _ => facing.max(0.0) * 0.5,
        };
        let strength = share * dazzle * fade(0.6 * light.haze_per_m * distance_m);
        let scale = view.focal_px.x / 250.0 * (1.0 + 0.8 * light.rain);
        let radius_px = scale * (2.5 + 45.0 / (distance_m + 2.0)) * (0.5 + share.min(1.0));
        splash(at_px.to_array(), radius_px, lamp.glow * strength, view, radiance);
    }
}

/// A bright middle and a wide rim.
fn splash([x, y]: [f32; 2], radius_px: f32, colour: Vec3A, view: &View, radiance: &mut [Vec3A]) {
    let pixels = |middle: f32, end: usize| {
        let low = ((middle - radius_px).max(0.0) as usize).min(end);
        low..((middle + radius_px + 1.0).max(0.0) as usize).min(end)
    };
    for row in pixels(y, view.height) {
        for column in pixels(x, view.width) {
            let (dx, dy) = (column as f32 + 0.5 - x, row as f32 + 0.5 - y);
            let left = (1.0 - (dx * dx + dy * dy) / (radius_px * radius_px)).max(0.0);
            let squared = left * left;
            let core = squared * squared;
            radiance[row * view.width + column] += colour * (0.12 * squared + 0.5 * core * core);
        }
    }
}
