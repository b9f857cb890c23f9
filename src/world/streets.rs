//! Streets as traffic uses them: lanes in even steps, what leads where, and what is in whose way.
//!
//! Made once from a map; afterwards a look-up is an index and a line between two points.

use glam::{DVec2, DVec3};

/// Distance between two points of a lane or a walk, m, nearly: lengths are whole multiples.
pub const STEP_M: f64 = 1.0;

/// Index in [`Streets::lanes`].
pub type LaneId = usize;

/// Index in [`Streets::walks`].
pub type WalkId = usize;

/// A line in even steps.
#[derive(Clone, Debug)]
pub struct Course {
    points_m: Vec<DVec2>,
    /// Of the ground at the points.
    heights_m: Vec<f64>,
    step_m: f64,
}

/// A place on a [`Course`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    pub position_m: DVec2,
    /// Unit vector along the course.
    pub forward: DVec2,
    /// Height of the ground, m.
    pub height_m: f64,
}

/// Between two junctions the longest vehicle has so much room to stand in, or nobody stops, m.
const WAITING_M: f64 = 15.0;

/// Where vehicles stop before a junction if nothing keeps them further away, m from its edge.
const LINE_M: f64 = 0.5;

/// What differs in height by more than this is on another level: a bridge and what is below it, m.
pub const LEVEL_M: f64 = 2.5;

impl Course {
    /// Through points on the ground, of any spacing; at least two that differ.
    pub fn through(points_m: &[DVec3]) -> Course {
        let flat = |w: &[DVec3]| w[0].truncate().distance(w[1].truncate());
        let lengths: Vec<f64> = points_m.windows(2).map(flat).collect();
        let total: f64 = lengths.iter().sum();
        let steps = (total / STEP_M).round().max(1.0);
        let step_m = total / steps;
        let mut even = vec![points_m[0]];
        let (mut piece, mut before) = (0, 0.0);
        for step in 1..steps as usize {
            let at = step as f64 * step_m;
            while piece + 1 < lengths.len() && before + lengths[piece] < at {
                before += lengths[piece];
                piece += 1;
            }
            let fraction = ((at - before) / lengths[piece].max(1e-9)).clamp(0.0, 1.0);
            even.push(points_m[piece].lerp(points_m[piece + 1], fraction));
        }
        even.extend(points_m.last());
        let heights_m = even.iter().map(|point| point.z).collect();
        Course { points_m: even.iter().map(|point| point.truncate()).collect(), heights_m, step_m }
    }

    pub fn length_m(&self) -> f64 {
        (self.points_m.len() - 1) as f64 * self.step_m
    }

    pub fn points_m(&self) -> &[DVec2] {
        &self.points_m
    }

    /// The spot at arc length `s_m`; beyond the ends the line goes straight on.
    pub fn at(&self, s_m: f64) -> Spot {
        let place = s_m / self.step_m;
        let index = (place.max(0.0) as usize).min(self.points_m.len() - 2);
        let (from, to) = (self.points_m[index], self.points_m[index + 1]);
        let position_m = from + (to - from) * (place - index as f64);
        let share = (place - index as f64).clamp(0.0, 1.0);
        let (low_m, high_m) = (self.heights_m[index], self.heights_m[index + 1]);
        Spot {
            position_m,
            forward: (to - from) / self.step_m.max(1e-9),
            height_m: low_m + (high_m - low_m) * share,
        }
    }

    /// Arc length of the nearest point and the distance from it, positive left, m.
    pub fn project(&self, position_m: DVec2) -> (f64, f64) {
        let mut best = (f64::INFINITY, 0.0, 0.0);
        for (index, pair) in self.points_m.windows(2).enumerate() {
            let along = pair[1] - pair[0];
            let from = position_m - pair[0];
            let fraction = (from.dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
            let off = from - along * fraction;
            if off.length_squared() < best.0 {
                let side = along.perp_dot(from).signum() * off.length();
                best = (off.length_squared(), (index as f64 + fraction) * self.step_m, side);
            }
        }
        (best.1, best.2)
    }
}

/// A lane that is driven on, in its direction of traffic.
#[derive(Clone, Debug)]
pub struct Lane {
    /// `road/section/lane` of the map.
    pub name: String,
    pub course: Course,
    pub width_m: f64,
    /// Up to here it is wide enough for a vehicle; its length, unless it narrows to nothing, m.
    pub usable_m: f64,
    /// Vehicles stop so far before its end, where they have to wait there, m.
    pub line_m: f64,
    /// From its start to where it ends for good, straight ahead, m; `None` where it leads on.
    pub dead_end_m: Option<f64>,
    pub limit_mps: f64,
    /// Index in [`Streets::junctions`], for a lane that leads through one.
    pub junction: Option<usize>,
    pub next: Vec<LaneId>,
    pub previous: Vec<LaneId>,
    /// Beside it, in the same direction, where changing is allowed.
    pub left: Option<LaneId>,
    pub right: Option<LaneId>,
    /// Largest curvature of the next steps, 1/m, by the steps of the course.
    curvature_per_m: Vec<f64>,
}

impl Lane {
    pub fn new(name: String, course: Course, width_m: f64, limit_mps: f64) -> Lane {
        let curvature_per_m = curvature(&course);
        Lane {
            name,
            usable_m: course.length_m(),
            line_m: LINE_M,
            dead_end_m: None,
            course,
            width_m,
            limit_mps,
            junction: None,
            next: Vec::new(),
            previous: Vec::new(),
            left: None,
            right: None,
            curvature_per_m,
        }
    }

    pub fn length_m(&self) -> f64 {
        self.course.length_m()
    }

    /// Curvature at an arc length, 1/m, without sign.
    pub fn curvature_per_m(&self, s_m: f64) -> f64 {
        let index = (s_m.max(0.0) / self.course.step_m) as usize;
        self.curvature_per_m[index.min(self.curvature_per_m.len() - 1)]
    }

    /// Whether vehicles may stop here before the next junction. The same for all: a bicycle that
    /// stops where a bus cannot would stand in the way of the bus, which needs both junctions.
    pub fn is_waiting_place(&self) -> bool {
        self.junction.is_none() && self.length_m() >= WAITING_M
    }

    /// The arc length beside `s_m` on a neighbour, which may be longer or shorter in a bend.
    pub fn beside_m(&self, s_m: f64, neighbour: &Lane) -> f64 {
        s_m / self.length_m() * neighbour.length_m()
    }
}

/// Curvature over three steps each, so that a corner between two chords is not a hairpin.
fn curvature(course: &Course) -> Vec<f64> {
    let reach_m = 3.0 * course.step_m;
    let steps = course.points_m.len() - 1;
    let heading = |s_m: f64| course.at(s_m.clamp(0.0, course.length_m() - 1e-6)).forward;
    let bend = |index: usize| {
        let s_m = (index as f64 + 0.5) * course.step_m;
        let (from, to) = ((s_m - reach_m).max(0.0), (s_m + reach_m).min(course.length_m()));
        heading(from).angle_to(heading(to)).abs() / (to - from).max(course.step_m)
    };
    (0..steps).map(bend).collect()
}

/// Two lanes of a junction that cross: where on the first the second is in the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conflict {
    pub with: LaneId,
    /// Arc length on the own lane up to which bodies could meet, m.
    pub to_m: f64,
    /// Only bodies that need more room than a car does in a bend could meet.
    pub is_wide: bool,
}

/// Lanes that lead through one junction.
#[derive(Clone, Debug, Default)]
pub struct Junction {
    pub lanes: Vec<LaneId>,
}

/// A side-walk, or the edge of a road that has none.
#[derive(Clone, Debug)]
pub struct Walk {
    pub course: Course,
    /// How far from the line people walk, m.
    pub half_width_m: f64,
    /// Height of the side-walk above the street, m.
    pub kerb_m: f64,
    /// Where one can go on from its start and from its end.
    pub onward: [Vec<Onward>; 2],
    /// The walk on the other side of the street.
    pub opposite: Option<WalkId>,
}

/// From the end of a walk to the end of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Onward {
    pub walk: WalkId,
    /// Whether one arrives at its end, and goes on backwards.
    pub at_end: bool,
    /// Whether a street lies between them.
    pub crosses: bool,
}

/// A town's lanes and walks.
#[derive(Clone, Debug, Default)]
pub struct Streets {
    pub lanes: Vec<Lane>,
    pub junctions: Vec<Junction>,
    pub walks: Vec<Walk>,
    /// By lane: others that cross it inside its junction.
    conflicts: Vec<Vec<Conflict>>,
    /// By lane: others that begin where it begins, and up to where they are one, m.
    siblings: Vec<Vec<(LaneId, f64)>>,
    /// By lane: others of its junction that lead into the same lane.
    merging: Vec<Vec<LaneId>>,
    cells: Cells,
}

/// Lanes nearer than this to each other are in each other's way, for cars, and for what is long or
/// wide, where the lanes do not run side by side, m.
const CONFLICT_M: f64 = 2.6;
const WIDE_CONFLICT_M: f64 = 4.2;

/// Lanes whose directions differ by less run side by side, rad.
const PARALLEL_RAD: f64 = 0.35;

impl Streets {
    /// Put lanes and walks together; `next` of the lanes is what leads where.
    pub fn new(mut lanes: Vec<Lane>, walks: Vec<Walk>) -> Streets {
        for id in 0..lanes.len() {
            for next in lanes[id].next.clone() {
                lanes[next].previous.push(id);
            }
        }
        let count = lanes.iter().filter_map(|lane| lane.junction).max().map_or(0, |most| most + 1);
        let mut junctions = vec![Junction::default(); count];
        for (id, lane) in lanes.iter().enumerate() {
            if let Some(junction) = lane.junction {
                junctions[junction].lanes.push(id);
            }
        }
        find_dead_ends(&mut lanes);
        let mut streets = Streets {
            conflicts: vec![Vec::new(); lanes.len()],
            siblings: vec![Vec::new(); lanes.len()],
            merging: vec![Vec::new(); lanes.len()],
            cells: Cells::new(&lanes),
            lanes,
            junctions,
            walks,
        };
        streets.find_conflicts();
        streets
    }

    fn find_conflicts(&mut self) {
        for (a, lane) in self.lanes.iter().enumerate() {
            for &from in &lane.previous {
                for &b in self.lanes[from].next.iter().filter(|b| **b != a) {
                    let together = self.overlap(a, b, CONFLICT_M).map_or(0.0, |(_, to_m)| to_m);
                    self.siblings[a].push((b, together));
                }
            }
        }
        for junction in &self.junctions {
            for &a in &junction.lanes {
                for &b in junction.lanes.iter().filter(|b| **b != a) {
                    let shares = |x: &[LaneId], y: &[LaneId]| x.iter().any(|id| y.contains(id));
                    let (lane, other) = (&self.lanes[a], &self.lanes[b]);
                    if shares(&lane.next, &other.next) {
                        self.merging[a].push(b);
                    } else if !shares(&lane.previous, &other.previous)
                        && !lane.next.contains(&b)
                        && !other.next.contains(&a)
                    {
                        let conflict = self.conflict(a, b);
                        self.conflicts[a].extend(conflict);
                    }
                }
            }
        }
    }

    fn conflict(&self, a: LaneId, b: LaneId) -> Option<Conflict> {
        if let Some((_, to_m)) = self.overlap(a, b, CONFLICT_M) {
            return Some(Conflict { with: b, to_m, is_wide: false });
        }
        let (from_m, to_m) = self.overlap(a, b, WIDE_CONFLICT_M)?;
        // Lanes that come to lie side by side meet at an angle before.
        let turns = |at_m: f64| {
            let here = self.lanes[a].course.at(at_m);
            let (there_m, _) = self.lanes[b].course.project(here.position_m);
            let turn_rad = here.forward.angle_to(self.lanes[b].course.at(there_m).forward).abs();
            turn_rad > PARALLEL_RAD
        };
        let middle_m = (from_m + to_m) / 2.0;
        let is_wide = true;
        let meets = [from_m, middle_m, to_m].into_iter().any(turns);
        meets.then_some(Conflict { with: b, to_m, is_wide })
    }

    /// The stretch of lane `a` that is nearer than `near_m` to lane `b`.
    fn overlap(&self, a: LaneId, b: LaneId, near_m: f64) -> Option<(f64, f64)> {
        let (a, b) = (&self.lanes[a].course, &self.lanes[b].course);
        let near = |p: &DVec2| b.points_m.iter().any(|q| p.distance_squared(*q) < near_m.powi(2));
        let first = a.points_m.iter().position(near)?;
        let last = a.points_m.iter().rposition(near)?;
        let s_m = |index: usize| index as f64 * a.step_m;
        Some(((s_m(first) - near_m / 2.0).max(0.0), s_m(last) + near_m / 2.0))
    }

    /// Lanes that cross `lane` inside its junction.
    pub fn conflicts(&self, lane: LaneId) -> &[Conflict] {
        &self.conflicts[lane]
    }

    /// Lanes that begin as `lane` does, and the arc length up to which they are one, m.
    pub fn siblings(&self, lane: LaneId) -> &[(LaneId, f64)] {
        &self.siblings[lane]
    }

    /// Lanes of the same junction that end as `lane` does.
    pub fn merging(&self, lane: LaneId) -> &[LaneId] {
        &self.merging[lane]
    }

    /// Lanes whose middle line passes nearer than about `radius_m`, ascending.
    pub fn lanes_near(&self, position_m: DVec2, radius_m: f64) -> Vec<LaneId> {
        self.cells.near(position_m, radius_m)
    }
}

/// Mark lanes that lead nowhere, and those that lead into such alone.
fn find_dead_ends(lanes: &mut [Lane]) {
    for lane in lanes.iter_mut().filter(|lane| lane.next.is_empty()) {
        lane.dead_end_m = Some(lane.usable_m);
    }
    // A lane that drops is a few sections long.
    const SECTIONS: usize = 8;
    for _ in 0..SECTIONS {
        for id in 0..lanes.len() {
            let beyond = lanes[id].next.iter().map(|next| lanes[*next].dead_end_m);
            let nearest = beyond.collect::<Option<Vec<f64>>>();
            let nearest = nearest.and_then(|ends| ends.into_iter().reduce(f64::min));
            if let Some(end_m) = nearest {
                lanes[id].dead_end_m = Some(lanes[id].length_m() + end_m);
            }
        }
    }
}

/// Side of a cell, m.
const CELL_M: f64 = 8.0;

/// Which lanes pass through which square of the ground.
#[derive(Clone, Debug, Default)]
struct Cells {
    origin_m: DVec2,
    columns: usize,
    rows: usize,
    lanes: Vec<Vec<LaneId>>,
}

impl Cells {
    fn new(lanes: &[Lane]) -> Cells {
        let points = || lanes.iter().flat_map(|lane| lane.course.points_m());
        let low = points().copied().reduce(DVec2::min).unwrap_or_default();
        let high = points().copied().reduce(DVec2::max).unwrap_or_default();
        let size = ((high - low) / CELL_M).floor();
        let (columns, rows) = (size.x as usize + 1, size.y as usize + 1);
        let mut cells =
            Cells { origin_m: low, columns, rows, lanes: vec![Vec::new(); columns * rows] };
        for (id, lane) in lanes.iter().enumerate() {
            for point in lane.course.points_m() {
                let place = ((*point - low) / CELL_M).floor();
                let cell = &mut cells.lanes[place.y as usize * columns + place.x as usize];
                if cell.last() != Some(&id) {
                    cell.push(id);
                }
            }
        }
        cells
    }

    fn near(&self, position_m: DVec2, radius_m: f64) -> Vec<LaneId> {
        let low = ((position_m - radius_m - self.origin_m) / CELL_M).floor();
        let high = ((position_m + radius_m - self.origin_m) / CELL_M).floor();
        let clip = |value: f64, count: usize| value.clamp(0.0, count as f64 - 1.0) as usize;
        let mut found = Vec::new();
        if high.x < 0.0 || high.y < 0.0 || self.lanes.is_empty() {
            return found;
        }
        for row in clip(low.y, self.rows)..=clip(high.y, self.rows) {
            for column in clip(low.x, self.columns)..=clip(high.x, self.columns) {
                found.extend(&self.lanes[row * self.columns + column]);
            }
        }
        found.sort_unstable();
        found.dedup();
        found
    }
}
