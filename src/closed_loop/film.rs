//! The last seconds of an episode as a policy saw them, kept for when it fails.

use std::collections::VecDeque;

use crate::{
    closed_loop::{observation::Observation, pilot::Act},
    control::driver::Decision,
    frame::signed_speed_mps,
    policy::{Action, Mode},
};

/// Moments of 0.1 s that are kept: 3 s and now.
const KEPT: usize = 31;

/// One moment.
#[derive(Clone, Debug)]
pub struct Moment {
    pub stamp_ns: i64,
    /// JPEG.
    pub picture: Vec<u8>,
    pub speed_mps: f32,
    pub action: Action,
    pub strongest: Option<Mode>,
    pub decision: Option<Decision>,
}

/// The last moments.
#[derive(Clone, Debug, Default)]
pub struct Film(VecDeque<Moment>);

impl Film {
    /// Add a moment; of one without a picture there is nothing to show.
    pub fn add(&mut self, seen: &Observation, act: &Act) {
        if seen.frame.image.is_empty() {
            return;
        }
        if self.0.len() == KEPT {
            self.0.pop_front();
        }
        self.0.push_back(Moment {
            stamp_ns: seen.stamp_ns,
            picture: seen.frame.image.clone(),
            speed_mps: signed_speed_mps(seen.frame.velocity_mps),
            action: act.action,
            strongest: act.plan.strongest().cloned(),
            decision: act.decision,
        });
    }

    /// So many moments, evenly from the first that is kept to the last.
    pub fn evenly(&self, count: usize) -> Vec<&Moment> {
        let last = self.0.len().saturating_sub(1);
        let mut at: Vec<usize> = (0..count).map(|i| i * last / (count - 1).max(1)).collect();
        at.dedup();
        at.into_iter().filter_map(|at| self.0.get(at)).collect()
    }
}
