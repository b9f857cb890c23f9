//! The dark below vehicles and people, where little of the sky is seen.

use glam::{Vec2, Vec3, Vec3A};

use crate::{
    scene::instant::{Body, Instant},
    sensors::camera::{
        curves::smooth,
        facets::Facet,
        raster::{NOTHING, Visibility},
        view::{NEAR_M, View},
    },
};

/// Bodies further away than this leave none that could be seen, m.
const REACH_M: f32 = 70.0;

/// How far beyond its outline a body darkens the ground, m.
const MARGIN_M: f32 = 0.55;

/// Share of the sky's light that is left below a body.
const LEFT: f32 = 0.3;

/// Share of the sky that pixels on the ground see past bodies; 1 elsewhere.
pub fn openness(
    view: &View,
    visibility: &Visibility,
    facets: &[Facet],
    instant: &Instant,
    openness: &mut [f32],
) {
    openness.fill(1.0);
    for body in &instant.bodies {
        let place_m = Vec3::from(body.world_from_body.translation);
        if place_m.distance(view.eye_m) < REACH_M {
            darken(view, visibility, facets, body, openness);
        }
    }
}

fn darken(
    view: &View,
    visibility: &Visibility,
    facets: &[Facet],
    body: &Body,
    openness: &mut [f32],
) {
    let places = body.mesh.vertices.iter().map(|vertex| vertex.position_m.truncate());
    let (low, high) = places
        .fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)));
    if low.x > high.x {
        return;
    }
    let (low, high) = (low - MARGIN_M, high + MARGIN_M);
    let corners = [low, Vec2::new(high.x, low.y), high, Vec2::new(low.x, high.y)];
    let seen = corners.map(|at| view.seen_m(body.world_from_body.transform_point3(at.extend(0.0))));
    if seen.iter().any(|corner| corner.z < NEAR_M) {
        return;
    }
    let at_px = seen.map(|corner| view.project_px(corner));
    let lowest = at_px.iter().copied().fold(Vec2::INFINITY, Vec2::min);
    let highest = at_px.iter().copied().fold(Vec2::NEG_INFINITY, Vec2::max);
    let pixel = |place: f32, end: usize| (place.max(0.0) as usize).min(end);
    let columns = pixel(lowest.x, view.width)..pixel(highest.x + 1.0, view.width);
    let rows = pixel(lowest.y, view.height)..pixel(highest.y + 1.0, view.height);
    let body_from_world = body.world_from_body.inverse();
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5 - MARGIN_M);
    for row in rows {
        for column in columns.clone() {
            let place = row * view.width + column;
            let facet = visibility.facet[place];
            if facet == NOTHING {
                continue;
            }
            let facet = &facets[facet as usize];
            if facet.body.is_some() || facet.normal.z < 0.7 {
                continue;
            }
            let ray = view.ray(Vec2::new(column as f32 + 0.5, row as f32 + 0.5));
            let at_m = view.eye_m + ray / visibility.nearness[place];
            let local = body_from_world.transform_point3a(Vec3A::from(at_m));
            let outside = (Vec2::new(local.x, local.y) - middle).abs() - half;
            let distance_m = outside.max(Vec2::ZERO).length();
            if local.z.abs() < 0.5 {
                let left = LEFT + (1.0 - LEFT) * smooth(0.0, MARGIN_M, distance_m);
                openness[place] = openness[place].min(left);
            }
        }
    }
}
