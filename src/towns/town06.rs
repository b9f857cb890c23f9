//! Town06: long roads of many lanes. An expressway with exits, entries and loops to turn back,
//! frontage roads on both sides, a parkway.

use crate::towns::{
    cross_sections::{AVENUE, BOULEVARD, EXPRESSWAY, RAMP, STREET, TURNAROUND},
    plan::{Plan, at, bend},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town06");
    // Eastbound in the south, westbound in the north: the same turned by half a circle.
    for (name, side) in [("Expressway East", 1.0), ("Expressway West", -1.0)] {
        let place = |x_m: f64, y_m: f64| at(side * x_m, side * y_m);
        let turn = |x_m: f64, y_m: f64, radius_m: f64| bend(side * x_m, side * y_m, radius_m);
        let on = |x_m: f64| place(x_m, -30.0);
        let [entry, exit, far_entry, far_exit] = [-520.0, -230.0, 230.0, 420.0].map(on);
        // Loops to turn back leave on the left; those of the other carriageway arrive there.
        let [back, far_back] = [-150.0, 300.0].map(on);
        let [from_far_back, from_back] = [-294.0, 156.0].map(on);
        town.street(
            name,
            &EXPRESSWAY,
            &[entry, from_far_back, exit, back, on(0.0), from_back, far_entry, far_back, far_exit],
        );
        let next_entry = place(520.0, 30.0);
        town.street(
            name,
            &EXPRESSWAY,
            &[far_exit, turn(610.0, -30.0, 30.0), turn(610.0, 30.0, 30.0), next_entry],
        );
        for x_m in [-150.0, 300.0] {
            let arrives = place(x_m - 6.0, 30.0);
            town.street(
                "Turnaround",
                &TURNAROUND,
                &[on(x_m), turn(x_m + 49.1, 4.4, 17.0), arrives],
            );
        }
        let frontage = [-601.5, -148.5, 148.5, 501.5].map(|x_m| place(x_m, -120.0));
        town.street("Entry", &RAMP, &[frontage[0], turn(-601.5, -68.0, 25.0), entry]);
        town.street("Exit", &RAMP, &[exit, turn(-148.5, -68.0, 25.0), frontage[1]]);
        town.street("Entry", &RAMP, &[frontage[2], turn(148.5, -68.0, 25.0), far_entry]);
        town.street("Exit", &RAMP, &[far_exit, turn(501.5, -68.0, 25.0), frontage[3]]);
    }

    let south = [-601.5, -430.0, -250.0, -148.5, 0.0, 148.5, 280.0, 501.5, 560.0]
        .map(|x_m| at(x_m, -120.0));
    let north = [601.5, 440.0, 148.5, 0.0, -148.5, -340.0, -501.5].map(|x_m| at(x_m, 120.0));
    town.street("South Frontage", &STREET, &south);
    town.street("North Frontage", &STREET, &north);
    town.street(
        "West Frontage",
        &STREET,
        &[north[6], bend(-662.0, 120.0, 35.0), bend(-662.0, -120.0, 35.0), south[0]],
    );
    town.street(
        "East Frontage",
        &STREET,
        &[south[8], bend(662.0, -120.0, 35.0), bend(662.0, 120.0, 35.0), north[0]],
    );

    let [parkway, mill, school] = [at(0.0, -238.0), at(-250.0, -226.0), at(280.0, -250.0)];
    town.street(
        "Central Avenue",
        &AVENUE,
        &[parkway, south[4], at(0.0, -30.0), at(0.0, 30.0), north[3], at(0.0, 214.0)],
    );
    town.street(
        "Parkway",
        &BOULEVARD,
        &[south[1], bend(-430.0, -220.0, 45.0), mill, parkway, school],
    );
    town.street("Orchard Road", &STREET, &[school, bend(560.0, -266.0, 60.0), south[8]]);
    town.street("Mill Road", &STREET, &[mill, south[2]]);
    town.street("School Road", &STREET, &[school, south[6]]);
    town.street(
        "Hill Road",
        &STREET,
        &[
            north[1],
            bend(440.0, 205.0, 50.0),
            bend(220.0, 230.0, 150.0),
            at(0.0, 214.0),
            bend(-180.0, 202.0, 150.0),
            bend(-340.0, 240.0, 60.0),
            north[5],
        ],
    );
    town
}
