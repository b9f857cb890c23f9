//! Where the wall time of driving went, by policy.

use serde::Serialize;

use crate::closed_loop::{outing::Clock, row::EpisodeRow};

/// Seconds of all episodes of a policy, and how long its decisions took.
#[derive(Clone, Debug, Serialize)]
pub struct Timing {
    pub policy: String,
    pub episodes: usize,
    pub simulated_s: f64,
    pub world_s: f64,
    pub senses_s: f64,
    pub policy_s: f64,
    pub recording_s: f64,
    pub decisions: usize,
    /// From the frame to the action: half of all decisions take less, 95 of 100, all.
    pub latency_p50_ms: f32,
    pub latency_p95_ms: f32,
    pub latency_max_ms: f32,
}

impl Timing {
    /// Of all episodes of a policy.
    pub fn of(policy: &str, episodes: &[(EpisodeRow, Clock)]) -> Timing {
        let sum = |part: fn(&Clock) -> f64| episodes.iter().map(|(_, clock)| part(clock)).sum();
        let latencies = episodes.iter().flat_map(|(_, clock)| &clock.latency_ms);
        let mut latency_ms: Vec<f32> = latencies.copied().collect();
        latency_ms.sort_by(f32::total_cmp);
        let last = latency_ms.len().saturating_sub(1);
        let quantile = |q: f64| {
            latency_ms.get((last as f64 * q).round() as usize).copied().unwrap_or_default()
        };
        Timing {
            policy: policy.to_string(),
            episodes: episodes.len(),
            simulated_s: episodes.iter().map(|(row, _)| row.duration_s).sum(),
            world_s: sum(|clock| clock.world_s),
            senses_s: sum(|clock| clock.senses_s),
            policy_s: sum(|clock| clock.policy_s),
            recording_s: sum(|clock| clock.recording_s),
            decisions: latency_ms.len(),
            latency_p50_ms: quantile(0.5),
            latency_p95_ms: quantile(0.95),
            latency_max_ms: quantile(1.0),
        }
    }

    /// Steps of 0.1 s in a second of one thread.
    pub fn steps_per_s(&self) -> f64 {
        let spent_s = self.world_s + self.senses_s + self.policy_s + self.recording_s;
        10.0 * self.simulated_s / spent_s.max(1e-9)
    }
}
