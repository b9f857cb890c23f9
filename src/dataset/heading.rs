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
    pub fn measured(attitudes: impl Iterator<Item = Stamped<DQuat>>) -> Headings {
        let yaw = |a: Stamped<DQuat>| Stamped {
            stamp_ns: a.stamp_ns,
            value: a.value.to_euler(EulerRot::ZYX).0,
        };
        Headings {
            turned_rad: attitudes.map(yaw).collect(),
            offsets_rad: vec![Stamped { stamp_ns: 0, value: 0.0 }],
        }
    }

    /// From courses over ground, joined by rates of turning to the left.
    ///
    /// A course is that of the middle between two positions, where its chord and the car's heading
    /// agree; slip and reversing are not told apart from it.
    pub fn from_courses(
        positions: &[Stamped<DVec3>],
        rates_radps: &[Stamped<f64>],
    ) -> Option<Headings> {
        let turned_rad = integrated(rates_radps);
        let turned =
            Headings { turned_rad, offsets_rad: vec![Stamped { stamp_ns: 0, value: 0.0 }] };
        let offsets = courses(positions).into_iter().filter_map(|course| {
            let turned = turned.at(course.stamp_ns)?;
            Some(Stamped { stamp_ns: course.stamp_ns, value: wrap_angle(course.value - turned) })
        });
        let offsets: Vec<_> = offsets.collect();
        let averaged: Vec<_> = offsets.iter().map(|at| averaged(&offsets, at.stamp_ns)).collect();
        (!averaged.is_empty())
            .then_some(Headings { turned_rad: turned.turned_rad, offsets_rad: averaged })
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

/// Courses between positions, each at the middle of its two positions in time.
fn courses(positions: &[Stamped<DVec3>]) -> Vec<Stamped<f64>> {
    let mut courses = Vec::new();
    for (i, from) in positions.iter().enumerate() {
        let far = |to: &&Stamped<DVec3>| {
            (to.value - from.value).truncate().length() >= COURSE_M
                || to.stamp_ns - from.stamp_ns > COURSE_NS
        };
        let Some(to) = positions[i + 1..].iter().find(far) else { break };
        if to.stamp_ns - from.stamp_ns <= COURSE_NS {
            let way = to.value - from.value;
            let stamp_ns = from.stamp_ns + (to.stamp_ns - from.stamp_ns) / 2;
            courses.push(Stamped { stamp_ns, value: way.y.atan2(way.x) });
        }
    }
    courses
}

/// The mean of the angles near an instant.
fn averaged(angles: &[Stamped<f64>], stamp_ns: i64) -> Stamped<f64> {
    let from = angles.partition_point(|a| a.stamp_ns < stamp_ns - AVERAGED_NS);
    let to = angles.partition_point(|a| a.stamp_ns <= stamp_ns + AVERAGED_NS);
    let (sin, cos) = angles[from..to]
        .iter()
        .fold((0.0, 0.0), |(sin, cos), angle| (sin + angle.value.sin(), cos + angle.value.cos()));
    Stamped { stamp_ns, value: f64::atan2(sin, cos) }
}
