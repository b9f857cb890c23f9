//! Town02: a suburb of one glance. T junctions, a crescent, rounded corners.

use crate::towns::{
    cross_sections::{LANE, STREET},
    plan::{Plan, at, bend},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town02");
    let (station, school) = (at(75.0, 0.0), at(75.0, 88.0));
    let (pond, church) = (at(0.0, 85.0), at(130.0, 190.0));
    let (depot, green) = (at(150.0, 4.0), at(215.0, 97.0));

    town.street("Station Road", &STREET, &[pond, bend(0.0, -4.0, 28.0), station, depot]);
    town.street("Station Road", &STREET, &[depot, bend(215.0, 8.0, 30.0), green]);
    town.street("East Row", &STREET, &[green, bend(212.0, 194.0, 38.0), church]);
    town.street("North Row", &STREET, &[church, at(52.0, 186.0), bend(-4.0, 182.0, 25.0), pond]);
    town.street("School Street", &STREET, &[pond, school, at(130.0, 92.0), green]);
    town.street("Baker Lane", &LANE, &[station, at(75.0, 44.0), school]);
    town.street("Orchard Lane", &LANE, &[church, at(130.0, 140.0), at(130.0, 92.0)]);
    town.street("Crescent", &LANE, &[at(52.0, 186.0), bend(48.0, 136.0, 26.0), at(130.0, 140.0)]);
    town.street("Park Row", &LANE, &[depot, bend(150.0, 48.0, 22.0), at(75.0, 44.0)]);
    town
}
