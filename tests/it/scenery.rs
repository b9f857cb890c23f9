//! What stands beside the roads: never on them, as dense as it should be, the same every time.

use glam::DVec2;
use pmp::{
    footprint::Footprint,
    map::{opendrive::LaneKind, road_map::RoadMap},
    towns::scenery::{
        collection::Scenery,
        outline::{hull_m, overlaps},
        things::{Kind, Thing},
    },
};
use proptest::prelude::*;

use crate::{
    fixtures::shared,
    towns::{contains, outlines_m, towns},
};

/// Places on a footprint: its corners, and a net over it.
fn places_m(thing: &Thing) -> Vec<DVec2> {
    let Footprint { centre_m, half_m, forward } = thing.footprint;
    let steps = |half_m: f64| (2.0 * half_m).ceil().max(1.0);
    let (along, across) = (steps(half_m.x), steps(half_m.y));
    let mut places = Vec::new();
    for i in 0..=along as u32 {
        for j in 0..=across as u32 {
            let share = DVec2::new(f64::from(i) / along, f64::from(j) / across);
            let local = (2.0 * share - 1.0) * half_m;
            places.push(centre_m + forward.rotate(local));
        }
    }
    places
}

fn is_used(kind: LaneKind) -> bool {
    !matches!(kind, LaneKind::Border | LaneKind::Median | LaneKind::Other)
}

/// The first thing that stands on a lane, a side-walk, a crosswalk or between the ways of a
/// junction, in words.
fn misplaced(map: &RoadMap, scenery: &Scenery) -> Option<String> {
    let things = scenery.things();
    let on = |outline_m: &[DVec2], is_meant: &dyn Fn(&Thing) -> bool| -> Option<String> {
        let low = outline_m.iter().copied().reduce(DVec2::min)?;
        let high = outline_m.iter().copied().reduce(DVec2::max)?;
        let near = scenery.within(low, high).into_iter().map(|i| &things[i]);
        let mut meant = near.filter(|thing| is_meant(thing));
        let stands =
            |thing: &&Thing| places_m(thing).iter().any(|place| contains(outline_m, *place));
        meant.find(stands).map(|thing| format!("{thing:?}"))
    };
    let is_high = |thing: &Thing| thing.kind != Kind::Kerb;
    for road in &map.opendrive().roads {
        let outlines = outlines_m(road);
        for (kind, outline_m) in outlines.iter().filter(|(kind, _)| is_used(*kind)) {
            let is_driven = *kind == LaneKind::Driving;
            if let Some(thing) = on(outline_m, &|thing| is_driven || is_high(thing)) {
                return Some(format!("{thing} on a {kind:?} lane of road {}", road.id));
            }
        }
        for crosswalk in &road.crosswalks {
            if let Some(thing) = on(&road.crosswalk_m(crosswalk), &is_high) {
                return Some(format!("{thing} on a crosswalk of road {}", road.id));
            }
        }
    }
    for junction in &map.opendrive().junctions {
        let roads = map.opendrive().roads.iter();
        let within = roads.filter(|road| road.junction.as_ref() == Some(&junction.id));
        let used = within.flat_map(outlines_m).filter(|(kind, _)| is_used(*kind));
        let area_m = hull_m(used.flat_map(|(_, outline_m)| outline_m).collect());
        if let Some(thing) = on(&area_m, &is_high) {
            return Some(format!("{thing} within junction {}", junction.id));
        }
    }
    None
}

#[test]
fn nothing_stands_where_people_drive_or_walk() {
    for town in towns() {
        let scenery = Scenery::derive(&town.map, 5);
        assert_eq!(misplaced(&town.map, &scenery), None, "{}", town.network.name);
    }
}

#[test]
fn nor_in_maps_that_others_made() {
    for name in ["Town01", "Town02", "Town04"] {
        let Some(path) = shared(&format!("maps/{name}.xodr")) else { return };
        let map = RoadMap::read(&path).unwrap();
        let scenery = Scenery::derive(&map, 5);
        assert_eq!(misplaced(&map, &scenery), None, "{name}");
        assert!(scenery.things().len() > 500, "{name}: {} things", scenery.things().len());
    }
}

#[test]
fn what_stands_on_a_road_is_seen() {
    // The check above, checked: the houses of one town stand on the streets of another.
    let foreign = Scenery::derive(&towns()[0].map, 5);
    assert!(misplaced(&towns()[2].map, &foreign).is_some());
}

#[test]
fn towns_are_built_up_and_the_country_is_green() {
    let per_km = |name: &str, kinds: &[Kind]| {
        let town = towns().iter().find(|town| town.network.name == name).unwrap();
        let scenery = Scenery::derive(&town.map, 1);
        let count = scenery.things().iter().filter(|thing| kinds.contains(&thing.kind)).count();
        let roads = town.map.opendrive().roads.iter().filter(|road| road.junction.is_none());
        count as f64 / roads.map(|road| road.length_m / 1000.0).sum::<f64>()
    };
    let buildings = [Kind::House, Kind::Block, Kind::Barn];
    for (name, least, most) in [
        ("Town01", 60.0, 130.0),
        ("Town02", 50.0, 130.0),
        ("Town03", 60.0, 130.0),
        ("Town05", 30.0, 90.0),
        ("Town07", 8.0, 25.0),
    ] {
        let found = per_km(name, &buildings);
        assert!((least..most).contains(&found), "{name}: {found:.0} buildings a kilometre");
    }
    assert!(per_km("Town05", &[Kind::Block]) > 20.0 * per_km("Town01", &[Kind::Block]).max(1.0));
    assert!(per_km("Town07", &[Kind::Field]) > 8.0);
    assert_eq!(per_km("Town01", &[Kind::Field]), 0.0);
    assert!(per_km("Town07", &[Kind::Tree]) > 2.0 * per_km("Town07", &buildings));
    assert!(per_km("Town01", &[Kind::Lamp]) > 40.0);
    assert_eq!(per_km("Town07", &[Kind::Lamp]), 0.0);
}

#[test]
fn kerbs_run_along_side_walks() {
    // Their length together is that of the side-walks' inner edges, outside of junctions: each
    // road of Town02 has one on either side.
    let town = &towns()[1];
    let scenery = Scenery::derive(&town.map, 1);
    let kerbs = scenery.things().iter().filter(|thing| thing.kind == Kind::Kerb);
    let kerbs_m: f64 = kerbs.map(|kerb| 2.0 * kerb.footprint.half_m.x).sum();
    let roads = town.map.opendrive().roads.iter().filter(|road| road.junction.is_none());
    let sides_m: f64 = roads.map(|road| 2.0 * road.length_m).sum();
    // Junctions add their corners: a few metres each.
    assert!(
        (1.0..1.35).contains(&(kerbs_m / sides_m)),
        "{kerbs_m} m of kerbs, {sides_m} m of sides"
    );
}

#[test]
fn the_same_seed_gives_the_same_things_and_another_gives_others() {
    let map = &towns()[0].map;
    let first = Scenery::derive(map, 7);
    let again = std::thread::scope(|scope| scope.spawn(|| Scenery::derive(map, 7)).join().unwrap());
    assert_eq!(first.things(), again.things());
    let kerbs = |scenery: &Scenery| -> Vec<Thing> {
        let kerbs = scenery.things().iter().filter(|thing| thing.kind == Kind::Kerb);
        kerbs.copied().collect()
    };
    let other = Scenery::derive(map, 8);
    assert_ne!(first.things(), other.things());
    assert_eq!(kerbs(&first), kerbs(&other), "kerbs come from the map alone");
}

proptest! {
    #[test]
    fn the_index_finds_what_a_search_through_all_finds(
        x in -50.0_f64..450.0, y in -50.0_f64..380.0, width in 0.0_f64..80.0, height in 0.0_f64..80.0,
    ) {
        static SCENERY: std::sync::OnceLock<Scenery> = std::sync::OnceLock::new();
        let scenery = SCENERY.get_or_init(|| Scenery::derive(&towns()[0].map, 3));
        let (low, high) = (DVec2::new(x, y), DVec2::new(x + width, y + height));
        let meets = |thing: &Thing| {
            let (from, to) = thing.footprint.bounds_m();
            from.cmple(high).all() && to.cmpge(low).all()
        };
        let all = scenery.things().iter().enumerate();
        let expected: Vec<usize> = all.filter(|(_, t)| meets(t)).map(|(i, _)| i).collect();
        prop_assert_eq!(scenery.within(low, high), expected);
    }

    #[test]
    fn footprints_that_share_a_place_overlap(
        x in -6.0_f64..6.0, y in -6.0_f64..6.0, a_rad in 0.0_f64..3.0, b_rad in 0.0_f64..3.0,
        half in 0.5_f64..3.0,
    ) {
        let a = Footprint::new(DVec2::ZERO, a_rad, DVec2::new(3.0, 1.0));
        let b = Footprint::new(DVec2::new(x, y), b_rad, DVec2::new(half, 1.0));
        let net = |footprint: Footprint| {
            places_m(&Thing { kind: Kind::House, footprint, height_m: 1.0, colour: 0 })
        };
        let shares = net(a).iter().any(|place| contains(&b.corners_m(), *place))
            || net(b).iter().any(|place| contains(&a.corners_m(), *place));
        prop_assert!(!shares || overlaps(&a, &b.corners_m()));
        prop_assert_eq!(overlaps(&a, &b.corners_m()), overlaps(&b, &a.corners_m()));
        // Circles around both do not meet: nor do the boxes.
        let apart = a.half_m.length() + b.half_m.length();
        prop_assert!(b.centre_m.length() <= apart || !overlaps(&a, &b.corners_m()));
    }
}
