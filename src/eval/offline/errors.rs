//! What every policy got wrong at every frame: what all numbers of a report are made of.

use crate::{
    eval::offline::{
        metrics::FrameErrors,
        pedals::{Pedal, brake_onsets},
        steering::{Steering, steer_way_m},
    },
    frame::{Command, Conditions, Frame, RecordedAction, signed_speed_mps},
};

/// What every policy got wrong at every frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    /// Ids, in the order of their first frame.
    pub episodes: Vec<String>,
    /// What is known of the surroundings, in the order of their first frame.
    pub conditions: Vec<Conditions>,
    /// In the order of evaluation.
    pub frames: Vec<FrameKey>,
    pub policies: Vec<PolicyErrors>,
}

/// Which frame a row of errors belongs to, what it is sliced by, and what the driver did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameKey {
    /// Index in [`Errors::episodes`].
    pub episode: u32,
    /// Index in [`Errors::conditions`].
    pub conditions: u32,
    /// [`Frame::index`].
    pub frame: u32,
    /// [`Frame::stamp_ns`].
    pub stamp_ns: i64,
    pub command: Command,
    /// Speed at this frame, m/s, negative when reversing.
    pub speed_mps: f32,
    pub recorded: RecordedAction,
}

/// What a policy can see of the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sight {
    /// It learned nothing.
    Baseline,
    /// It learned without looking: from speed, route and command.
    Blind,
    /// It looks at what sensors say.
    Seeing,
}

/// What one policy got wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyErrors {
    pub name: String,
    pub sees_the_future: bool,
    pub sight: Sight,
    /// Constants of eq. (3), where they are known.
    pub fusion: Option<crate::control::fusion::Fusion>,
    /// Names of [`FrameErrors::attention`].
    pub branches: Vec<&'static str>,
    /// One per frame of [`Errors::frames`].
    pub rows: Vec<FrameErrors>,
}

/// One policy at one frame.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    pub frame: &'a FrameKey,
    pub errors: &'a FrameErrors,
}

impl Row<'_> {
    /// Steering of that source of actions, where both sides have one.
    pub fn steering(&self, source: usize) -> Option<Steering> {
        Some(Steering {
            planned: self.errors.planned[source]?.steer.into(),
            recorded: self.frame.recorded.steer?.into(),
            speed_mps: self.frame.speed_mps.into(),
        })
    }

    /// The brake of that source of actions, where both sides have one.
    pub fn brake(&self, source: usize) -> Option<Pedal> {
        Some(Pedal::of(self.errors.planned[source]?.brake, self.frame.recorded.brake?))
    }

    /// The throttle of that source of actions, where both sides have one.
    pub fn throttle(&self, source: usize) -> Option<Pedal> {
        Some(Pedal::of(self.errors.planned[source]?.throttle, self.frame.recorded.throttle?))
    }
}

impl Errors {
    /// Add what a frame is; its errors are pushed to the policies' rows apart.
    pub fn push_frame(&mut self, episode: u32, frame: &Frame) {
        let known = self.conditions.iter().position(|known| *known == frame.conditions);
        let conditions = known.unwrap_or_else(|| {
            self.conditions.push(frame.conditions.clone());
            self.conditions.len() - 1
        });
        self.frames.push(FrameKey {
            episode,
            conditions: conditions as u32,
            frame: frame.index,
            stamp_ns: frame.stamp_ns,
            command: frame.command,
            speed_mps: signed_speed_mps(frame.velocity_mps),
            recorded: frame.action,
        });
    }

    /// Add what only shows over several frames: where wrong steering leads, and when the brake is
    /// pressed.
    pub fn finish(&mut self) {
        for stretch in stretches(&self.frames) {
            let frames = &self.frames[stretch.clone()];
            let since = frames.first().map_or(0, |frame| frame.stamp_ns);
            let stamps_s: Vec<f64> =
                frames.iter().map(|frame| (frame.stamp_ns - since) as f64 * 1e-9).collect();
            for policy in &mut self.policies {
                let rows = &mut policy.rows[stretch.clone()];
                for source in 0..crate::eval::offline::metrics::SOURCES.len() {
                    let pairs = || frames.iter().zip(rows.iter());
                    let rows_of = pairs().map(|(frame, errors)| Row { frame, errors });
                    let (steering, brakes): (Vec<_>, Vec<_>) =
                        rows_of.map(|row| (row.steering(source), row.brake(source))).unzip();
                    let ways = steer_way_m(&steering);
                    let onsets = brake_onsets(&brakes, &stamps_s);
                    for (row, (way, onset)) in rows.iter_mut().zip(ways.into_iter().zip(onsets)) {
                        (row.steer_way_m[source], row.brake_onset[source]) = (way, onset);
                    }
                }
            }
        }
    }
}

/// Unbroken stretches: frames of one episode whose indices follow each other.
fn stretches(frames: &[FrameKey]) -> Vec<std::ops::Range<usize>> {
    let mut stretches = Vec::new();
    let mut start = 0;
    for stretch in frames.chunk_by(|a, b| a.is_followed_by(b)) {
        stretches.push(start..start + stretch.len());
        start += stretch.len();
    }
    stretches
}

impl FrameKey {
    /// Whether that frame is the next of the same episode.
    pub fn is_followed_by(&self, next: &FrameKey) -> bool {
        self.episode == next.episode && self.frame + 1 == next.frame
    }
}
