//! Town07: farmland. Narrow roads without side-walks, bends, a green in the middle of a hamlet.

use crate::towns::{
    cross_sections::{COUNTRY_ROAD, FIELD_LANE},
    plan::{Plan, at, bend},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town07");
    let green = [at(0.0, 0.0), at(70.0, 12.0), at(28.0, 68.0)];
    let [west, east] = [at(-300.0, -40.0), at(245.0, -20.0)];
    let [farm, chapel, mill] = [at(-220.0, 240.0), at(60.0, 275.0), at(300.0, 150.0)];
    let [ford, barn] = [at(-170.0, -240.0), at(112.0, -235.0)];
    let [oak, stile, crossways] = [at(-120.0, -35.0), at(-62.0, -130.0), at(88.0, -112.0)];

    town.street(
        "Old Road",
        &COUNTRY_ROAD,
        &[west, bend(-200.0, -70.0, 90.0), oak, green[0], green[1], bend(150.0, 30.0, 90.0), east],
    );
    town.street(
        "North Round",
        &COUNTRY_ROAD,
        &[
            west,
            bend(-345.0, 160.0, 90.0),
            farm,
            bend(-90.0, 320.0, 110.0),
            chapel,
            bend(230.0, 280.0, 90.0),
            mill,
        ],
    );
    town.street("Mill Road", &COUNTRY_ROAD, &[mill, bend(330.0, 45.0, 60.0), east]);
    town.street(
        "South Round",
        &COUNTRY_ROAD,
        &[
            west,
            bend(-320.0, -180.0, 70.0),
            ford,
            bend(-30.0, -300.0, 90.0),
            barn,
            bend(240.0, -200.0, 70.0),
            at(248.0, -110.0),
            east,
        ],
    );

    town.street("Green", &FIELD_LANE, &[green[1], green[2], green[0]]);
    town.street(
        "Chapel Lane",
        &FIELD_LANE,
        &[green[2], bend(20.0, 150.0, 50.0), bend(78.0, 200.0, 45.0), chapel],
    );
    town.street(
        "Farm Lane",
        &FIELD_LANE,
        &[oak, bend(-135.0, 90.0, 50.0), bend(-235.0, 130.0, 45.0), farm],
    );
    town.street(
        "Mill Lane",
        &FIELD_LANE,
        &[green[2], bend(130.0, 135.0, 40.0), bend(210.0, 110.0, 50.0), mill],
    );
    town.street(
        "Ford Lane",
        &FIELD_LANE,
        &[green[0], bend(-12.0, -80.0, 40.0), stile, bend(-120.0, -190.0, 50.0), ford],
    );
    town.street("Barn Lane", &FIELD_LANE, &[green[1], bend(72.0, -50.0, 50.0), crossways, barn]);
    town.street(
        "Ridge Lane",
        &FIELD_LANE,
        &[stile, bend(10.0, -140.0, 60.0), crossways, bend(170.0, -80.0, 50.0), at(248.0, -110.0)],
    );
    town
}
