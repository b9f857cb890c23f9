//! Where the lanes of a road lie.

use glam::{DVec2, DVec3};

use crate::map::{
    opendrive::{Crosswalk, Road, Section},
    profile::{Cubic, Profile},
};

/// A lane offset that changes by more than this from one record to the next is a step, m.
const STEP_M: f64 = 0.3;

/// A step at most this far from the start of a section is meant to be there, m.
const STRAY_M: f64 = 5.0;

/// The two borders of a lane at some `s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Borders {
    /// Towards the middle of the road, m from the reference line.
    pub inner_t_m: f64,
    pub outer_t_m: f64,
    /// Change of the middle between them along `s`.
    slope: f64,
}

impl Borders {
    pub fn centre_t_m(&self) -> f64 {
        0.5 * (self.inner_t_m + self.outer_t_m)
    }

    pub fn width_m(&self) -> f64 {
        (self.outer_t_m - self.inner_t_m).abs()
    }
}

/// A point on the centre line of a lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentrePoint {
    pub position_m: DVec3,
    /// Direction of the centre line towards higher `s`, rad.
    pub heading_rad: f64,
    pub t_m: f64,
    pub width_m: f64,
    /// Metres of centre line to one metre of `s`, with the grade.
    pub stretch: f64,
}

impl Road {
    /// First and last `s` of a section, m; the last is the next one's first.
    pub fn section_range_m(&self, section: usize) -> (f64, f64) {
        let from_m = self.sections[section].s_m.min(self.length_m);
        let next_m = self.sections.get(section + 1).map_or(self.length_m, |next| next.s_m);
        (from_m, next_m.clamp(from_m, self.length_m.max(from_m)))
    }

    /// Traffic in this lane runs towards higher `s`.
    pub fn runs_along_s(&self, lane: i32) -> bool {
        (lane < 0) != self.left_hand
    }

    /// The record of lane offsets that holds in a section at `s_m`: where a section ends, still
    /// its own and not the next one's.
    fn offset_record(&self, section: usize, s_m: f64) -> Option<&Cubic> {
        const INSIDE_M: f64 = 1e-5;
        let (from_m, to_m) = self.section_range_m(section);
        self.lane_offset.record(s_m.min(to_m - INSIDE_M).max(from_m))
    }

    /// The borders of the lane at place `index` of a section, from the left.
    pub fn borders(&self, section: usize, index: usize, s_m: f64) -> Borders {
        let Section { s_m: start_m, lanes, .. } = &self.sections[section];
        let lane = lanes[index].id;
        let ds_m = s_m - start_m;
        let record = self.offset_record(section, s_m);
        let mut inner_t_m = record.map_or(0.0, |record| record.at(s_m));
        let mut slope = record.map_or(0.0, |record| record.slope_at(s_m));
        let side = f64::from(lane.signum());
        // Lanes stand from left to right: between this one and the middle lie those after it on
        // the left, those before it on the right.
        let within = if lane > 0 { &lanes[index + 1..] } else { &lanes[..index] };
        for between in within.iter().filter(|other| other.id.signum() == lane.signum()) {
            inner_t_m += side * between.width.at(ds_m).max(0.0);
            slope += side * between.width.slope_at(ds_m);
        }
        let width = &lanes[index].width;
        let outer_t_m = inner_t_m + side * width.at(ds_m).max(0.0);
        slope += 0.5 * side * width.slope_at(ds_m);
        Borders { inner_t_m, outer_t_m, slope }
    }

    /// A place on the road's surface, map frame, m.
    pub fn place(&self, s_m: f64, t_m: f64) -> DVec3 {
        let line = self.reference_line.at(s_m);
        let left = DVec2::from_angle(line.heading_rad).perp();
        (line.position_m + t_m * left).extend(self.elevation.at(s_m))
    }

    /// The outline of a crosswalk of this road, map frame, m.
    pub fn crosswalk_m(&self, crosswalk: &Crosswalk) -> Vec<DVec2> {
        let line = self.reference_line.at(crosswalk.s_m);
        let axis = DVec2::from_angle(line.heading_rad + crosswalk.heading_rad);
        let origin_m = self.place(crosswalk.s_m, crosswalk.t_m).truncate();
        let corners = crosswalk.corners_m.iter().map(|corner| DVec2::from(*corner));
        corners.map(|corner| origin_m + axis.rotate(corner)).collect()
    }

    /// A place's distance from the reference line at `s_m`, positive left, m.
    pub fn lateral_m(&self, s_m: f64, position_m: DVec2) -> f64 {
        let line = self.reference_line.at(s_m);
        DVec2::from_angle(line.heading_rad).perp_dot(position_m - line.position_m)
    }

    /// The centre line of the lane at place `index` of a section, from the left.
    pub fn centre(&self, section: usize, index: usize, s_m: f64) -> CentrePoint {
        let borders = self.borders(section, index, s_m);
        let line = self.reference_line.at(s_m);
        let t_m = borders.centre_t_m();
        let left = DVec2::from_angle(line.heading_rad).perp();
        let along = DVec2::new(1.0 - line.curvature_per_m * t_m, borders.slope);
        CentrePoint {
            position_m: (line.position_m + t_m * left).extend(self.elevation.at(s_m)),
            heading_rad: line.heading_rad + along.to_angle(),
            t_m,
            width_m: borders.width_m(),
            stretch: along.length().hypot(self.elevation.slope_at(s_m)),
        }
    }

    /// Every `s` of a section at which another polynomial or piece begins, with both ends,
    /// ascending, m.
    pub fn breaks_m(&self, section: usize) -> Vec<f64> {
        let (from_m, to_m) = self.section_range_m(section);
        let Section { s_m: start_m, lanes, .. } = &self.sections[section];
        let starts = |profile: &Profile| -> Vec<f64> {
            profile.records().iter().map(|record| record.start_m).collect()
        };
        let mut breaks: Vec<f64> = self.reference_line.pieces().iter().map(|p| p.s_m).collect();
        breaks.extend(starts(&self.lane_offset));
        breaks.extend(starts(&self.elevation));
        breaks.extend(lanes.iter().flat_map(|lane| starts(&lane.width)).map(|ds| start_m + ds));
        breaks.retain(|s| *s > from_m && *s < to_m);
        breaks.extend([from_m, to_m]);
        breaks.sort_by(f64::total_cmp);
        breaks.dedup_by(|b, a| *b - *a < 1e-6);
        breaks
    }

    /// The speed limit of a lane at `s_m`, the lane's own before the road's, m/s.
    pub fn speed_limit_mps(&self, section: usize, lane: i32, s_m: f64) -> Option<f64> {
        let Section { s_m: start_m, .. } = self.sections[section];
        let of_lane = self.sections[section].lane(lane).and_then(|lane| {
            lane.speed_limits.iter().rfind(|limit| start_m + limit.s_m <= s_m)?.limit_mps
        });
        let of_road = || self.speed_limits.iter().rfind(|limit| limit.s_m <= s_m)?.limit_mps;
        of_lane.or_else(of_road)
    }

    /// Move steps of the lane offset to the start of the section that they were made for.
    ///
    /// Exports of old tools renumber lanes at the start of a section and shift the middle of the
    /// road to make up for it, but write the shift some way before or after: in between, every
    /// lane would lie a lane's width beside itself. A step is moved where that joins the lanes
    /// that are linked across the start of the section. Says how many were moved.
    pub fn mend_lane_offset(&mut self) -> usize {
        let mut records = self.lane_offset.records().to_vec();
        let mut moved = 0;
        for index in 1..records.len() {
            let (before, after) = (records[index - 1], records[index]);
            if (before.at(after.start_m) - after.a).abs() < STEP_M {
                continue;
            }
            let starts = self.sections.iter().map(|section| section.s_m).enumerate().skip(1);
            let nearest = starts
                .map(|(section, s_m)| ((s_m - after.start_m).abs(), section, s_m))
                .filter(|(gap_m, ..)| (1e-6..STRAY_M).contains(gap_m))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, section, s_m)) = nearest else { continue };
            let stayed = if s_m < after.start_m { before.at(s_m) } else { after.at(s_m) };
            let gap_unmoved = self.gap_m(section, stayed, stayed);
            if self.gap_m(section, before.at(s_m), after.at(s_m)) < gap_unmoved {
                records[index] = after.starting_at(s_m);
                moved += 1;
            }
        }
        if moved > 0 {
            self.lane_offset = Profile::new(records);
        }
        moved
    }

    /// How far linked lanes lie apart across the start of a section, together, given the lane
    /// offsets before and after it, m.
    fn gap_m(&self, section: usize, offset_before_m: f64, offset_after_m: f64) -> f64 {
        let s_m = self.sections[section].s_m;
        let centre_m = |section: usize, index: usize| {
            let offset_m = self.offset_record(section, s_m).map_or(0.0, |record| record.at(s_m));
            self.borders(section, index, s_m).centre_t_m() - offset_m
        };
        let (before, after) = (&self.sections[section - 1], &self.sections[section]);
        let gaps = before.lanes.iter().enumerate().filter_map(|(index, lane)| {
            let before_m = offset_before_m + centre_m(section - 1, index);
            let after_m = offset_after_m + centre_m(section, after.index_of(lane.successor?)?);
            Some((before_m - after_m).abs())
        });
        gaps.sum()
    }
}
