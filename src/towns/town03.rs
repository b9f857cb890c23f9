//! Town03: a city of rings and rays. A large roundabout, boulevards, an embankment.

use crate::towns::{
    cross_sections::{AVENUE, BOULEVARD, LANE, RING, STREET, WIDE_RING},
    plan::{Plan, at, bend},
};

/// The plan.
pub fn plan() -> Plan {
    let mut town = Plan::new("Town03");
    // Boulevards from the plaza through the inner ring to the outer streets.
    let [east, north, west, south] =
        town.roundabout("Plaza", &WIDE_RING, [0.0, 0.0], 32.0, [3.0, 88.0, 180.0, 266.0]);
    let [ring_e, mid_e, gate_e] = [at(195.0, 10.0), at(300.0, 15.0), at(400.0, 20.0)];
    let [ring_n, mid_n, gate_n] = [at(7.0, 200.0), at(9.0, 270.0), at(12.0, 340.0)];
    let [ring_w, mid_w, gate_w] = [at(-200.0, 0.0), at(-300.0, 0.0), at(-400.0, 0.0)];
    let [ring_s, mid_s, gate_s] = [at(-14.0, -190.0), at(-18.0, -255.0), at(-23.0, -330.0)];
    town.street("East Boulevard", &BOULEVARD, &[east, ring_e, mid_e, gate_e]);
    town.street("North Boulevard", &BOULEVARD, &[north, ring_n, mid_n, gate_n]);
    town.street("West Boulevard", &BOULEVARD, &[west, ring_w, mid_w, gate_w]);
    town.street("South Boulevard", &BOULEVARD, &[south, ring_s, mid_s, gate_s]);

    // The ring on the line of the old walls.
    let [ring_ne, ring_nw] = [at(142.0, 148.0), at(-130.0, 165.0)];
    let [ring_sw, ring_se] = [at(-150.0, -140.0), at(150.0, -150.0)];
    town.street(
        "North Ring",
        &AVENUE,
        &[ring_e, bend(196.0, 90.0, 60.0), ring_ne, bend(90.0, 198.0, 60.0), ring_n],
    );
    town.street(
        "North Ring",
        &AVENUE,
        &[ring_n, bend(-75.0, 204.0, 70.0), ring_nw, bend(-198.0, 105.0, 60.0), ring_w],
    );
    town.street(
        "South Ring",
        &AVENUE,
        &[ring_w, bend(-206.0, -90.0, 60.0), ring_sw, bend(-95.0, -190.0, 60.0), ring_s],
    );
    town.street(
        "South Ring",
        &AVENUE,
        &[ring_s, bend(90.0, -196.0, 70.0), ring_se, bend(198.0, -95.0, 60.0), ring_e],
    );

    // Rays to the corners of the city, one of them to a small roundabout.
    let [hill_e, hill_nw, hill_sw] =
        town.roundabout("Hill Circus", &RING, [330.0, 262.0], 22.0, [-50.0, 130.0, 213.0]);
    let [ray_ne, ray_nw] = [at(235.0, 200.0), at(-195.0, 232.0)];
    let [ray_sw, ray_se] = [at(-240.0, -200.0), at(225.0, -220.0)];
    let [corner_nw, corner_sw, corner_se] =
        [at(-260.0, 300.0), at(-330.0, -270.0), at(300.0, -290.0)];
    town.street("Hill Street", &STREET, &[ring_ne, ray_ne, hill_sw]);
    town.street("Weaver Street", &STREET, &[ring_nw, ray_nw, corner_nw]);
    town.street("Dyer Street", &STREET, &[ring_sw, ray_sw, corner_sw]);
    town.street("Rope Street", &STREET, &[ring_se, ray_se, corner_se]);

    // Lanes between the rays.
    let [elm, holly] = [at(295.0, -100.0), at(150.0, 268.0)];
    town.street("Elm Lane", &LANE, &[mid_e, elm, bend(288.0, -170.0, 40.0), ray_se]);
    town.street("Ash Lane", &LANE, &[elm, at(418.0, -120.0)]);
    town.street("Holly Lane", &LANE, &[mid_n, holly, bend(196.0, 264.0, 30.0), ray_ne]);
    town.street("Ivy Lane", &LANE, &[holly, at(160.0, 338.0)]);
    town.street("Lime Lane", &LANE, &[mid_n, bend(-110.0, 282.0, 70.0), ray_nw]);
    town.street("Maple Lane", &LANE, &[ray_nw, bend(-302.0, 130.0, 70.0), mid_w]);
    town.street("Oak Lane", &LANE, &[mid_w, bend(-302.0, -110.0, 60.0), ray_sw]);
    town.street("Willow Lane", &LANE, &[ray_sw, bend(-130.0, -262.0, 60.0), mid_s]);
    town.street("Poplar Lane", &LANE, &[mid_s, bend(110.0, -262.0, 60.0), ray_se]);

    // Around the city: by the river in the south.
    town.street(
        "Embankment",
        &STREET,
        &[gate_w, bend(-405.0, -190.0, 90.0), corner_sw, bend(-170.0, -336.0, 160.0), gate_s],
    );
    town.street(
        "Embankment",
        &STREET,
        &[
            gate_s,
            bend(140.0, -330.0, 200.0),
            corner_se,
            bend(405.0, -250.0, 70.0),
            at(418.0, -120.0),
        ],
    );
    town.street(
        "East Side",
        &STREET,
        &[at(418.0, -120.0), gate_e, bend(398.0, 180.0, 60.0), hill_e],
    );
    town.street(
        "North Side",
        &STREET,
        &[hill_nw, bend(262.0, 342.0, 40.0), at(160.0, 338.0), gate_n],
    );
    town.street(
        "North Side",
        &STREET,
        &[gate_n, bend(-140.0, 345.0, 160.0), corner_nw, bend(-400.0, 240.0, 80.0), gate_w],
    );
    town
}
