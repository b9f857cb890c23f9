//! The offline evaluation: every policy plans at every recorded frame, and what it got wrong is
//! kept.
//!
//! One pass over the frames for all policies, so that all are judged on the same ones and a
//! picture is read once. Memory: one row of errors per policy and frame, no pictures.

use std::collections::BTreeSet;

use crate::{
    error::{Error, Result},
    eval::offline::metrics::FrameErrors,
    frame::{Command, Frame, signed_speed_mps},
    policy::Policy,
};

/// What every policy got wrong at every frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    /// Ids, in the order of their first frame.
    pub episodes: Vec<String>,
    /// In the order of evaluation.
    pub frames: Vec<FrameKey>,
    pub policies: Vec<PolicyErrors>,
}

/// Which frame a row of errors belongs to, and what it is sliced by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameKey {
    /// Index in [`Errors::episodes`].
    pub episode: u32,
    /// [`Frame::index`].
    pub frame: u32,
    /// [`Frame::stamp_ns`].
    pub stamp_ns: i64,
    pub command: Command,
    /// Speed at this frame, m/s, negative when reversing.
    pub speed_mps: f32,
}

/// What one policy got wrong.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyErrors {
    pub name: String,
    pub sees_the_future: bool,
    /// One per frame of [`Errors::frames`].
    pub rows: Vec<FrameErrors>,
}

/// Let all policies plan at all frames, and compare with what was recorded.
///
/// An item is the id of the episode and the frame. Frames of an episode come one after the other;
/// policies are reset where the id changes.
///
/// # Errors
///
/// [`Error::Config`] if two policies have one name; [`Error::Policy`] if a policy cannot plan or
/// plans what is no motion (a value that is not finite, a deviation that is not positive, weights
/// that do not sum to 1); any error of `frames`.
pub fn evaluate(
    policies: &mut [Box<dyn Policy>],
    frames: impl IntoIterator<Item = Result<(String, Frame)>>,
) -> Result<Errors> {
    let mut errors = Errors::default();
    let mut names = BTreeSet::new();
    for policy in policies.iter() {
        if !names.insert(policy.name().to_string()) {
            return Err(Error::Config {
                key: "policy".to_string(),
                what: format!("two policies are called `{}`", policy.name()),
                hint: Some("evaluate them apart, or rename one run directory".to_string()),
            });
        }
        errors.policies.push(PolicyErrors {
            name: policy.name().to_string(),
            sees_the_future: policy.sees_the_future(),
            rows: Vec::new(),
        });
    }
    let mut current = None;
    for item in frames {
        let (episode, frame) = item?;
        let known = current.filter(|&i: &usize| errors.episodes[i] == episode);
        let index = known.unwrap_or_else(|| {
            policies.iter_mut().for_each(|policy| policy.reset());
            let seen = errors.episodes.iter().position(|id| *id == episode);
            seen.unwrap_or_else(|| {
                errors.episodes.push(episode);
                errors.episodes.len() - 1
            })
        });
        current = Some(index);
        errors.frames.push(FrameKey {
            episode: index as u32,
            frame: frame.index,
            stamp_ns: frame.stamp_ns,
            command: frame.command,
            speed_mps: signed_speed_mps(frame.velocity_mps),
        });
        for (policy, errors_of) in policies.iter_mut().zip(&mut errors.policies) {
            let at = |what: String, hint| Error::Policy {
                policy: errors_of.name.clone(),
                episode: errors.episodes[index].clone(),
                frame: frame.index,
                what,
                hint,
            };
            let plan = policy.plan(&frame).map_err(|e| at(e.to_string(), e.hint()))?;
            if let Some(fault) = plan.fault() {
                return Err(at(fault.to_string(), None));
            }
            errors_of.rows.push(FrameErrors::of(&plan, &frame));
        }
    }
    Ok(errors)
}
