//! Profiles: what lies across a street, and how that changes along it.

/// What a lane is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    Median,
    Driving,
    Shoulder,
    Verge,
    Sidewalk,
}

/// One direction of travel of a street, from its middle outwards; widths in metres, 0 for none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    pub lanes: usize,
    pub shoulder_m: f64,
    pub verge_m: f64,
    pub sidewalk_m: f64,
}

/// What lies across a street.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// OpenDRIVE's type of the road: `town`, `rural`, `motorway`, `lowSpeed`.
    pub class: &'static str,
    pub limit_kmh: f64,
    pub lane_m: f64,
    /// Width of what keeps the directions apart, m.
    pub median_m: f64,
    /// With the direction in which the street is drawn.
    pub forward: Side,
    pub backward: Side,
    /// Radius of the kerb where the street meets another, m.
    pub corner_m: f64,
    /// Length of a further lane on the right before each crossing, m; 0 for none.
    pub turn_lane_m: f64,
    /// Whether people cross at its junctions.
    pub has_crosswalks: bool,
}

/// A lane of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lane {
    pub used_for: Use,
    /// Widths at both ends of the section, m; a smooth cubic lies between them.
    pub start_m: f64,
    pub end_m: f64,
    /// Lane ids in what comes before and after.
    pub predecessor: Option<i32>,
    pub successor: Option<i32>,
}

/// A stretch of road with the same lanes throughout.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    pub s_m: f64,
    pub length_m: f64,
    /// From the middle outwards.
    pub left: Vec<Lane>,
    pub right: Vec<Lane>,
}

/// Further lanes on the right at the ends of a street, as lengths in metres; 0 for none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FurtherLanes {
    pub forward_start_m: f64,
    pub forward_end_m: f64,
    pub backward_start_m: f64,
    pub backward_end_m: f64,
}

impl Lane {
    /// A lane of the same width throughout, linked to nothing.
    pub fn even(used_for: Use, width_m: f64) -> Lane {
        Lane { used_for, start_m: width_m, end_m: width_m, predecessor: None, successor: None }
    }
}

impl Profile {
    /// A street with the same in both directions.
    pub const fn two_way(class: &'static str, limit_kmh: f64, lane_m: f64, side: Side) -> Profile {
        Profile {
            class,
            limit_kmh,
            lane_m,
            median_m: 0.0,
            forward: side,
            backward: side,
            corner_m: 6.0,
            turn_lane_m: 0.0,
            has_crosswalks: side.sidewalk_m > 0.0,
        }
    }

    /// A street that is driven only as it is drawn; `left` is what lies left of its lanes.
    pub const fn one_way(
        class: &'static str,
        limit_kmh: f64,
        lane_m: f64,
        side: Side,
        left: Side,
    ) -> Profile {
        Profile { backward: left, ..Profile::two_way(class, limit_kmh, lane_m, side) }
    }

    /// How far the middle of the lanes' markings lies left of the street's course: a one-way
    /// street has its lanes on both sides of it.
    pub fn shift_m(&self) -> f64 {
        match self.backward.lanes {
            0 => 0.5 * self.lane_m * self.forward.lanes as f64,
            _ => 0.0,
        }
    }

    /// The sections of a street of `length_m`; every change of lanes takes `taper_m`.
    pub fn sections(&self, length_m: f64, further: FurtherLanes, taper_m: f64) -> Vec<Section> {
        let mut cuts_m = vec![0.0, length_m];
        for start_m in [further.forward_start_m, further.backward_start_m] {
            if start_m > 0.0 {
                cuts_m.extend([start_m, start_m + taper_m]);
            }
        }
        for end_m in [further.forward_end_m, further.backward_end_m] {
            if end_m > 0.0 {
                cuts_m.extend([length_m - end_m, length_m - end_m - taper_m]);
            }
        }
        cuts_m.sort_by(f64::total_cmp);
        cuts_m.dedup_by(|a, b| (*a - *b).abs() < 1e-6);
        let mut sections: Vec<Section> = cuts_m
            .windows(2)
            .map(|ends| {
                let at = |start_m: f64, end_m: f64| {
                    ends_of(ends, length_m, start_m, end_m, taper_m)
                        .map(|share| share * self.lane_m)
                };
                Section {
                    s_m: ends[0],
                    length_m: ends[1] - ends[0],
                    left: self.lanes(
                        &self.backward,
                        at(further.backward_start_m, further.backward_end_m),
                    ),
                    right: self
                        .lanes(&self.forward, at(further.forward_start_m, further.forward_end_m)),
                }
            })
            .collect();
        for i in 1..sections.len() {
            let (before, after) = sections.split_at_mut(i);
            let (before, after) = (&mut before[i - 1], &mut after[0]);
            link(&mut before.left, &mut after.left, 1);
            link(&mut before.right, &mut after.right, -1);
        }
        sections
    }

    /// The lanes of one side, with a further one of the given widths at both ends.
    fn lanes(&self, side: &Side, further_m: [f64; 2]) -> Vec<Lane> {
        let driving = [(Use::Driving, self.lane_m)].repeat(side.lanes);
        let outside = [
            (Use::Shoulder, side.shoulder_m),
            (Use::Verge, side.verge_m),
            (Use::Sidewalk, side.sidewalk_m),
        ];
        let further = Lane { end_m: further_m[1], ..Lane::even(Use::Driving, further_m[0]) };
        let even = |(used_for, width_m): (Use, f64)| Lane::even(used_for, width_m);
        let inside = [(Use::Median, self.median_m / 2.0)].into_iter().chain(driving).map(even);
        let lanes = inside.chain([further]).chain(outside.map(even));
        lanes.filter(|lane| lane.start_m + lane.end_m > 0.0).collect()
    }
}

/// How much of a further lane there is at both ends of a stretch, 0 to 1.
fn ends_of(ends_m: &[f64], length_m: f64, start_m: f64, end_m: f64, taper_m: f64) -> [f64; 2] {
    let share = |s_m: f64| {
        let share = |reach_m: f64, from_end_m: f64| match reach_m > 0.0 {
            true => ((reach_m + taper_m - from_end_m) / taper_m).clamp(0.0, 1.0),
            false => 0.0,
        };
        share(start_m, s_m).max(share(end_m, length_m - s_m))
    };
    // Rounding must not leave a sliver of a lane.
    [share(ends_m[0]), share(ends_m[1])].map(|share| if share < 1e-6 { 0.0 } else { share })
}

/// Link the lanes of two sections that follow each other: the k-th of a use to the k-th.
fn link(before: &mut [Lane], after: &mut [Lane], sign: i32) {
    let nth = |lanes: &[Lane], i: usize| {
        lanes[..i].iter().filter(|lane| lane.used_for == lanes[i].used_for).count()
    };
    for i in 0..before.len() {
        for j in 0..after.len() {
            let is_same =
                before[i].used_for == after[j].used_for && nth(before, i) == nth(after, j);
            if is_same && before[i].end_m > 0.0 && after[j].start_m > 0.0 {
                before[i].successor = Some(sign * (j as i32 + 1));
                after[j].predecessor = Some(sign * (i as i32 + 1));
            }
        }
    }
}
