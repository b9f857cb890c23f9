//! Town05: a city on a grid. Streets of many lanes, wide crossings, a park where a street is left out.

use crate::towns::{
    cross_sections::{AVENUE, BOULEVARD, LANE, WIDE_BOULEVARD},
    plan::{Plan, at, bend},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town05");
    let first = [120.0, 270.0].map(|y| at(0.0, y));
    let second = [0.0, 120.0, 270.0, 405.0].map(|y| at(140.0, y));
    let third = [0.0, 120.0, 270.0, 415.0].map(|y| at(290.0, y));
    let fourth = [0.0, 120.0, 270.0, 420.0].map(|y| at(450.0, y));
    let fifth = [120.0, 270.0].map(|y| at(610.0, y));
    let mews = [at(215.0, 120.0), at(215.0, 0.0)];

    town.street(
        "A Street",
        &BOULEVARD,
        &[
            first[0],
            bend(0.0, 0.0, 40.0),
            second[0],
            mews[1],
            third[0],
            fourth[0],
            bend(610.0, 0.0, 50.0),
            fifth[0],
        ],
    );
    town.street(
        "B Street",
        &WIDE_BOULEVARD,
        &[first[0], second[1], mews[0], third[1], fourth[1], fifth[0]],
    );
    town.street("C Street", &AVENUE, &[first[1], second[2], third[2], fourth[2], fifth[1]]);
    town.street(
        "D Street",
        &BOULEVARD,
        &[
            first[1],
            bend(0.0, 400.0, 45.0),
            second[3],
            third[3],
            fourth[3],
            bend(610.0, 425.0, 60.0),
            fifth[1],
        ],
    );
    town.street("First Avenue", &BOULEVARD, &[first[0], first[1]]);
    town.street("Second Avenue", &AVENUE, &[second[0], second[1]]);
    town.street("Second Avenue", &AVENUE, &[second[2], second[3]]);
    town.street("Third Avenue", &WIDE_BOULEVARD, &[third[0], third[1], third[2], third[3]]);
    town.street("Fourth Avenue", &AVENUE, &[fourth[0], fourth[1], fourth[2], fourth[3]]);
    town.street("Fifth Avenue", &BOULEVARD, &[fifth[0], fifth[1]]);
    town.street("Mews", &LANE, &[mews[0], mews[1]]);
    town
}
