//! The language of a town's plan: streets from place to place.

use glam::DVec2;

use crate::towns::{
    course::Corner,
    profile::{FurtherLanes, Profile},
};

/// A point on a street's way, map frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Where streets meet: those that name the same point to the millimetre.
    Crossing(DVec2),
    /// Where the street turns, round.
    Bend(Corner),
}

/// A crossing at x east and y north, m.
pub const fn at(x_m: f64, y_m: f64) -> Place {
    Place::Crossing(DVec2::new(x_m, y_m))
}

/// A bend around the corner at x east and y north, m.
pub const fn bend(x_m: f64, y_m: f64, radius_m: f64) -> Place {
    sweep(x_m, y_m, radius_m, 0.0)
}

/// A bend with spirals of the given length before and behind its arc, m.
pub const fn sweep(x_m: f64, y_m: f64, radius_m: f64, spiral_m: f64) -> Place {
    Place::Bend(Corner { at_m: DVec2::new(x_m, y_m), radius_m, spiral_m })
}

/// A street between two crossings.
#[derive(Clone, Debug, PartialEq)]
pub struct Street {
    pub name: &'static str,
    pub profile: Profile,
    pub from_m: DVec2,
    pub corners: Vec<Corner>,
    pub to_m: DVec2,
    pub further: FurtherLanes,
}

/// A town on paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub name: &'static str,
    pub streets: Vec<Street>,
}

impl Plan {
    /// An empty plan.
    pub fn new(name: &'static str) -> Plan {
        Plan { name, streets: Vec::new() }
    }

    /// A street that begins and ends at crossings; each crossing on its way divides it.
    pub fn street(&mut self, name: &'static str, profile: &Profile, places: &[Place]) {
        let mut from_m = None;
        let mut corners = Vec::new();
        for place in places {
            match (*place, from_m) {
                (Place::Bend(corner), _) => corners.push(corner),
                (Place::Crossing(to_m), Some(start_m)) => {
                    self.streets.push(Street {
                        name,
                        profile: *profile,
                        from_m: start_m,
                        corners: std::mem::take(&mut corners),
                        to_m,
                        further: FurtherLanes::default(),
                    });
                    from_m = Some(to_m);
                }
                (Place::Crossing(start_m), None) => from_m = Some(start_m),
            }
        }
    }

    /// A roundabout, driven anticlockwise, with crossings at the given bearings (degrees
    /// anticlockwise from east, ascending). Returns the crossings.
    pub fn roundabout<const ARMS: usize>(
        &mut self,
        name: &'static str,
        profile: &Profile,
        [x_m, y_m]: [f64; 2],
        radius_m: f64,
        bearings_deg: [f64; ARMS],
    ) -> [Place; ARMS] {
        let centre_m = DVec2::new(x_m, y_m);
        let on_circle = |deg: f64| centre_m + radius_m * DVec2::from_angle(deg.to_radians());
        for (i, &from_deg) in bearings_deg.iter().enumerate() {
            let round_deg = if i + 1 < ARMS { 0.0 } else { 360.0 };
            let to_deg = bearings_deg[(i + 1) % ARMS] + round_deg;
            // Half circles have no corner; halves of what lies between two arms always have one.
            let quarter_deg = 0.25 * (to_deg - from_deg);
            let out_m = radius_m / quarter_deg.to_radians().cos();
            let corner = |turns: f64| Corner {
                at_m: centre_m
                    + out_m * DVec2::from_angle((from_deg + turns * quarter_deg).to_radians()),
                radius_m,
                spiral_m: 0.0,
            };
            self.streets.push(Street {
                name,
                profile: *profile,
                from_m: on_circle(from_deg),
                corners: vec![corner(1.0), corner(3.0)],
                to_m: on_circle(to_deg),
                further: FurtherLanes::default(),
            });
        }
        bearings_deg.map(|deg| Place::Crossing(on_circle(deg)))
    }

    /// One more lane on the right for who drives from one crossing to the next: the last
    /// `length_m` before it.
    pub fn lane_before(&mut self, from: Place, to: Place, length_m: f64) {
        self.widen(
            from,
            to,
            |further| &mut further.forward_end_m,
            |further| &mut further.backward_start_m,
            length_m,
        );
    }

    /// The same for the first `length_m` after a crossing.
    pub fn lane_after(&mut self, from: Place, to: Place, length_m: f64) {
        self.widen(
            from,
            to,
            |further| &mut further.forward_start_m,
            |further| &mut further.backward_end_m,
            length_m,
        );
    }

    fn widen(
        &mut self,
        from: Place,
        to: Place,
        forward: fn(&mut FurtherLanes) -> &mut f64,
        backward: fn(&mut FurtherLanes) -> &mut f64,
        length_m: f64,
    ) {
        for street in &mut self.streets {
            let ends = [Place::Crossing(street.from_m), Place::Crossing(street.to_m)];
            if ends == [from, to] {
                *forward(&mut street.further) = length_m;
            } else if ends == [to, from] {
                *backward(&mut street.further) = length_m;
            }
        }
    }
}
