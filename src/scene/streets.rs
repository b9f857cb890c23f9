//! Streets as surfaces: carriageways, kerbs, side-walks, verges, medians, and the slopes and
//! bridges that carry them.

use glam::{DVec2, DVec3, Vec3};

use crate::{
    footprint::Footprint,
    map::{
        opendrive::{LaneKind, Road},
        road_map::RoadMap,
    },
    scene::{
        course::{Cut, cuts},
        driven::Driven,
        mesh::{Material, Mesh},
        solids::{Paint, paint},
        terrain::{GRASS, Terrain},
    },
    towns::scenery::furniture::{KERB_HEIGHT_M, KERB_WIDTH_M},
};

pub const ASPHALT: Paint = paint(Material::Asphalt, [92, 93, 97]);
const CYCLE_TRACK: Paint = paint(Material::Asphalt, [128, 84, 74]);
const PAVEMENT: Paint = paint(Material::Concrete, [164, 160, 152]);
const KERB: Paint = paint(Material::Concrete, [186, 184, 178]);
const BRIDGE: Paint = paint(Material::Concrete, [150, 149, 145]);

/// Longest pieces of straight roads, m: where all is flat, and where slopes change below them.
const LONGEST_M: f64 = 40.0;
const LONGEST_ON_HILLS_M: f64 = 10.0;

/// Where a raised strip meets another carriageway it is cut in pieces down to this length, m.
const SHORTEST_M: f64 = 0.5;

/// Kerbs reach so far into the road, m.
const KERB_FOOT_M: f64 = 0.02;

/// A road that is higher above the ground than this is a bridge, m.
const BRIDGE_M: f64 = 1.6;
const SLAB_M: f64 = 0.9;
const PARAPET_M: f64 = 0.9;
const PARAPET_WIDTH_M: f64 = 0.25;

/// Slopes beside a road: level for so much, then down into the ground, m; metres out a metre down.
const SHOULDER_M: f64 = 0.3;
const SLOPE: f64 = 1.5;
const INTO_GROUND_M: f64 = 0.15;

/// What a lane looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Surface {
    paint: Paint,
    is_raised: bool,
}

/// All streets of a map.
pub fn draw(map: &RoadMap, terrain: &Terrain, driven: &Driven, mesh: &mut Mesh) {
    let longest_m = if terrain.is_flat { LONGEST_M } else { LONGEST_ON_HILLS_M };
    for road in &map.opendrive().roads {
        for section in 0..road.sections.len() {
            let cuts = cuts(road, section, longest_m);
            let street = Street { road, section, terrain, driven };
            street.draw(&cuts, mesh);
        }
    }
}

/// One section of a road, on its ground.
struct Street<'a> {
    road: &'a Road,
    section: usize,
    terrain: &'a Terrain,
    driven: &'a Driven,
}

impl Street<'_> {
    fn draw(&self, cuts: &[Cut], mesh: &mut Mesh) {
        let surfaces = self.surfaces();
        let mut first = 0;
        while first < surfaces.len() {
            let mut last = first;
            while last + 1 < surfaces.len() && surfaces[last + 1] == surfaces[first] {
                last += 1;
            }
            let Surface { paint, is_raised } = surfaces[first];
            let borders = [first, last + 1];
            if is_raised {
                self.raised(cuts, borders, paint, &surfaces, mesh);
            } else {
                self.level(cuts, borders, paint, mesh);
            }
            first = last + 1;
        }
        for pair in cuts.windows(2) {
            for is_left in [true, false] {
                self.edge([&pair[0], &pair[1]], is_left, &surfaces, mesh);
            }
        }
    }

    /// Of each lane, from left to right.
    fn surfaces(&self) -> Vec<Surface> {
        let lanes = &self.road.sections[self.section].lanes;
        let is_walked = |is_left: bool| {
            let own = lanes.iter().filter(|lane| (lane.id > 0) == is_left);
            own.clone().any(|lane| lane.kind == LaneKind::Sidewalk)
        };
        let of = |kind: LaneKind, is_left: bool| match kind {
            LaneKind::Driving | LaneKind::Parking | LaneKind::Shoulder => (ASPHALT, false),
            LaneKind::Biking => (CYCLE_TRACK, false),
            LaneKind::Sidewalk => (PAVEMENT, true),
            LaneKind::Curb => (KERB, true),
            LaneKind::Median => (GRASS, true),
            LaneKind::Border => (GRASS, is_walked(is_left)),
            LaneKind::Other => (GRASS, false),
        };
        let surfaces = lanes.iter().map(|lane| of(lane.kind, lane.id > 0));
        surfaces.map(|(paint, is_raised)| Surface { paint, is_raised }).collect()
    }

    /// A strip at the height of the road; grass lies only where nobody drives.
    fn level(&self, cuts: &[Cut], borders: [usize; 2], paint: Paint, mesh: &mut Mesh) {
        if paint.material == Material::Asphalt {
            return cuts.windows(2).for_each(|pair| strip(pair, borders, paint, mesh));
        }
        let mut pieces = Vec::new();
        cuts.windows(2).for_each(|pair| self.add_free([&pair[0], &pair[1]], borders, &mut pieces));
        pieces.iter().for_each(|pair| strip(pair, borders, paint, mesh));
    }

    /// A raised strip between two of the borders, with kerbs towards the carriageway; nothing
    /// where others drive.
    fn raised(
        &self,
        cuts: &[Cut],
        borders: [usize; 2],
        paint: Paint,
        surfaces: &[Surface],
        mesh: &mut Mesh,
    ) {
        let is_low = |beside: Option<&Surface>| beside.is_some_and(|beside| !beside.is_raised);
        let kerbs = [
            is_low(borders[0].checked_sub(1).and_then(|beside| surfaces.get(beside))),
            is_low(surfaces.get(borders[1])),
        ];
        let mut pieces = Vec::new();
        cuts.windows(2).for_each(|pair| self.add_free([&pair[0], &pair[1]], borders, &mut pieces));
        let goes_on = |before: Option<&[Cut; 2]>, after: Option<&[Cut; 2]>| {
            before.zip(after).is_some_and(|(before, after)| before[1].s_m == after[0].s_m)
        };
        for (index, pair) in pieces.iter().enumerate() {
            let before = index.checked_sub(1).and_then(|before| pieces.get(before));
            let piece = Raised { pair, borders, kerbs };
            piece.draw_top(paint, mesh);
            piece.draw_kerbs(mesh);
            if !goes_on(before, Some(pair)) {
                piece.draw_end(0, mesh);
            }
            if !goes_on(Some(pair), pieces.get(index + 1)) {
                piece.draw_end(1, mesh);
            }
        }
    }

    /// The parts of a strip where nobody drives.
    fn add_free(&self, pair: [&Cut; 2], borders: [usize; 2], free: &mut Vec<[Cut; 2]>) {
        if !self.is_driven(pair, borders) {
            free.push(pair.map(Cut::clone));
        } else if pair[1].s_m - pair[0].s_m > SHORTEST_M {
            let middle_m = 0.5 * (pair[0].s_m + pair[1].s_m);
            let middle = Cut::new(self.road, self.section, middle_m);
            self.add_free([pair[0], &middle], borders, free);
            self.add_free([&middle, pair[1]], borders, free);
        }
    }

    /// Whether another road is driven on where a strip lies.
    fn is_driven(&self, pair: [&Cut; 2], borders: [usize; 2]) -> bool {
        const MARGIN_M: f64 = 0.08;
        let middle = |cut: &Cut| {
            let [left, right] = borders.map(|border| cut.borders_t_m[border]);
            (cut.place(0.5 * (left + right), 0.0).truncate(), (left - right).abs())
        };
        let (from_m, from_width_m) = middle(pair[0]);
        let (to_m, to_width_m) = middle(pair[1]);
        let half_width_m = 0.5 * from_width_m.min(to_width_m) - MARGIN_M;
        let half_m = DVec2::new(0.5 * from_m.distance(to_m), half_width_m.max(0.01));
        let heading_rad = (to_m - from_m).to_angle();
        let footprint = Footprint::new(0.5 * (from_m + to_m), heading_rad, half_m);
        self.driven.covers(&footprint, 0.5 * (pair[0].height_m() + pair[1].height_m()))
    }

    /// What lies beyond the outermost border: a slope down to the ground, or the side of a bridge.
    fn edge(&self, pair: [&Cut; 2], is_left: bool, surfaces: &[Surface], mesh: &mut Mesh) {
        let side = if is_left { 1.0 } else { -1.0 };
        let outermost = if is_left { surfaces.first() } else { surfaces.last() };
        let is_raised = outermost.is_some_and(|surface| surface.is_raised);
        let top_m = if is_raised { KERB_HEIGHT_M } else { 0.0 };
        let border = |cut: &Cut| if is_left { 0 } else { cut.borders_t_m.len() - 1 };
        let at = |cut: &Cut, out_m: f64, above_m: f64| {
            cut.place(cut.borders_t_m[border(cut)] + side * out_m, above_m)
        };
        let drop_m = pair.map(|cut| {
            let beside = at(cut, 1.0, 0.0);
            cut.height_m() - self.terrain.height_m(beside.truncate())
        });
        let face = |outline: [(usize, f64, f64); 4], paint: Paint, mesh: &mut Mesh| {
            let mut outline: Vec<Vec3> = outline
                .iter()
                .map(|(end, out_m, above_m)| at(pair[*end], *out_m, *above_m).as_vec3())
                .collect();
            // Given for the right side; the left one is its mirror image.
            if is_left {
                outline.reverse();
            }
            mesh.ground_face(&outline, paint);
        };
        if drop_m[0].max(drop_m[1]) < BRIDGE_M {
            let is_between = self.road.junction.is_some() && !is_raised;
            let slope = if is_between { ASPHALT } else { GRASS };
            let down = drop_m.map(|drop_m| drop_m + INTO_GROUND_M);
            let mut foot =
                [0, 1].map(|end| at(pair[end], SHOULDER_M + SLOPE * down[end], -down[end]));
            let edge = [0, 1].map(|end| at(pair[end], 0.0, top_m));
            // On the inside of tight bends slopes meet in a point, or are left out.
            let looks_up = |corners: [DVec3; 3]| {
                let [a, b, c] = corners.map(DVec3::truncate);
                -side * (b - a).perp_dot(c - a) > 0.0
            };
            let is_fair =
                looks_up([foot[0], foot[1], edge[1]]) && looks_up([foot[0], edge[1], edge[0]]);
            if !is_fair {
                foot = [0.5 * (foot[0] + foot[1]); 2];
                if !looks_up([foot[0], edge[1], edge[0]]) {
                    return;
                }
            }
            let mut outline = [foot[0], foot[1], edge[1], edge[0]].map(|place| place.as_vec3());
            if is_left {
                outline.reverse();
            }
            mesh.ground_face(&outline, slope);
            return;
        }
        face(
            [(0, 0.0, -SLAB_M), (1, 0.0, -SLAB_M), (1, 0.0, top_m), (0, 0.0, top_m)],
            BRIDGE,
            mesh,
        );
        if !is_left {
            let under = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(end, last): (usize, usize)| {
                let cut = pair[end];
                let t_m = cut.borders_t_m[last * (cut.borders_t_m.len() - 1)];
                cut.place(t_m, -SLAB_M).as_vec3()
            });
            mesh.ground_face(&under, BRIDGE);
        }
        if self.is_open(pair, is_left) {
            let (low, high, width) = (top_m, top_m + PARAPET_M, PARAPET_WIDTH_M);
            face(
                [(0, width, -SLAB_M), (1, width, -SLAB_M), (1, width, high), (0, width, high)],
                BRIDGE,
                mesh,
            );
            face(
                [(0, width, high), (1, width, high), (1, 0.0, high), (0, 0.0, high)],
                BRIDGE,
                mesh,
            );
            face([(1, 0.0, low), (0, 0.0, low), (0, 0.0, high), (1, 0.0, high)], BRIDGE, mesh);
        }
    }

    /// Whether nobody drives beyond the outermost border.
    fn is_open(&self, pair: [&Cut; 2], is_left: bool) -> bool {
        let place = |cut: &Cut| {
            let border = if is_left { 0 } else { cut.borders_t_m.len() - 1 };
            let side = if is_left { 1.0 } else { -1.0 };
            cut.place(cut.borders_t_m[border] + side * 0.2, 0.0)
        };
        let (from, to) = (place(pair[0]), place(pair[1]));
        let along_m = (to - from).truncate();
        let half_m = DVec2::new(0.5 * along_m.length(), 0.12);
        let centre_m = 0.5 * (from + to).truncate();
        let footprint = Footprint::new(centre_m, along_m.to_angle(), half_m);
        !self.driven.covers(&footprint, 0.5 * (from.z + to.z))
    }
}

/// A piece of a raised strip between two borders.
struct Raised<'a> {
    pair: &'a [Cut; 2],
    borders: [usize; 2],
    /// Whether there is a kerb on the left and on the right.
    kerbs: [bool; 2],
}

impl Raised<'_> {
    /// Outer and inner edge of the kerb on the left, inner and outer edge of that on the right.
    fn place(&self, end: usize, edge: usize, above_m: f64) -> Vec3 {
        let cut = &self.pair[end];
        let [left_m, right_m] = self.borders.map(|border| cut.borders_t_m[border]);
        let stone_m = KERB_WIDTH_M.min(0.4 * (left_m - right_m).abs());
        let inset_m = self.kerbs.map(|kerb| if kerb { stone_m } else { 0.0 });
        let t_m = [left_m, left_m - inset_m[0], right_m + inset_m[1], right_m];
        cut.place(t_m[edge], above_m).as_vec3()
    }

    fn top(&self, [left, right]: [usize; 2], paint: Paint, mesh: &mut Mesh) {
        let at = |end: usize, edge: usize| self.place(end, edge, KERB_HEIGHT_M);
        mesh.ground_face(&[at(0, right), at(1, right), at(1, left), at(0, left)], paint);
    }

    fn draw_top(&self, paint: Paint, mesh: &mut Mesh) {
        self.top([1, 2], paint, mesh);
    }

    fn draw_kerbs(&self, mesh: &mut Mesh) {
        let (low, high) = (-KERB_FOOT_M, KERB_HEIGHT_M);
        let mut front = |edge: usize, [from, to]: [usize; 2]| {
            let outline = [(from, low), (to, low), (to, high), (from, high)];
            mesh.face(&outline.map(|(end, above_m)| self.place(end, edge, above_m)), KERB);
        };
        if self.kerbs[0] {
            front(0, [1, 0]);
        }
        if self.kerbs[1] {
            front(3, [0, 1]);
        }
        if self.kerbs[0] {
            self.top([0, 1], KERB, mesh);
        }
        if self.kerbs[1] {
            self.top([2, 3], KERB, mesh);
        }
    }

    fn draw_end(&self, end: usize, mesh: &mut Mesh) {
        let [from, to] = if end == 0 { [0, 3] } else { [3, 0] };
        let (low, high) = (-KERB_FOOT_M, KERB_HEIGHT_M);
        let outline = [(from, low), (to, low), (to, high), (from, high)];
        mesh.face(&outline.map(|(edge, above_m)| self.place(end, edge, above_m)), KERB);
    }
}

/// A strip of surface between two of the borders.
fn strip(pair: &[Cut], [left, right]: [usize; 2], paint: Paint, mesh: &mut Mesh) {
    let at = |end: usize, border: usize| pair[end].place(pair[end].borders_t_m[border], 0.0);
    let outline = [at(0, right), at(1, right), at(1, left), at(0, left)];
    mesh.ground_face(&outline.map(|place| place.as_vec3()), paint);
}
