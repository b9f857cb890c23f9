//! Junctions: where arms end, and the roads that lead from one into another.

use std::f64::consts::{PI, TAU};

use crate::{
    dataset::ego::wrap_angle,
    towns::{
        course::{Course, Pose},
        movement::{Exit, movements},
        network::{Connection, Road, Tie},
        profile::{Lane, Profile, Section, Use},
    },
};

/// Turns sharper than this are not driven, rad.
const SHARPEST_RAD: f64 = 2.36;

/// Arms that are further apart than this do not get in each other's way, rad.
const APART_RAD: f64 = 2.97;

/// How far an arm ends before its junction's middle at least, m.
const SHORTEST_TRIM_M: f64 = 3.0;

/// Radius of the tip between arms that nobody turns between, m.
const TIP_M: f64 = 1.0;

/// Turns up to this are bends of the street, not turns into another, rad.
const STRAIGHT_RAD: f64 = 0.6;

/// Radius of such bends at least, m.
const GENTLE_M: f64 = 15.0;

/// The limit of turns, km/h.
const TURN_LIMIT_KMH: f64 = 30.0;

/// A street's end at a junction, seen by who looks away from the junction.
#[derive(Clone, Debug)]
pub struct Arm {
    pub road: u32,
    pub profile: Profile,
    /// The end of the reference line, heading away from the junction.
    pub pose: Pose,
    /// How far the lanes' middle lies left of the reference line, m.
    pub shift_m: f64,
    /// Whether the road begins here.
    pub is_start: bool,
    /// Lanes into the junction, from the middle outwards, with what lies beside them.
    pub incoming: Vec<Lane>,
    pub outgoing: Vec<Lane>,
}

impl Arm {
    /// An end of a road with these sections.
    pub fn new(
        road: u32,
        profile: &Profile,
        pose: Pose,
        sections: &[Section],
        is_start: bool,
    ) -> Arm {
        let section = if is_start { &sections[0] } else { &sections[sections.len() - 1] };
        let width_m = |lane: &Lane| if is_start { lane.start_m } else { lane.end_m };
        let even = |lanes: &[Lane]| -> Vec<Lane> {
            lanes.iter().map(|lane| Lane::even(lane.used_for, width_m(lane))).collect()
        };
        let (left, right) = (even(&section.left), even(&section.right));
        let (incoming, outgoing) = if is_start { (left, right) } else { (right, left) };
        let shift_m = if is_start { profile.shift_m() } else { -profile.shift_m() };
        Arm { road, profile: *profile, pose, shift_m, is_start, incoming, outgoing }
    }

    /// Driving lanes that lead into the junction.
    pub fn lanes_in(&self) -> usize {
        count(&self.incoming)
    }

    /// Driving lanes that lead out of it.
    pub fn lanes_out(&self) -> usize {
        count(&self.outgoing)
    }

    /// Distance of the kerb from the reference line, m: on the left, where traffic comes in, and
    /// on the right.
    pub fn kerbs_m(&self) -> [f64; 2] {
        let reach = |lanes: &[Lane]| {
            let carriageway = |lane: &&Lane| !matches!(lane.used_for, Use::Verge | Use::Sidewalk);
            lanes.iter().filter(carriageway).map(|lane| lane.start_m).sum::<f64>()
        };
        [reach(&self.incoming) + self.shift_m, reach(&self.outgoing) - self.shift_m]
    }

    /// The left edge of an incoming lane, heading into the junction.
    fn entry(&self, index: usize) -> Pose {
        let inside_m: f64 = self.incoming[..index].iter().map(|lane| lane.start_m).sum();
        self.pose.shifted(self.shift_m + inside_m).reversed()
    }

    /// The left edge of an outgoing lane, heading out of the junction.
    fn exit(&self, index: usize) -> Pose {
        let inside_m: f64 = self.outgoing[..index].iter().map(|lane| lane.start_m).sum();
        self.pose.shifted(self.shift_m - inside_m)
    }

    fn incoming_id(&self, index: usize) -> i32 {
        (index as i32 + 1) * if self.is_start { 1 } else { -1 }
    }

    fn outgoing_id(&self, index: usize) -> i32 {
        -self.incoming_id(index)
    }

    fn tie(&self) -> Tie {
        if self.is_start { Tie::RoadStart(self.road) } else { Tie::RoadEnd(self.road) }
    }
}

/// The place of the `nth` driving lane; behind all of them if there are fewer.
fn nth_driving(lanes: &[Lane], nth: usize) -> usize {
    let is_driving = |i: &usize| lanes[*i].used_for == Use::Driving;
    let behind = lanes.iter().rposition(|lane| matches!(lane.used_for, Use::Driving | Use::Median));
    (0..lanes.len()).filter(is_driving).nth(nth).unwrap_or(behind.map_or(0, |last| last + 1))
}

fn count(lanes: &[Lane]) -> usize {
    lanes.iter().filter(|lane| lane.used_for == Use::Driving).count()
}

/// Angle from each arm to the next, anticlockwise; arms are sorted by heading.
fn gaps_rad(arms: &[Arm]) -> Vec<f64> {
    let heading = |i: usize| arms[i % arms.len()].pose.heading_rad;
    (0..arms.len()).map(|i| (heading(i + 1) - heading(i)).rem_euclid(TAU)).collect()
}

/// How far before the junction's middle each arm ends, m, so that kerbs join in round corners.
/// Arms are given as they would be at the middle, sorted by heading.
pub fn trims_m(arms: &[Arm]) -> Vec<f64> {
    let mut trims_m = vec![SHORTEST_TRIM_M; arms.len()];
    for (i, gap_rad) in gaps_rad(arms).into_iter().enumerate() {
        let next = (i + 1) % arms.len();
        if gap_rad >= APART_RAD {
            continue;
        }
        let (left_m, right_m) = (arms[i].kerbs_m()[0], arms[next].kerbs_m()[1]);
        let is_turned = gap_rad >= PI - SHARPEST_RAD;
        let corner_m = arms[i].profile.corner_m.max(arms[next].profile.corner_m);
        let round_m = if is_turned { corner_m } else { TIP_M } / (gap_rad / 2.0).tan();
        let meet = |own_m: f64, other_m: f64| (other_m + own_m * gap_rad.cos()) / gap_rad.sin();
        trims_m[i] = trims_m[i].max(meet(left_m, right_m) + round_m);
        trims_m[next] = trims_m[next].max(meet(right_m, left_m) + round_m);
    }
    for (i, j) in (0..arms.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let turn_rad = wrap_angle(arms[i].pose.heading_rad - arms[j].pose.heading_rad - PI).abs();
        if turn_rad < STRAIGHT_RAD {
            let widest_m =
                arms[i].kerbs_m().into_iter().chain(arms[j].kerbs_m()).fold(0.0, f64::max);
            let eased_m = (turn_rad / 2.0).tan() * (GENTLE_M + widest_m);
            trims_m[i] = trims_m[i].max(eased_m);
            trims_m[j] = trims_m[j].max(eased_m);
        }
    }
    trims_m
}

/// Whether who comes in on an arm can turn right into the next one.
pub fn can_turn_right(arms: &[Arm], arm: usize) -> bool {
    let next = &arms[(arm + 1) % arms.len()];
    let turn_rad = gaps_rad(arms)[arm] - PI;
    next.lanes_out() > 0 && (-SHARPEST_RAD..-0.3).contains(&turn_rad)
}

/// A junction under construction: its roads, and how they connect its arms.
pub struct Crossing<'arms> {
    id: u32,
    arms: &'arms [Arm],
    /// Ids of its roads count from here.
    first_road: u32,
    pub roads: Vec<Road>,
    pub connections: Vec<Connection>,
}

impl<'arms> Crossing<'arms> {
    /// All ways between the arms, which are sorted by heading. The outermost lane of a turn into
    /// the next arm on the right carries the side-walk around the corner; where nobody drives
    /// there, a road of its own does.
    pub fn new(id: u32, arms: &'arms [Arm], first_road: u32) -> Self {
        let (roads, connections) = (Vec::new(), Vec::new());
        let mut crossing = Crossing { id, arms, first_road, roads, connections };
        for (from, gap_rad) in gaps_rad(arms).into_iter().enumerate() {
            let corner = (from + 1) % arms.len();
            let mut has_corner = false;
            for (to, from_lane, to_lane) in ways(arms, from) {
                let is_corner = to == corner
                    && from_lane + 1 == arms[from].lanes_in()
                    && to_lane + 1 == arms[to].lanes_out();
                has_corner |= is_corner;
                let lanes = [
                    nth_driving(&arms[from].incoming, from_lane),
                    nth_driving(&arms[to].outgoing, to_lane),
                ];
                crossing.add([from, to], lanes, true, is_corner);
            }
            let is_walked =
                |lanes: &[Lane]| lanes.iter().any(|lane| lane.used_for == Use::Sidewalk);
            let has_walks = is_walked(&arms[from].incoming) && is_walked(&arms[corner].outgoing);
            if !has_corner && has_walks && gap_rad >= PI - SHARPEST_RAD {
                let edge = |lanes: &[Lane]| nth_driving(lanes, usize::MAX);
                let lanes = [edge(&arms[from].incoming), edge(&arms[corner].outgoing)];
                crossing.add([from, corner], lanes, false, true);
            }
        }
        crossing
    }

    /// A road from one arm into another along the left edges of the lanes at the given places.
    fn add(&mut self, [from, to]: [usize; 2], lanes: [usize; 2], driven: bool, is_corner: bool) {
        let (from, to) = (&self.arms[from], &self.arms[to]);
        let id = self.first_road + self.roads.len() as u32;
        let mut right = Vec::new();
        let mut pairs = Vec::new();
        let width_m =
            |lanes: &[Lane], place: Option<usize>| place.map_or(0.0, |i| lanes[i].start_m);
        let mut carry = |used_for: Use, places: [Option<usize>; 2]| {
            let widths_m = [width_m(&from.incoming, places[0]), width_m(&to.outgoing, places[1])];
            if places == [None, None] {
                return;
            }
            let predecessor = places[0].map(|place| from.incoming_id(place));
            let successor = places[1].map(|place| to.outgoing_id(place));
            right.push(Lane {
                used_for,
                start_m: widths_m[0],
                end_m: widths_m[1],
                predecessor,
                successor,
            });
            pairs.extend(predecessor.map(|lane| (lane, -(right.len() as i32))));
        };
        if driven {
            carry(Use::Driving, lanes.map(Some));
        }
        if is_corner {
            for used_for in [Use::Shoulder, Use::Verge, Use::Sidewalk] {
                let place =
                    |lanes: &[Lane]| lanes.iter().position(|lane| lane.used_for == used_for);
                carry(used_for, [place(&from.incoming), place(&to.outgoing)]);
            }
        }
        let course = Course::joining(from.entry(lanes[0]), to.exit(lanes[1]));
        let section = Section { s_m: 0.0, length_m: course.length_m(), left: Vec::new(), right };
        let limit_kmh = from.profile.limit_kmh.min(to.profile.limit_kmh);
        let turn_rad = wrap_angle(course.end().heading_rad - course.start().heading_rad);
        self.roads.push(Road {
            id,
            name: String::new(),
            junction: Some(self.id),
            class: from.profile.class,
            limit_kmh: if turn_rad.abs() > STRAIGHT_RAD {
                limit_kmh.min(TURN_LIMIT_KMH)
            } else {
                limit_kmh
            },
            course,
            shift_m: 0.0,
            sections: vec![section],
            predecessor: from.tie(),
            successor: to.tie(),
            crosswalks: Vec::new(),
        });
        self.connections.push(Connection { incoming: from.road, connecting: id, lanes: pairs });
    }
}

/// All ways from an arm: the arm they lead into, the lane before and the lane behind, counted
/// from the left.
fn ways(arms: &[Arm], from: usize) -> Vec<(usize, usize, usize)> {
    if arms[from].lanes_in() == 0 {
        return Vec::new();
    }
    let turn_rad =
        |to: usize| wrap_angle(arms[to].pose.heading_rad - arms[from].pose.heading_rad - PI);
    let may_be_left_by = |to: &usize| {
        *to != from && arms[*to].lanes_out() > 0 && turn_rad(*to).abs() <= SHARPEST_RAD
    };
    let mut exits: Vec<usize> = (0..arms.len()).filter(may_be_left_by).collect();
    exits.sort_by(|&a, &b| turn_rad(b).total_cmp(&turn_rad(a)));
    let seen: Vec<Exit> = exits
        .iter()
        .map(|&to| Exit { turn_rad: turn_rad(to), lanes: arms[to].lanes_out() })
        .collect();
    let found = movements(arms[from].lanes_in(), &seen);
    found.into_iter().map(|way| (exits[way.exit], way.from_lane, way.to_lane)).collect()
}
