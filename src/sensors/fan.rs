//! The beams of a lidar's turn: where they point, and which lie below an elevation.

use glam::Vec2;

use crate::sensors::floats::{least, most, nearest};

/// Into how many steps the tangents of the beams are divided to find them, for each beam: few hold
/// more than one.
const STEPS: usize = 4;

/// The beams of a turn: the same in each column, in the lidar's frame (x forward, y left, z up).
#[derive(Clone, Debug)]
pub struct Fan {
    /// Of the elevations, and infinity after the last.
    pub tangents: Vec<f32>,
    pub columns: Vec<Vec2>,
    /// How many beams lie below each step of tangents, from the lowest beam up.
    below: Vec<u32>,
    steps_per_tangent: f32,
}

impl Fan {
    /// Tangents ascend; columns are unit vectors in equal steps once around to the left, the first
    /// half a step beyond the tail.
    pub fn new(mut tangents: Vec<f32>, columns: Vec<Vec2>) -> Fan {
        let spread =
            tangents.last().zip(tangents.first()).map_or(0.0, |(last, first)| last - first);
        let steps = STEPS * tangents.len();
        let steps_per_tangent = if spread > 0.0 { steps as f32 / spread } else { 0.0 };
        tangents.push(f32::INFINITY);
        let mut fan = Fan { tangents, columns, below: Vec::new(), steps_per_tangent };
        let below = |step: usize| fan.beams().partition_point(|tangent| fan.step(*tangent) < step);
        fan.below = (0..=steps).map(|step| below(step) as u32).collect();
        fan
    }

    /// Tangents of the elevations of the beams.
    #[inline]
    pub fn beams(&self) -> &[f32] {
        &self.tangents[..self.tangents.len() - 1]
    }

    /// The step that a tangent lies in.
    #[inline]
    fn step(&self, tangent: f32) -> usize {
        let steps = (STEPS * self.beams().len()) as f32;
        let step = (tangent - self.tangents[0]) * self.steps_per_tangent;
        nearest(least(most(step, 0.0), steps)) as usize
    }

    /// How many beams have lesser tangents.
    #[inline]
    pub fn below(&self, tangent: f32) -> usize {
        let mut count = self.below[self.step(tangent)] as usize;
        // Mostly there is at most one to ask: a sum is quicker than a branch.
        count += usize::from(self.tangents[count] < tangent);
        while self.tangents[count] < tangent {
            count += 1;
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beams_are_found_by_their_tangents() {
        let tangents = vec![-0.6, -0.3, -0.1, -0.05, 0.0, 0.2];
        let fan = Fan::new(tangents.clone(), Vec::new());
        for step in -100..100 {
            let tangent = step as f32 / 100.0;
            let below = tangents.iter().filter(|other| **other < tangent).count();
            assert_eq!(fan.below(tangent), below, "{tangent}");
        }
    }
}
