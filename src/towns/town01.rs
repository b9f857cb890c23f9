//! Town01.

use crate::towns::{
    cross_sections::{LANE, STREET},
    plan::{Plan, at, bend},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town01");
    town.street("High Street", &STREET, &[at(0.0, 0.0), at(120.0, 5.0), at(260.0, 0.0)]);
    town.street(
        "Ring",
        &STREET,
        &[
            at(0.0, 0.0),
            bend(0.0, 120.0, 30.0),
            at(120.0, 120.0),
            bend(260.0, 120.0, 40.0),
            at(260.0, 0.0),
        ],
    );
    town.street(
        "Ring",
        &STREET,
        &[at(0.0, 0.0), bend(0.0, -90.0, 30.0), bend(260.0, -100.0, 40.0), at(260.0, 0.0)],
    );
    town.street("Lane", &LANE, &[at(120.0, 5.0), at(120.0, 120.0)]);
    town
}
