//! Town04: a motorway in the figure of an eight, with a small town in its western loop.
//!
//! The motorway meets itself in a roundabout: nothing crosses above anything. Ramps on the inner
//! carriageways lead to the town and to a service area.

use crate::towns::{
    cross_sections::{AVENUE, LANE, MOTORWAY, RAMP, STREET, WIDE_RING},
    plan::{Plan, at, bend, sweep},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town04");
    let [north_east, north_west, town_gate, south_west, south_east] =
        town.roundabout("Knot", &WIDE_RING, [0.0, 0.0], 70.0, [40.0, 128.0, 180.0, 232.0, 320.0]);

    // Anticlockwise; the inner carriageway is driven against it.
    let [off_north, on_north] = [at(-735.0, 264.48), at(-425.0, 274.06)];
    let [off_south, on_south] = [at(-437.21, -261.57), at(-767.75, -181.88)];
    town.street(
        "Western Loop",
        &MOTORWAY,
        &[
            north_west,
            sweep(-330.0, 277.0, 120.0, 50.0),
            on_north,
            off_north,
            sweep(-880.0, 260.0, 120.0, 50.0),
            sweep(-900.0, -150.0, 120.0, 50.0),
            on_south,
            off_south,
            sweep(-340.0, -285.0, 120.0, 50.0),
            south_west,
        ],
    );
    // Clockwise; driven with it inside.
    let [off_services, on_services] = [at(390.0, 209.4), at(404.0, -191.4)];
    town.street(
        "Eastern Loop",
        &MOTORWAY,
        &[
            north_east,
            sweep(291.0, 244.0, 110.0, 45.0),
            off_services,
            sweep(580.0, 143.0, 110.0, 45.0),
            sweep(555.0, -163.5, 110.0, 45.0),
            on_services,
            sweep(260.0, -218.0, 110.0, 45.0),
            south_east,
        ],
    );
    // Lanes to slow down in and to gather speed in, on the inner carriageways.
    town.lane_before(south_west, off_south, 120.0);
    town.lane_after(on_south, off_north, 150.0);
    town.lane_before(on_south, off_north, 150.0);
    town.lane_after(on_north, north_west, 120.0);
    town.lane_before(north_east, off_services, 100.0);
    town.lane_after(on_services, south_east, 100.0);

    let [t1, t2] = [at(-546.8, -80.0), at(-640.0, -80.0)];
    let [t3, t4] = [at(-624.7, 120.0), at(-532.1, 120.0)];
    town.street("South Exit", &RAMP, &[off_south, bend(-546.8, -174.5, 40.0), t1]);
    town.street("South Entry", &RAMP, &[t2, bend(-640.0, -156.2, 40.0), on_south]);
    town.street("North Exit", &RAMP, &[off_north, bend(-624.7, 217.2, 40.0), t3]);
    town.street("North Entry", &RAMP, &[t4, bend(-532.1, 220.0, 40.0), on_north]);
    let [fuel, rest] = [at(472.0, 60.0), at(490.0, -62.0)];
    town.street("Services Exit", &RAMP, &[off_services, bend(468.7, 132.6, 40.0), fuel]);
    town.street("Services", &RAMP, &[fuel, rest]);
    town.street(
        "Services",
        &RAMP,
        &[fuel, bend(440.0, 35.0, 25.0), bend(448.0, -36.0, 25.0), rest],
    );
    town.street("Services Entry", &RAMP, &[rest, bend(493.5, -127.5, 40.0), on_services]);

    let [hall, west_end, east_end] = [at(-546.8, 20.0), at(-740.0, 20.0), at(-325.0, 10.0)];
    let [church, pond] = [at(-436.0, 16.0), at(-638.0, 22.0)];
    town.street("Main Street", &AVENUE, &[west_end, pond, hall, church, east_end]);
    town.street("Knot Road", &STREET, &[east_end, town_gate]);
    town.street(
        "South Street",
        &STREET,
        &[
            west_end,
            bend(-745.0, -80.0, 35.0),
            t2,
            t1,
            at(-440.0, -85.0),
            bend(-325.0, -92.0, 35.0),
            east_end,
        ],
    );
    town.street(
        "North Street",
        &STREET,
        &[
            west_end,
            bend(-740.0, 124.0, 35.0),
            t3,
            t4,
            at(-430.0, 116.0),
            bend(-322.0, 110.0, 35.0),
            east_end,
        ],
    );
    town.street("Pond Lane", &LANE, &[t2, pond, t3]);
    town.street("Hall Lane", &STREET, &[t1, hall, t4]);
    town.street("Church Lane", &LANE, &[at(-440.0, -85.0), church, at(-430.0, 116.0)]);
    town
}
