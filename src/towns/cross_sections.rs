//! Profiles that several towns share. Widths in metres.

use crate::towns::profile::{Profile, Side};

/// Lanes with a gutter, nothing beside them.
const fn bare(lanes: usize, shoulder_m: f64) -> Side {
    Side { lanes, shoulder_m, verge_m: 0.0, sidewalk_m: 0.0 }
}

/// Lanes with a gutter and a side-walk.
const fn walked(lanes: usize, sidewalk_m: f64) -> Side {
    Side { lanes, shoulder_m: 0.3, verge_m: 0.0, sidewalk_m }
}

/// Nothing, left of a one-way street.
const NOTHING: Side = bare(0, 0.0);

/// Where people live: two lanes and narrow side-walks.
pub const LANE: Profile = Profile::two_way("town", 30.0, 3.25, walked(1, 1.8));

/// An ordinary street: two lanes, side-walks.
pub const STREET: Profile = Profile::two_way("town", 50.0, 3.5, walked(1, 2.5));

/// Two lanes in each direction.
pub const AVENUE: Profile =
    Profile { corner_m: 7.0, ..Profile::two_way("town", 50.0, 3.4, walked(2, 3.0)) };

/// Two lanes in each direction, trees between and beside them, further lanes for turning right.
pub const BOULEVARD: Profile = Profile {
    median_m: 3.0,
    corner_m: 9.0,
    turn_lane_m: 35.0,
    ..Profile::two_way(
        "town",
        50.0,
        3.5,
        Side { lanes: 2, shoulder_m: 0.4, verge_m: 1.6, sidewalk_m: 3.0 },
    )
};

/// Three lanes in each direction.
pub const WIDE_BOULEVARD: Profile = Profile {
    corner_m: 10.0,
    median_m: 4.0,
    forward: Side { lanes: 3, ..BOULEVARD.forward },
    backward: Side { lanes: 3, ..BOULEVARD.backward },
    ..BOULEVARD
};

/// The ring of a roundabout, one lane.
pub const RING: Profile = ring(1, 30.0, 4.0);

/// The ring of a roundabout, two lanes.
pub const WIDE_RING: Profile = ring(2, 40.0, 4.0);

const fn ring(lanes: usize, limit_kmh: f64, lane_m: f64) -> Profile {
    Profile {
        has_crosswalks: false,
        corner_m: 8.0,
        ..Profile::one_way("town", limit_kmh, lane_m, walked(lanes, 2.5), NOTHING)
    }
}

/// A country road: two narrow lanes between verges.
pub const COUNTRY_ROAD: Profile =
    Profile { corner_m: 8.0, ..Profile::two_way("rural", 70.0, 3.25, bare(1, 0.5)) };

/// A lane between fields.
pub const FIELD_LANE: Profile =
    Profile { corner_m: 7.0, ..Profile::two_way("rural", 50.0, 3.0, bare(1, 0.3)) };

/// Two lanes in each direction, hard shoulders, a barrier between.
pub const MOTORWAY: Profile = Profile {
    median_m: 3.0,
    corner_m: 12.0,
    ..Profile::two_way("motorway", 110.0, 3.6, bare(2, 2.5))
};

/// A ramp of a motorway.
pub const RAMP: Profile = Profile {
    corner_m: 12.0,
    ..Profile::one_way("motorway", 60.0, 4.0, bare(1, 1.5), bare(0, 0.5))
};

/// One carriageway of an expressway: three lanes.
pub const EXPRESSWAY: Profile =
    Profile { corner_m: 10.0, ..Profile::one_way("town", 80.0, 3.5, bare(3, 1.0), bare(0, 0.5)) };

/// A loop to turn back.
pub const TURNAROUND: Profile = Profile::one_way("town", 30.0, 4.0, bare(1, 0.5), bare(0, 0.5));
