//! The simulated camera: where things land, what hides what, and what light and weather leave of them.

use glam::{Affine3A, DAffine3, DQuat, DVec3, Quat, Vec2, Vec3};
use pmp::{
    noise::{Noise, Purpose},
    projection,
    scene::{
        conditions::{Illumination, Sky, Weather},
        instant::{Body, Instant},
        mesh::{Material, Mesh, Triangle, Vertex},
        shapes::Shapes,
        surroundings::{Surroundings, Tile},
    },
    sensors::camera::{Camera, CameraConfig},
    world::kind::WalkerKind,
};

use crate::scene::somebody;

const WIDTH: usize = 600;
const DAY: Sky = Sky { illumination: Illumination::Daytime, weather: Weather::Clear };
const DARK: Sky = Sky { illumination: Illumination::Dark, weather: Weather::Clear };

fn tile(mesh: Mesh) -> Tile {
    let places = || mesh.vertices.iter().map(|vertex| vertex.position_m);
    let low_m = places().fold(Vec3::INFINITY, Vec3::min);
    let high_m = places().fold(Vec3::NEG_INFINITY, Vec3::max);
    Tile { low_m, high_m, mesh: mesh.into() }
}

/// A flat shape: its corners in the order that is counter-clockwise from outside.
fn flat(corners: &[Vec3], material: Material, colour: [u8; 3]) -> Tile {
    let along = (corners[1] - corners[0]).normalize();
    let vertices = corners.iter().map(|corner| {
        let texture_m = match material {
            Material::Facade => Vec2::new((*corner - corners[0]).dot(along), corner.z),
            _ => corner.truncate(),
        };
        Vertex { position_m: *corner, texture_m }
    });
    let triangles =
        (2..corners.len() as u32).map(|i| Triangle { corners: [0, i - 1, i], material, colour });
    tile(Mesh { vertices: vertices.collect(), triangles: triangles.collect() })
}

/// Upright, across the way of a car that looks along x.
fn wall(ahead_m: f32, half_m: f32, height_m: f32, material: Material, colour: [u8; 3]) -> Tile {
    let at = |y: f32, z: f32| Vec3::new(ahead_m, y, z);
    let corners = [at(half_m, 0.0), at(-half_m, 0.0), at(-half_m, height_m), at(half_m, height_m)];
    flat(&corners, material, colour)
}

fn ground(half_m: f32) -> Tile {
    let at = |x: f32, y: f32| Vec3::new(x * half_m, y * half_m, 0.0);
    let corners = [at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)];
    flat(&corners, Material::Asphalt, [82, 82, 84])
}

fn town(tiles: Vec<Tile>) -> Surroundings {
    Surroundings { tiles }
}

fn take(tiles: Vec<Tile>, sky: Sky) -> Vec<u8> {
    let mut camera = Camera::new(CameraConfig::default());
    camera.picture(&town(tiles), &Instant::default(), &DAffine3::IDENTITY, sky, 1).to_vec()
}

fn pixel(picture: &[u8], column: usize, row: usize) -> [u8; 3] {
    let start = 3 * (row * WIDTH + column);
    [picture[start], picture[start + 1], picture[start + 2]]
}

/// In [0, 1], as a screen shows it.
fn luminance([r, g, b]: [u8; 3]) -> f64 {
    (0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)) / 255.0
}

fn luminances(picture: &[u8]) -> Vec<f64> {
    picture.chunks_exact(3).map(|rgb| luminance([rgb[0], rgb[1], rgb[2]])).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Small shining triangles anywhere in view, cameras in any pose and of any size: the pixel that
/// `projection::Camera` names is lit, and what is lit lies around it.
#[test]
fn a_point_lands_on_the_pixel_that_projection_names() {
    let mut noise = Noise::new(3, 0, Purpose::Lidar);
    for round in 0..60 {
        let mut draw = |low: f64, high: f64| noise.uniform(low, high);
        let (width, height) = (draw(40.0, 300.0) as usize, draw(30.0, 200.0) as usize);
        let mut intrinsics = projection::Camera::from_fov(width, height, draw(0.6, 2.0));
        intrinsics.fy *= draw(0.8, 1.2);
        intrinsics.cx += draw(-9.0, 9.0);
        let tilt = DQuat::from_euler(
            glam::EulerRot::ZYX,
            draw(-3.0, 3.0),
            draw(-0.5, 0.5),
            draw(-0.5, 0.5),
        );
        let level = DQuat::from_xyzw(-0.5, 0.5, -0.5, 0.5);
        let place_m = DVec3::new(draw(-300.0, 300.0), draw(-300.0, 300.0), draw(-5.0, 30.0));
        let world_from_camera = DAffine3::from_rotation_translation(tilt * level, place_m);
        let depth_m = draw(1.0, 80.0);
        let at_px = [draw(3.0, width as f64 - 3.0), draw(3.0, height as f64 - 3.0)];
        let seen_m = |[u, v]: [f64; 2]| {
            let (x, y) = ((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy);
            DVec3::new(x, y, 1.0) * depth_m
        };
        // Wide enough to hold the centre of the pixel that its middle lies in.
        let corners = [(0.0, -1.9), (-1.7, 1.0), (1.7, 1.0)].map(|(right, down)| {
            let seen_m = seen_m([at_px[0] + right, at_px[1] + down]);
            world_from_camera.transform_point3(seen_m).as_vec3()
        });
        let tiles = vec![flat(&corners, Material::HeadLamp, [255; 3])];
        let named = intrinsics.pixel(seen_m(at_px).to_array()).unwrap() as usize;
        let config = CameraConfig { intrinsics, ego_from_camera: world_from_camera };
        let mut camera = Camera::new(config);
        let picture =
            camera.picture(&town(tiles), &Instant::default(), &DAffine3::IDENTITY, DARK, 1);
        let bright: Vec<usize> = luminances(picture)
            .iter()
            .enumerate()
            .filter_map(|(place, luminance)| (*luminance > 0.5).then_some(place))
            .collect();
        assert!(bright.contains(&named), "round {round}: {bright:?} without {named}");
        let count = bright.len() as f64;
        let u = bright.iter().map(|place| (place % width) as f64 + 0.5).sum::<f64>() / count;
        let v = bright.iter().map(|place| (place / width) as f64 + 0.5).sum::<f64>() / count;
        assert!((u - at_px[0]).abs() < 0.8 && (v - at_px[1]).abs() < 0.8, "round {round}");
        assert!((2..=9).contains(&bright.len()), "round {round}: {bright:?}");
    }
}

#[test]
fn what_is_nearer_hides_what_is_behind_it_in_either_order() {
    let near = wall(12.0, 2.0, 3.0, Material::Plaster, [220, 20, 20]);
    let far = wall(20.0, 9.0, 6.0, Material::Plaster, [20, 220, 20]);
    let one = take(vec![near.clone(), far.clone()], DAY);
    let other = take(vec![far, near], DAY);
    assert_eq!(one, other);
    let [r, g, _] = pixel(&one, 300, 125);
    assert!(r > 2 * g, "the red wall is in front");
    let [r, g, _] = pixel(&one, 380, 125);
    assert!(g > 2 * r, "the green one beside it");
}

#[test]
fn ground_below_and_behind_the_camera_fills_the_lower_half() {
    // One large square with the camera above its middle, and the same in small ones.
    let large = take(vec![ground(380.0)], DAY);
    let mut tiles = Vec::new();
    for east in -19..19 {
        for north in -19..19 {
            let at = |x: i32, y: i32| {
                Vec3::new((east + x) as f32 * 20.0, (north + y) as f32 * 20.0, 0.0)
            };
            let corners = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            tiles.push(flat(&corners, Material::Asphalt, [82, 82, 84]));
        }
    }
    let small = take(tiles, DAY);
    for row in 128..250 {
        for column in 0..WIDTH {
            let (a, b) = (pixel(&large, column, row), pixel(&small, column, row));
            let difference = (luminance(a) - luminance(b)).abs();
            assert!(difference < 0.06, "row {row}, column {column}: {a:?} {b:?}");
            assert!(a[2] < a[0] + 30, "sky at row {row}, column {column}: {a:?}");
        }
    }
}

#[test]
fn the_same_call_gives_the_same_bytes_whatever_the_camera_saw_before() {
    let tiles = || vec![ground(300.0), wall(30.0, 8.0, 9.0, Material::Facade, [190, 170, 150])];
    let sky = Sky { illumination: Illumination::Night, weather: Weather::Storm };
    let instant = Instant { time_s: 12.3, bodies: vec![walker(0, 15.0, -0.5)] };
    let here = DAffine3::IDENTITY;
    let mut used = Camera::new(CameraConfig::default());
    used.picture(&town(tiles()), &Instant::default(), &here, DAY, 4);
    let again = used.picture(&town(tiles()), &instant, &here, sky, 9).to_vec();
    let mut fresh = Camera::new(CameraConfig::default());
    let picture = fresh.picture(&town(tiles()), &instant, &here, sky, 9).to_vec();
    assert_eq!(again, picture);
    assert_ne!(picture, fresh.picture(&town(tiles()), &instant, &here, sky, 10), "another episode");
    let later = Instant { time_s: 12.4, ..instant };
    assert_ne!(picture, fresh.picture(&town(tiles()), &later, &here, sky, 9), "another moment");
}

/// A street with a house across its end.
fn street() -> Vec<Tile> {
    vec![
        ground(300.0),
        wall(60.0, 14.0, 12.0, Material::Facade, [190, 170, 150]),
        flat(
            &[
                Vec3::new(4.0, 0.1, 0.01),
                Vec3::new(4.0, -0.1, 0.01),
                Vec3::new(40.0, -0.1, 0.01),
                Vec3::new(40.0, 0.1, 0.01),
            ],
            Material::Marking,
            [228, 228, 222],
        ),
    ]
}

fn skies() -> impl Iterator<Item = Sky> {
    let of = |illumination| Weather::ALL.map(|weather| Sky { illumination, weather });
    Illumination::ALL.into_iter().flat_map(of)
}

#[test]
fn each_light_is_darker_than_the_one_before_it() {
    for weather in Weather::ALL {
        let brightness = Illumination::ALL
            .map(|illumination| mean(&luminances(&take(street(), Sky { illumination, weather }))));
        let ordered = brightness.is_sorted_by(|a, b| *a > 1.15 * b);
        assert!(ordered, "{}: {brightness:?}", weather.name());
    }
}

/// The edge between a dark house and the sky beside it, in the distance.
#[test]
fn rain_takes_the_contrast_from_what_is_far_away() {
    let contrasts = Weather::ALL.map(|weather| {
        let house = || wall(110.0, 20.0, 30.0, Material::Plaster, [60, 50, 45]);
        let sky = Sky { illumination: Illumination::Daytime, weather };
        let (with, without) = (take(vec![house()], sky), take(vec![], sky));
        let (with, without) = (luminances(&with), luminances(&without));
        let differences: Vec<f64> = (90..120)
            .flat_map(|row| (280..320).map(move |column| row * WIDTH + column))
            .map(|place| (with[place] - without[place]).abs())
            .collect();
        mean(&differences)
    });
    assert!(contrasts.is_sorted_by(|a, b| *a > 1.2 * b), "{contrasts:?}");
    assert!(contrasts[3] < 0.2 * contrasts[0], "{contrasts:?}");
}

/// A red wall behind a road: a wet road has red in it, a dry one does not.
#[test]
fn a_wet_road_mirrors_what_stands_behind_it() {
    let redness = Weather::ALL.map(|weather| {
        let tiles = vec![ground(300.0), wall(25.0, 40.0, 8.0, Material::Plaster, [230, 20, 20])];
        let picture = take(tiles, Sky { illumination: Illumination::Daytime, weather });
        let places = (150..175).flat_map(|row| (200..400).map(move |column| (column, row)));
        let red: Vec<f64> = places
            .map(|(column, row)| {
                let [r, g, _] = pixel(&picture, column, row);
                f64::from(r) - f64::from(g)
            })
            .collect();
        mean(&red)
    });
    assert!(redness[0] < 3.0, "{redness:?}");
    assert!(redness[1..].iter().all(|red| *red > 4.0), "{redness:?}");
}

/// Somebody who stands on the road, some way ahead and aside.
fn walker(id: u32, ahead_m: f32, aside_m: f32) -> Body {
    let jackets = [[178, 44, 40], [52, 84, 138], [198, 190, 170], [54, 58, 62]];
    Body {
        actor: id,
        mesh: Shapes::new().walker(&somebody(WalkerKind::Adult, id, 1.2, 0.36)),
        world_from_body: Affine3A::from_rotation_translation(
            Quat::from_rotation_z(1.2),
            Vec3::new(2.0 + ahead_m, aside_m, 0.0),
        ),
        colour: jackets[id as usize % jackets.len()],
        velocity_mps: DVec3::ZERO,
        is_braking: false,
    }
}

/// The part of a lamp that glows, looking down.
fn street_lamp(ahead_m: f32, aside_m: f32) -> Tile {
    let at = |x: f32, y: f32| Vec3::new(ahead_m + x, aside_m + y, 7.0);
    let corners = [at(-0.2, -0.1), at(-0.2, 0.1), at(0.2, 0.1), at(0.2, -0.1)];
    flat(&corners, Material::StreetLamp, [240, 230, 200])
}

/// Luminances of a street with somebody 15 m ahead, and without.
fn street_with_and_without(id: u32, sky: Sky) -> (Vec<f64>, Vec<f64>) {
    let mut camera = Camera::new(CameraConfig::default());
    let street = town(vec![
        ground(300.0),
        wall(60.0, 60.0, 12.0, Material::Plaster, [176, 168, 158]),
        street_lamp(19.0, -6.0),
    ]);
    let mut look = |bodies: Vec<Body>| {
        let instant = Instant { time_s: 5.0, bodies };
        luminances(camera.picture(&street, &instant, &DAffine3::IDENTITY, sky, 1))
    };
    (look(vec![walker(id, 15.0, -1.0)]), look(vec![]))
}

/// For each sky, the mean difference of luminance that somebody 15 m ahead makes to the pixels that
/// show them by day, over people in different clothes.
fn contrasts_of_people() -> Vec<f64> {
    let people = 0..2;
    let shown: Vec<Vec<usize>> = people
        .clone()
        .map(|id| {
            let (with, without) = street_with_and_without(id, DAY);
            // Feet at 15 m lie 23 rows below the middle, the head 6 above it.
            (117..147)
                .flat_map(|row| (305..330).map(move |column| row * WIDTH + column))
                .filter(|place| (with[*place] - without[*place]).abs() > 0.02)
                .collect()
        })
        .collect();
    assert!(shown.iter().all(|pixels: &Vec<usize>| pixels.len() > 60), "they are seen by day");
    skies()
        .map(|sky| {
            let contrast = |id: u32| {
                let (with, without) = street_with_and_without(id, sky);
                let pixels = shown[id as usize].iter();
                mean(&pixels.map(|at| (with[*at] - without[*at]).abs()).collect::<Vec<f64>>())
            };
            mean(&people.clone().map(contrast).collect::<Vec<f64>>())
        })
        .collect()
}

#[test]
fn people_are_the_harder_to_see_the_darker_and_the_wetter_it_is() {
    let contrasts = contrasts_of_people();
    let table: Vec<String> = contrasts
        .chunks(4)
        .map(|row| row.iter().map(|value| format!("{value:6.3}")).collect::<String>())
        .collect();
    println!("{}", table.join("\n"));
    let table = table.join("\n");
    // Somebody in the sun before a sunlit wall may be a little harder to see than in a drizzle.
    for row in contrasts.chunks(4) {
        assert!(row.is_sorted_by(|a, b| *a > 0.8 * b), "by weather:\n{table}");
        assert!(row[3] < 0.8 * row[0], "storm against clear:\n{table}");
    }
    // Under street lamps dark clothes stand before a ground that is lit as well: at night people
    // are no easier to see than where head lamps alone pick them out.
    for weather in 0..4 {
        let [day, sunset, night, dark] = [0, 1, 2, 3].map(|light| contrasts[4 * light + weather]);
        assert!(day > 1.2 * sunset && sunset > 1.2 * night.max(dark), "by light:\n{table}");
    }
    let by_weather = [0, 1, 2, 3].map(|at| contrasts[at..].iter().step_by(4).sum::<f64>());
    assert!(by_weather.is_sorted_by(|a, b| a > b), "by weather on the whole:\n{table}");
    assert!(contrasts[15] < 0.1 * contrasts[0], "storm in the dark:\n{table}");
}
