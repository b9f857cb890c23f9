//! A PID controller over the errors of the last moments.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Gains, and how far back errors count.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PidConfig {
    pub p: f64,
    pub i: f64,
    pub d: f64,
    /// Steps whose errors are summed up.
    pub window: usize,
}

/// The controller of one quantity.
#[derive(Clone, Debug)]
pub struct Pid {
    config: PidConfig,
    step_s: f64,
    errors: VecDeque<f64>,
}

impl Pid {
    /// A controller that is asked every `step_s` seconds.
    pub fn new(config: PidConfig, step_s: f64) -> Self {
        Self { config, step_s, errors: VecDeque::new() }
    }

    /// Forget all errors.
    pub fn reset(&mut self) {
        self.errors.clear();
    }

    /// What to do about an error: p e + i (sum of e dt over the window) + d (de / dt).
    pub fn step(&mut self, error: f64) -> f64 {
        let before = self.errors.back().copied();
        self.errors.push_back(error);
        while self.errors.len() > self.config.window.max(1) {
            self.errors.pop_front();
        }
        let integral = self.errors.iter().sum::<f64>() * self.step_s;
        let slope = before.map_or(0.0, |before| (error - before) / self.step_s);
        self.config.p * error + self.config.i * integral + self.config.d * slope
    }
}
