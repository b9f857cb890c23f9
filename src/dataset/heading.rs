//! Headings for positions that have none.
//!
//! From the attitude that an IMU measures; else from the course over ground while the car moves,
//! which the integrated yaw rate joins and carries while it stands: gyroscopes drift by degrees an
//! hour, courses over a metre of ground are right on average and wrong by degrees each.

use glam::{DQuat, DVec3, EulerRot};

use crate::{
    dataset::ego::wrap_angle,
    log::recording::{Stamped, nearest},
};

/// Two positions this far apart have a course, metres.
const COURSE_M: f64 = 1.0;

/// Further apart in time, a course says nothing of the headings between.
const COURSE_NS: i64 = 3_000_000_000;

/// Courses this near in time are averaged: longer than a receiver's noise hangs together, shorter
/// than a gyroscope drifts.
const AVERAGED_NS: i64 = 10_000_000_000;

/// A mean distance from courses beyond which an attitude is not that of the world: slip and mounts
/// stay below 10 degrees, unknown norths are anywhere.
const ASTRAY_RAD: f64 = 0.35;

/// Headings by time, in (-pi, pi].
#[derive(Clone, Debug)]
pub struct Headings {
    /// Ascending by stamp.
    turned_rad: Vec<Stamped<f64>>,
    /// What is to be added to `turned_rad`, by time; one of zero where attitudes are measured.
    offsets_rad: Vec<Stamped<f64>>,
}

impl Headings {
    /// From measured attitudes.
    ///
    /// Not every IMU knows where east is. Where attitudes lie more than 20 degrees off the courses
    /// over ground, only their change is believed, and a note says so.
    pub fn measured(
        attitudes: impl Iterator<Item = Stamped<DQuat>>,
        positions: &[Stamped<DVec3>],
        antenna_ahead_m: f64,
        notes: &mut Vec<String>,
    ) -> Headings {
        let yaw = |a: Stamped<DQuat>| Stamped {
            stamp_ns: a.stamp_ns,
            value: a.value.to_euler(EulerRot::ZYX).0,
        };
        let turned_rad: Vec<_> = attitudes.map(yaw).collect();
        if let Some(joined) = Headings::joined(turned_rad.clone(), positions, antenna_ahead_m) {
            let (offset_rad, courses) = (mean(&joined.offsets_rad), joined.offsets_rad.len());
            if offset_rad.abs() > ASTRAY_RAD {
                notes.push(format!(
                    "pose: the measured attitude lies {:.0} degrees off {courses} courses over \
                     ground; its changes are used, joined to these",
                    -offset_rad.to_degrees()
                ));
                return joined;
            }
        }
        Headings { turned_rad, offsets_rad: vec![Stamped { stamp_ns: 0, value: 0.0 }] }
    }

    /// From courses over ground, joined by rates of turning to the left; `None` if the car never
    /// moves far enough for a course.
    ///
    /// A course is that of the middle between two positions, where its chord and the motion agree.
    /// An antenna ahead of the car's origin moves sideways in a bend, which is taken out; slip and
    /// reversing are not told apart from it.
    pub fn from_courses(
        positions: &[Stamped<DVec3>],
        rates_radps: &[Stamped<f64>],
        antenna_ahead_m: f64,
    ) -> Option<Headings> {
        Headings::joined(integrated(rates_radps), positions, antenna_ahead_m)
    }

    /// Angles turned since some instant, joined to courses.
    fn joined(
        turned_rad: Vec<Stamped<f64>>,
        positions: &[Stamped<DVec3>],
        antenna_ahead_m: f64,
    ) -> Option<Headings> {
        let offsets_rad = vec![Stamped { stamp_ns: 0, value: 0.0 }];
        let mut headings = Headings { turned_rad, offsets_rad };
        let offsets = courses(positions).into_iter().filter_map(|course| {
            let middle_ns = course.from_ns + (course.to_ns - course.from_ns) / 2;
            let turned = headings.at(course.to_ns)? - headings.at(course.from_ns)?;
            let sideways_m = antenna_ahead_m * wrap_angle(turned);
            let aside_rad = (sideways_m / course.length_m).clamp(-1.0, 1.0).asin();
            let value = wrap_angle(course.angle_rad - aside_rad - headings.at(middle_ns)?);
            Some(Stamped { stamp_ns: middle_ns, value })
        });
        let offsets: Vec<_> = offsets.collect();
        headings.offsets_rad = offsets.iter().map(|at| averaged(&offsets, at.stamp_ns)).collect();
        (!offsets.is_empty()).then_some(headings)
    }

    /// The heading at an instant; `None` where there is no measurement on either side, or no two
    /// within a second.
    pub fn at(&self, stamp_ns: i64) -> Option<f64> {
        const GAP_NS: i64 = 1_000_000_000;
        let after = self.turned_rad.partition_point(|sample| sample.stamp_ns < stamp_ns);
        let later = self.turned_rad.get(after)?;
        let turned = if later.stamp_ns == stamp_ns {
            later.value
        } else {
            let earlier = &self.turned_rad[after.checked_sub(1)?];
            let gap_ns = later.stamp_ns - earlier.stamp_ns;
            if gap_ns > GAP_NS {
                return None;
            }
            let fraction = (stamp_ns - earlier.stamp_ns) as f64 / gap_ns as f64;
            earlier.value + wrap_angle(later.value - earlier.value) * fraction
        };
        let offset = nearest(&self.offsets_rad, stamp_ns)?;
        Some(wrap_angle(turned + offset.value))
    }
}

/// Angles turned since the first rate. Between two samples the rate is their mean.
fn integrated(rates_radps: &[Stamped<f64>]) -> Vec<Stamped<f64>> {
    let mut turned_rad = 0.0;
    let mut last: Option<&Stamped<f64>> = None;
    let mut turned = Vec::with_capacity(rates_radps.len());
    for rate in rates_radps {
        if let Some(last) = last {
            let seconds = (rate.stamp_ns - last.stamp_ns) as f64 * 1e-9;
            turned_rad += (last.value + rate.value) / 2.0 * seconds;
        }
        turned.push(Stamped { stamp_ns: rate.stamp_ns, value: turned_rad });
        last = Some(rate);
    }
    turned
}

/// The way between two positions.
struct Course {
    from_ns: i64,
    to_ns: i64,
    length_m: f64,
    angle_rad: f64,
}

/// Courses from every position to the next that is far enough, if it is near enough in time.
fn courses(positions: &[Stamped<DVec3>]) -> Vec<Course> {
    let mut courses = Vec::new();
    for (i, from) in positions.iter().enumerate() {
        let way = |to: &Stamped<DVec3>| (to.value - from.value).truncate();
        let far = |to: &&Stamped<DVec3>| {
            way(to).length() >= COURSE_M || to.stamp_ns - from.stamp_ns > COURSE_NS
        };
        let Some(to) = positions[i + 1..].iter().find(far) else { break };
        if to.stamp_ns - from.stamp_ns <= COURSE_NS {
            let way = way(to);
            courses.push(Course {
                from_ns: from.stamp_ns,
                to_ns: to.stamp_ns,
                length_m: way.length(),
                angle_rad: way.y.atan2(way.x),
            });
        }
    }
    courses
}

/// The mean of the angles near an instant.
fn averaged(angles: &[Stamped<f64>], stamp_ns: i64) -> Stamped<f64> {
    let from = angles.partition_point(|a| a.stamp_ns < stamp_ns - AVERAGED_NS);
    let to = angles.partition_point(|a| a.stamp_ns <= stamp_ns + AVERAGED_NS);
    Stamped { stamp_ns, value: mean(&angles[from..to]) }
}

/// The direction of the sum of unit vectors.
fn mean(angles: &[Stamped<f64>]) -> f64 {
    let (sin, cos) = angles
        .iter()
        .fold((0.0, 0.0), |(sin, cos), angle| (sin + angle.value.sin(), cos + angle.value.cos()));
    f64::atan2(sin, cos)
}
