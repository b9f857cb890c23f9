//! Steering beside the recorded one, by the measures of Codevilla et al., 2018, whose own figures
//! are made with the window and the threshold below.

use crate::frame::FUTURE_STEP_S;

/// Frames over which [`steer_way_m`] adds up: 1.6 s.
///
/// Source: felipecode/coiltraine, plotter/plotting_params/eccv_online_offline_plots.py.
pub const WINDOW: usize = 16;

/// Steering that is not further from straight on than this is straight on.
pub const STRAIGHT: f64 = 0.03;

/// Share of the recorded steering by which the planned one may be off.
///
/// Source: as [`WINDOW`].
pub const TOLERANCE: f64 = 0.1;

/// Steering of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steering {
    /// In [-1, 1], positive = right.
    pub planned: f64,
    pub recorded: f64,
    /// Negative when reversing.
    pub speed_mps: f64,
}

impl Steering {
    pub fn l1(self) -> f64 {
        (self.planned - self.recorded).abs()
    }

    /// m/s: the faster, the further a wrong angle leads astray.
    pub fn speed_weighted_mps(self) -> f64 {
        self.l1() * self.speed_mps.abs()
    }

    /// Whether left, straight on and right are mistaken for each other.
    pub fn is_other_class(self) -> bool {
        let class = |steer: f64| (steer >= -STRAIGHT) as u8 + (steer >= STRAIGHT) as u8;
        class(self.planned) != class(self.recorded)
    }

    /// Whether it is off by more than the tolerated share of the recorded steering.
    pub fn is_beyond_tolerance(self) -> bool {
        self.l1() > TOLERANCE * self.recorded.abs()
    }
}

/// For each frame of an unbroken stretch: |sum over it and the frames before it, [`WINDOW`] in all,
/// of (planned - recorded) x |speed| x dt|, m: errors that cancel each other lead nowhere.
///
/// `None` where one of these frames has nothing to compare.
pub fn steer_way_m(stretch: &[Option<Steering>]) -> Vec<Option<f64>> {
    let way = |s: &Steering| (s.planned - s.recorded) * s.speed_mps.abs() * FUTURE_STEP_S;
    (1..=stretch.len())
        .map(|end| {
            let window = &stretch[end.checked_sub(WINDOW)?..end];
            let sum: Option<f64> = window.iter().map(|s| s.as_ref().map(way)).sum();
            sum.map(f64::abs)
        })
        .collect()
}
