//! Town01: a small market town on a river. Short streets that meet in Ts, a square, a quay.

use crate::towns::{
    cross_sections::{LANE, STREET},
    plan::{Plan, at, bend},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town01");
    let (west_gate, east_gate) = (at(0.0, 130.0), at(390.0, 110.0));
    let (bridge, ferry) = (at(240.0, -14.0), at(100.0, -6.0));
    let (mill, castle) = (at(155.0, 230.0), at(285.0, 230.0));
    let market = [at(100.0, 130.0), at(155.0, 130.0), at(100.0, 75.0)];

    town.street("Quay", &STREET, &[west_gate, bend(0.0, 0.0, 40.0), ferry, bridge]);
    town.street("Harbour Bend", &STREET, &[bridge, bend(390.0, -20.0, 55.0), east_gate]);
    town.street(
        "West Wall",
        &STREET,
        &[west_gate, at(0.0, 240.0), bend(0.0, 325.0, 35.0), at(155.0, 325.0)],
    );
    town.street(
        "North Wall",
        &STREET,
        &[at(155.0, 325.0), at(285.0, 332.0), bend(390.0, 338.0, 45.0), at(390.0, 225.0)],
    );
    town.street("East Wall", &STREET, &[at(390.0, 225.0), east_gate]);
    town.street(
        "Market Street",
        &STREET,
        &[west_gate, market[0], market[1], at(250.0, 122.0), east_gate],
    );

    town.street("Ferry Lane", &LANE, &[ferry, market[2], market[0]]);
    town.street("Square", &LANE, &[market[1], bend(155.0, 75.0, 12.0), market[2]]);
    town.street("Mill Street", &STREET, &[market[1], mill, at(155.0, 325.0)]);
    town.street("Bridge Street", &STREET, &[bridge, at(250.0, 122.0)]);
    town.street("Garden Lane", &LANE, &[at(250.0, 122.0), bend(256.0, 180.0, 50.0), castle]);
    town.street("Castle Street", &LANE, &[mill, castle, at(390.0, 225.0)]);
    town.street("Chapel Lane", &LANE, &[castle, at(285.0, 332.0)]);
    town.street("Tanners Row", &LANE, &[at(0.0, 240.0), bend(70.0, 244.0, 60.0), mill]);
    town
}
