//! Towns and all that moves in them as triangles: where they should be, the right way round, the
//! same every time.

use std::{collections::BTreeMap, sync::Arc};

use glam::{DVec2, DVec3, Vec3};
use pmp::{
    footprint::Footprint,
    map::{opendrive::LaneKind, road_map::RoadMap},
    noise::{Noise, Purpose},
    scene::{
        instant::Instant,
        mesh::{Material, Mesh},
        people::{GAITS, Look, person},
        shapes::{POSES, Shapes},
        surroundings::Surroundings,
    },
    towns::scenery::collection::Scenery,
    world::{
        ego::Car,
        kind::{VEHICLES, VehicleKind, WalkerKind},
        paving::pave,
        snapshot::{Snapshot, WalkerState, vehicle_states, walker_states},
        streets::{Course, Lane, Streets},
        traffic::Traffic,
        walkers::Walkers,
    },
};

use crate::{fixtures::shared, towns::towns};

/// Side of the squares that triangles are found by, m.
const SQUARE_M: f64 = 8.0;

/// Triangles seen from above.
struct FromAbove {
    squares: BTreeMap<[i64; 2], Vec<([DVec3; 3], Material)>>,
}

impl FromAbove {
    /// Triangles of some materials; without those of open country, which are large.
    fn new(surroundings: &Surroundings, is_meant: impl Fn(Material) -> bool) -> FromAbove {
        let mut squares: BTreeMap<[i64; 2], Vec<_>> = BTreeMap::new();
        for tile in &surroundings.tiles {
            for triangle in tile.mesh.triangles.iter().filter(|face| is_meant(face.material)) {
                let corners = tile.mesh.corners_m(triangle).map(Vec3::as_dvec3);
                let low = corners[0].min(corners[1]).min(corners[2]);
                let high = corners[0].max(corners[1]).max(corners[2]);
                let is_open_country = triangle.material == Material::Grass
                    && (high - low).truncate().max_element() > 20.0;
                if is_open_country {
                    continue;
                }
                let [west, south] = square(low.truncate());
                let [east, north] = square(high.truncate());
                for (x, y) in (west..=east).flat_map(|x| (south..=north).map(move |y| (x, y))) {
                    squares.entry([x, y]).or_default().push((corners, triangle.material));
                }
            }
        }
        FromAbove { squares }
    }

    /// Heights of all triangles above and below a place, with their material.
    fn at(&self, place_m: DVec2) -> Vec<(f64, Material)> {
        let near = self.squares.get(&square(place_m)).map_or(&[][..], |near| near);
        near.iter().filter_map(|(corners, of)| Some((height_m(corners, place_m)?, *of))).collect()
    }
}

fn square(place_m: DVec2) -> [i64; 2] {
    (place_m / SQUARE_M).floor().to_array().map(|at| at as i64)
}

/// Where the vertical line through a place meets a triangle.
fn height_m([a, b, c]: &[DVec3; 3], place_m: DVec2) -> Option<f64> {
    let (ab, ac) = ((*b - *a).truncate(), (*c - *a).truncate());
    let area = ab.perp_dot(ac);
    if area.abs() < 1e-9 {
        return None;
    }
    let from = place_m - a.truncate();
    let (v, w) = (from.perp_dot(ac) / area, ab.perp_dot(from) / area);
    const EDGE: f64 = 1e-4;
    let is_inside = v >= -EDGE && w >= -EDGE && v + w <= 1.0 + EDGE;
    is_inside.then_some(a.z + v * (b.z - a.z) + w * (c.z - a.z))
}

/// Places on the driving lanes of a map: in the middle and beside it, world frame, m.
fn driven_m(map: &RoadMap, every_m: f64) -> Vec<DVec3> {
    let mut places = Vec::new();
    for road in &map.opendrive().roads {
        for (section, data) in road.sections.iter().enumerate() {
            let (from_m, to_m) = road.section_range_m(section);
            if to_m - from_m < 0.01 {
                continue;
            }
            let driving = |(_, lane): &(usize, &_)| is_driving(lane);
            for (index, _) in data.lanes.iter().enumerate().filter(driving) {
                let steps = ((to_m - from_m) / every_m).ceil();
                for step in 0..=steps as usize {
                    let s_m = from_m + (to_m - from_m) * (0.001 + 0.998 * step as f64 / steps);
                    let borders = road.borders(section, index, s_m);
                    let aside_m = 0.3 * borders.width_m();
                    for t_m in [-aside_m, 0.0, aside_m] {
                        places.push(road.place(s_m, borders.centre_t_m() + t_m));
                    }
                }
            }
        }
    }
    places
}

fn is_driving(lane: &pmp::map::opendrive::Lane) -> bool {
    lane.kind == LaneKind::Driving
}

/// What is wrong above and below the lanes of a map, in words.
fn wrong_on_lanes(map: &RoadMap, surroundings: &Surroundings) -> Option<String> {
    let is_small = |material| !matches!(material, Material::Facade | Material::StreetLamp);
    let faces = FromAbove::new(surroundings, is_small);
    for place in driven_m(map, 8.0) {
        let found = faces.at(place.truncate());
        let is_road = |(height_m, material): &(f64, Material)| {
            *material == Material::Asphalt && (height_m - place.z).abs() < 0.02
        };
        if !found.iter().any(is_road) {
            return Some(format!("no road at {place}: {found:?}"));
        }
        let in_way = found.iter().find(|(height_m, material)| {
            let above_m = height_m - place.z;
            let is_bridge = above_m > 2.5
                && matches!(material, Material::Asphalt | Material::Concrete | Material::Grass);
            // Ways through a junction lie one over the other, in real maps up to 0.2 m apart.
            let is_paved =
                *material == Material::Marking || *material == Material::Asphalt && above_m < 0.3;
            above_m > 0.02 && above_m < 4.5 && !is_bridge && !is_paved
        });
        if let Some((height_m, material)) = in_way {
            return Some(format!(
                "{material:?} {:.2} m above the road at {place}",
                height_m - place.z
            ));
        }
    }
    None
}

/// A triangle of the ground that looks down, in words.
fn upside_down(surroundings: &Surroundings) -> Option<String> {
    for tile in &surroundings.tiles {
        for triangle in &tile.mesh.triangles {
            let [a, b, c] = tile.mesh.corners_m(triangle);
            let up = (b - a).cross(c - a).normalize_or_zero().z;
            let is_ground = matches!(
                triangle.material,
                Material::Asphalt | Material::Marking | Material::Grass
            );
            if is_ground && up < -1e-3 {
                return Some(format!("{triangle:?} at {a}"));
            }
        }
    }
    None
}

#[test]
fn towns_have_roads_where_cars_drive_and_nothing_in_the_way() {
    let mut wrong = Vec::new();
    for town in towns() {
        let name = town.network.name;
        let scenery = Scenery::derive(&town.map, 0);
        let surroundings = Surroundings::of(&town.map, &scenery);
        wrong.extend(wrong_on_lanes(&town.map, &surroundings).map(|what| (name, what)));
        wrong.extend(upside_down(&surroundings).map(|what| (name, what)));
        let triangles = surroundings.triangles();
        assert!((20_000..180_000).contains(&triangles), "{name}: {triangles} triangles");
    }
    assert_eq!(wrong, []);
}

#[test]
fn maps_that_others_made_have_as_well() {
    let mut wrong = Vec::new();
    for name in ["Town01", "Town02", "Town04"] {
        let Some(path) = shared(&format!("maps/{name}.xodr")) else { return };
        let map = RoadMap::read(&path).unwrap();
        let surroundings = Surroundings::of(&map, &Scenery::derive(&map, 0));
        wrong.extend(wrong_on_lanes(&map, &surroundings).map(|what| (name, what)));
        wrong.extend(upside_down(&surroundings).map(|what| (name, what)));
        assert!(surroundings.triangles() < 180_000, "{name}: {}", surroundings.triangles());
    }
    assert_eq!(wrong, []);
}

#[test]
fn a_town_out_of_its_place_is_found_out() {
    // The checks above, checked: the streets of one town are not those of another.
    let foreign = Surroundings::of(&towns()[0].map, &Scenery::derive(&towns()[0].map, 0));
    assert!(wrong_on_lanes(&towns()[1].map, &foreign).is_some());
    let mut turned = foreign;
    turned.tiles.iter_mut().flat_map(|tile| &mut Arc::make_mut(&mut tile.mesh).triangles).for_each(
        |face| {
            face.corners.swap(0, 1);
        },
    );
    assert!(upside_down(&turned).is_some());
}

#[test]
fn the_same_town_gives_the_same_tiles_each_within_its_bounds() {
    let map = &towns()[1].map;
    let make = || Surroundings::of(map, &Scenery::derive(map, 0));
    let surroundings = make();
    assert_eq!(surroundings, make());
    for tile in &surroundings.tiles {
        assert_eq!(tile.mesh.bounds_m(), Some((tile.low_m, tile.high_m)));
    }
}

#[test]
fn people_stand_on_side_walks_and_not_in_them() {
    let town = &towns()[0];
    let surroundings = Surroundings::of(&town.map, &Scenery::derive(&town.map, 0));
    let walks = FromAbove::new(&surroundings, |material| material == Material::Concrete);
    let streets = pave(&town.map);
    let mut noise = Noise::new(3, 0, Purpose::Traffic);
    let walkers = Walkers::spawn(&streets, 300, &mut noise, |id| Noise::of_actor(3, 0, id));
    let states = walker_states(&walkers);
    let stands = states.iter().filter(|walker| {
        let below = walks.at(walker.footprint.centre_m);
        below.iter().any(|(height_m, _)| (height_m - walker.ground_m).abs() < 0.02)
    });
    assert!(stands.count() > 290);
}

/// The sum of all faces as vectors, m2: nothing for a closed surface, whatever its shape, as long
/// as no face is turned over.
fn open_m2(mesh: &Mesh) -> f32 {
    let face = |triangle| {
        let [a, b, c] = mesh.corners_m(triangle);
        0.5 * (b - a).cross(c - a)
    };
    mesh.triangles.iter().map(face).sum::<Vec3>().length()
}

#[test]
fn vehicles_have_the_size_of_their_kind_and_are_closed() {
    let shapes = Shapes::new();
    for kind in &VEHICLES {
        let has_rider = matches!(kind.kind, VehicleKind::Motorcycle | VehicleKind::Bicycle);
        let models = shapes.models(kind.kind);
        assert!(models.len() > 1, "{:?}", kind.kind);
        for mesh in models {
            let (low, high) = mesh.bounds_m().unwrap();
            let half = kind.half_m.as_vec2();
            let about = format!("{:?}: {low} {high}", kind.kind);
            assert!((high.x - half.x).abs() < 0.02 && (low.x + half.x).abs() < 0.02, "{about}");
            assert!((high.z - kind.height_m as f32).abs() < 0.02 && low.z.abs() < 0.01, "{about}");
            // Mirrors stand out.
            let mirrors_m = if has_rider { 0.02 } else { 0.13 };
            assert!((-0.02..mirrors_m).contains(&(high.y - half.y)), "{about}");
            assert!((high.y + low.y).abs() < 0.02, "{about}");
            let box_m3 = f64::from(8.0 * half.x * half.y) * 0.5 * kind.height_m;
            let share = mesh.volume_m3() / box_m3;
            let expected = if has_rider { 0.03..0.3 } else { 0.45..0.95 };
            assert!(expected.contains(&share), "{about}: {share:.2} of its box");
            assert!(
                open_m2(mesh) < if has_rider { 0.1 } else { 1e-3 },
                "{about}: {}",
                open_m2(mesh)
            );
            let triangles = mesh.triangles.len();
            assert!((150..700).contains(&triangles), "{about}: {triangles} triangles");
        }
    }
}

#[test]
fn a_face_turned_over_is_found_out() {
    let mut mesh = (*Shapes::new().ego()).clone();
    assert!(open_m2(&mesh) < 1e-3);
    mesh.triangles[20].corners.swap(0, 1);
    assert!(open_m2(&mesh) > 1e-2);
}

const LOOK: Look =
    Look { scale: 1.0, head: 1.0, trousers: [0; 3], skin: [0; 3], hair: [0; 3], has_helmet: false };

/// Lowest place of a mesh, and how far the soles are apart along the way, m.
fn feet_m(mesh: &Mesh) -> (f32, f32) {
    let (low, _) = mesh.bounds_m().unwrap();
    let soles = mesh.triangles.iter().filter(|face| face.material == Material::Rubber);
    let x_m = soles.flat_map(|face| mesh.corners_m(face)).map(|corner| corner.x);
    let (rear, front) = x_m.fold((f32::MAX, f32::MIN), |(a, b), x| (a.min(x), b.max(x)));
    (low.z, front - rear)
}

#[test]
fn feet_stay_on_the_ground_and_swing_further_the_faster_one_is() {
    let mut before_m = 0.0;
    for gait in &GAITS {
        let poses = (0..POSES).map(|k| person(&LOOK, &gait.pose(k as f32 / POSES as f32)));
        let feet: Vec<(f32, f32)> = poses.map(|mesh| feet_m(&mesh)).collect();
        let lowest_m = feet.iter().map(|(low_m, _)| *low_m).fold(f32::MAX, f32::min);
        assert!(lowest_m.abs() < 0.01, "{} m/s: {lowest_m}", gait.speed_mps);
        let widest_m = feet.iter().map(|(_, apart_m)| *apart_m).fold(0.0, f32::max);
        assert!(widest_m > before_m + 0.05, "{} m/s: {widest_m}", gait.speed_mps);
        before_m = widest_m;
    }
}

/// Somebody at the origin who goes east.
pub(crate) fn somebody(kind: WalkerKind, id: u32, speed_mps: f64, walked_m: f64) -> WalkerState {
    WalkerState {
        id,
        kind,
        footprint: Footprint::new(DVec2::ZERO, 0.0, kind.half_m()),
        ground_m: 0.0,
        velocity_mps: DVec2::X * speed_mps,
        pace_mps: 1.4,
        walked_m,
        is_jaywalking: false,
        is_crossing: false,
        colour: 0.0,
    }
}

#[test]
fn all_wheels_stand_on_a_slope() {
    let (along, climb) = (DVec2::from_angle(0.7), 0.12);
    let at = |s_m: f64| (along * s_m).extend(climb * s_m);
    let course = Course::through(&[at(0.0), at(600.0)]);
    let streets = Streets::new(vec![Lane::new("slope".into(), course, 3.5, 14.0)], Vec::new());
    let mut noise = Noise::new(2, 0, Purpose::Traffic);
    let actor = |id| Noise::of_actor(2, 0, id);
    let traffic = Traffic::spawn(&streets, 16, DVec2::splat(1e4), 1.0, &mut noise, actor);
    let snapshot = Snapshot {
        time_s: 0.0,
        ego: Car::default(),
        ego_ground_m: 0.0,
        vehicles: vehicle_states(&streets, &traffic),
        walkers: Vec::new(),
    };
    let mut feet = 0;
    for (body, state) in
        Instant::of(&snapshot, &Shapes::new()).bodies.iter().zip(&snapshot.vehicles)
    {
        let s_m = state.footprint.centre_m.dot(along);
        // Beyond its ends a lane goes on without its slope.
        if !(8.0..592.0).contains(&s_m) {
            continue;
        }
        for vertex in body.mesh.vertices.iter().filter(|vertex| vertex.position_m.z < 0.05) {
            let place_m = body.world_from_body.transform_point3(vertex.position_m).as_dvec3();
            let ground_m = climb * place_m.truncate().dot(along);
            let above_m = place_m.z - ground_m - f64::from(vertex.position_m.z);
            assert!(above_m.abs() < 0.02, "{:?}: {above_m} m above the ground", state.kind);
            feet += 1;
        }
        let rise_mps = climb * state.velocity_mps.length();
        assert!((body.velocity_mps.z - rise_mps).abs() < 1e-6);
    }
    assert!(feet > 100, "{feet}");
}

#[test]
fn legs_move_with_the_way_that_is_gone() {
    let shapes = Shapes::new();
    for kind in [WalkerKind::Adult, WalkerKind::Child] {
        let at = |speed_mps: f64, time_s: f64| {
            shapes.walker(&somebody(kind, 10_003, speed_mps, speed_mps * time_s))
        };
        assert_eq!(at(0.0, 1.0), at(0.0, 7.3), "who stands does not move");
        let (low, high) = at(0.0, 0.0).bounds_m().unwrap();
        assert!(low.z.abs() < 1e-3 && (high.z - kind.height_m() as f32).abs() < 1e-3);
        let poses = |speed_mps: f64| {
            let times = (0..300).map(|step| at(speed_mps, 0.01 * f64::from(step)));
            let shown: Vec<_> = times.collect();
            shown.windows(2).filter(|pair| pair[0] != pair[1]).count()
        };
        assert!(poses(0.5) < poses(1.4), "{kind:?}: {} {}", poses(0.5), poses(1.4));
    }
}
