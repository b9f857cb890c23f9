//! From a plan to roads: courses are laid, ends trimmed, crossings filled.

use std::collections::BTreeMap;

use glam::DVec2;

use crate::{
    error::{Error, Result},
    towns::{
        course::Course,
        junction::{Arm, Crossing, can_turn_right, trims_m},
        network::{Crosswalk, Junction, Network, Road, Tie},
        plan::{Plan, Street},
        profile::{FurtherLanes, Lane, Profile, Section, Use},
    },
};

/// Length over which a further lane opens or closes at 50 km/h, m; it grows with the limit.
const TAPER_M: f64 = 20.0;

/// No road between junctions is shorter, m.
const SHORTEST_ROAD_M: f64 = 4.0;

/// Distance of a crosswalk's middle from the junction, m, and the shortest road that has some.
const CROSSWALK_AT_M: f64 = 3.5;
const CROSSWALK_ROAD_M: f64 = 30.0;

/// An end of a street.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct End {
    street: usize,
    is_start: bool,
}

/// Lay out a plan.
///
/// # Errors
///
/// [`Error::Config`] if the plan has a dead end, a corner without room or crossings too close.
pub fn lay_out(plan: &Plan) -> Result<Network> {
    let mut layout = Layout::new(plan)?;
    let crossings = layout.crossings()?;
    layout.add_turn_lanes(&crossings);
    let trims_m = layout.trims_m(&crossings);
    let mut roads = Vec::new();
    for (street, trims_m) in trims_m.iter().enumerate() {
        roads.push(layout.road(street, *trims_m, &crossings)?);
    }
    let mut junctions = Vec::new();
    for (junction, ends) in crossings.iter().enumerate() {
        let arms: Vec<Arm> = ends
            .iter()
            .map(|end| {
                let road = &roads[end.street];
                layout.arm(*end, &road.course, &road.sections)
            })
            .collect();
        let crossing = Crossing::new(junction_id(junction), &arms, roads.len() as u32 + 1);
        roads.extend(crossing.roads);
        junctions.push(Junction { id: junction_id(junction), connections: crossing.connections });
    }
    Ok(Network { name: plan.name, roads, junctions })
}

/// Junctions are numbered apart from roads: no town has as many.
fn junction_id(index: usize) -> u32 {
    10_001 + index as u32
}

struct Layout<'plan> {
    plan: &'plan Plan,
    /// From middle to middle of crossings, one for each street.
    courses: Vec<Course>,
    further: Vec<FurtherLanes>,
}

impl<'plan> Layout<'plan> {
    fn new(plan: &'plan Plan) -> Result<Self> {
        let lay = |street: &Street| {
            Course::through(street.from_m, &street.corners, street.to_m)
                .map_err(|what| fault(plan, &format!("{}: {what}", street.name)))
        };
        let courses = plan.streets.iter().map(lay).collect::<Result<_>>()?;
        let further = plan.streets.iter().map(|street| street.further).collect();
        Ok(Layout { plan, courses, further })
    }

    /// The ends that meet at each crossing, anticlockwise.
    fn crossings(&self) -> Result<Vec<Vec<End>>> {
        let mut crossings: BTreeMap<[i64; 2], Vec<End>> = BTreeMap::new();
        for (street, data) in self.plan.streets.iter().enumerate() {
            for (place_m, is_start) in [(data.from_m, true), (data.to_m, false)] {
                crossings.entry(millimetres(place_m)).or_default().push(End { street, is_start });
            }
        }
        for (place, ends) in &mut crossings {
            ends.sort_by(|a, b| self.heading_rad(*a).total_cmp(&self.heading_rad(*b)));
            if ends.len() < 3 {
                let [x, y] = place.map(|mm| mm as f64 / 1000.0);
                let name = self.plan.streets[ends[0].street].name;
                let what = format!("{name}: fewer than three streets meet at ({x}, {y})");
                return Err(fault(self.plan, &what));
            }
        }
        Ok(crossings.into_values().collect())
    }

    /// Heading of an end away from its crossing, rad, from 0 to one turn.
    fn heading_rad(&self, end: End) -> f64 {
        let course = &self.courses[end.street];
        let pose = if end.is_start { course.start() } else { course.end().reversed() };
        pose.heading_rad.rem_euclid(std::f64::consts::TAU)
    }

    fn profile(&self, street: usize) -> &'plan Profile {
        &self.plan.streets[street].profile
    }

    fn arm(&self, end: End, course: &Course, sections: &[Section]) -> Arm {
        let pose = if end.is_start { course.start() } else { course.end().reversed() };
        let road = end.street as u32 + 1;
        Arm::new(road, self.profile(end.street), pose, sections, end.is_start)
    }

    /// Arms of a crossing as they would be at its middle.
    fn arms(&self, ends: &[End]) -> Vec<Arm> {
        let arm = |end: &End| {
            let course = &self.courses[end.street];
            let sections = self.sections(end.street, course.length_m());
            self.arm(*end, course, &sections)
        };
        ends.iter().map(arm).collect()
    }

    fn sections(&self, street: usize, length_m: f64) -> Vec<Section> {
        self.profile(street).sections(length_m, self.further[street], self.taper_m(street))
    }

    fn taper_m(&self, street: usize) -> f64 {
        TAPER_M * (self.profile(street).limit_kmh / 50.0).max(1.0)
    }

    /// Open a lane before each crossing where the profile has one and there is a turn for it.
    fn add_turn_lanes(&mut self, crossings: &[Vec<End>]) {
        for ends in crossings {
            let arms = self.arms(ends);
            for (i, end) in ends.iter().enumerate() {
                let turn_lane_m = self.profile(end.street).turn_lane_m;
                let needed_m = 2.0 * (turn_lane_m + self.taper_m(end.street)) + 60.0;
                let has_room = self.courses[end.street].length_m() > needed_m;
                if turn_lane_m > 0.0
                    && has_room
                    && arms[i].lanes_in() > 0
                    && can_turn_right(&arms, i)
                {
                    let further = &mut self.further[end.street];
                    match end.is_start {
                        true => further.backward_start_m = turn_lane_m,
                        false => further.forward_end_m = turn_lane_m,
                    }
                }
            }
        }
    }

    /// What each street loses at its start and end to the crossings, m.
    fn trims_m(&self, crossings: &[Vec<End>]) -> Vec<[f64; 2]> {
        let mut trims = vec![[0.0; 2]; self.courses.len()];
        for ends in crossings {
            for (end, trim_m) in ends.iter().zip(trims_m(&self.arms(ends))) {
                trims[end.street][usize::from(!end.is_start)] = trim_m;
            }
        }
        trims
    }

    fn road(
        &self,
        street: usize,
        [start_m, end_m]: [f64; 2],
        crossings: &[Vec<End>],
    ) -> Result<Road> {
        let name = self.plan.streets[street].name;
        let whole = &self.courses[street];
        let length_m = whole.length_m() - start_m - end_m;
        let Some(sections) = self.fitting_sections(street, length_m) else {
            let from_m = self.plan.streets[street].from_m;
            let at = format!("behind ({:.0}, {:.0})", from_m.x, from_m.y);
            return Err(fault(
                self.plan,
                &format!("{name}: {length_m:.1} m are left {at}: too short"),
            ));
        };
        let course = whole.cut(start_m, start_m + length_m);
        let end = |is_start: bool| {
            let end = End { street, is_start };
            let junction = crossings.iter().position(|ends| ends.contains(&end));
            Tie::Junction(junction_id(junction.unwrap_or_default()))
        };
        let profile = self.profile(street);
        Ok(Road {
            id: street as u32 + 1,
            name: name.to_string(),
            junction: None,
            class: profile.class,
            limit_kmh: profile.limit_kmh,
            shift_m: profile.shift_m(),
            crosswalks: crosswalks(profile, &sections),
            course,
            sections,
            predecessor: end(true),
            successor: end(false),
        })
    }

    /// The sections of a road, if all of them have room.
    fn fitting_sections(&self, street: usize, length_m: f64) -> Option<Vec<Section>> {
        let FurtherLanes { forward_start_m, forward_end_m, backward_start_m, backward_end_m } =
            self.further[street];
        let reach = |m: f64| if m > 0.0 { m + self.taper_m(street) } else { 0.0 };
        let both = |start_m: f64, end_m: f64| reach(start_m) + reach(end_m) + SHORTEST_ROAD_M;
        let needed_m =
            both(forward_start_m, forward_end_m).max(both(backward_start_m, backward_end_m));
        (length_m >= needed_m).then(|| self.sections(street, length_m))
    }
}

/// Crosswalks at both ends of a road.
fn crosswalks(profile: &Profile, sections: &[Section]) -> Vec<Crosswalk> {
    let last = &sections[sections.len() - 1];
    let length_m = last.s_m + last.length_m;
    if !profile.has_crosswalks || length_m < CROSSWALK_ROAD_M {
        return Vec::new();
    }
    let kerb = |lanes: &[Lane]| {
        let is_carriageway = |used_for: Use| !matches!(used_for, Use::Verge | Use::Sidewalk);
        lanes
            .iter()
            .filter(|lane| is_carriageway(lane.used_for))
            .map(|lane| lane.start_m.max(lane.end_m))
            .sum::<f64>()
    };
    let at = |s_m: f64, section: &Section| Crosswalk {
        s_m,
        left_m: profile.shift_m() + kerb(&section.left),
        right_m: profile.shift_m() - kerb(&section.right),
    };
    vec![at(CROSSWALK_AT_M, &sections[0]), at(length_m - CROSSWALK_AT_M, last)]
}

fn millimetres(place_m: DVec2) -> [i64; 2] {
    place_m.to_array().map(|metres| (metres * 1000.0).round() as i64)
}

fn fault(plan: &Plan, what: &str) -> Error {
    Error::Config { key: plan.name.to_string(), what: what.to_string(), hint: None }
}
