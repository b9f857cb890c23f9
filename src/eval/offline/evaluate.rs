//! The offline evaluation: every policy plans at every recorded frame, and what it got wrong is
//! kept.
//!
//! One pass over the frames for all policies, so that all are judged on the same ones and a
//! picture is read once. Memory: one row of errors per policy and frame, no pictures.

use std::collections::BTreeSet;

use crate::{
    control::{
        driver::{ControlConfig, Driver},
        fusion::Fusion,
    },
    error::{Error, Result},
    eval::offline::{
        errors::{Errors, PolicyErrors, Sight},
        metrics::FrameErrors,
    },
    frame::{FUTURE_STEP_S, Frame, signed_speed_mps},
    policy::Policy,
};

/// A policy that is evaluated, and what is known of it.
pub struct Contender {
    pub policy: Box<dyn Policy>,
    pub sight: Sight,
    /// Constants of eq. (3), if they are known: without them there is no fused action.
    pub fusion: Option<Fusion>,
}

impl From<Box<dyn Policy>> for Contender {
    /// A baseline.
    fn from(policy: Box<dyn Policy>) -> Self {
        Contender { policy, sight: Sight::Baseline, fusion: None }
    }
}

/// Let all policies plan at all frames, and compare with what was recorded.
///
/// An item is the id of the episode and the frame. Frames of an episode come one after the other;
/// policies are reset where the id changes, the controllers behind a2 also where frames are missing.
///
/// # Errors
///
/// [`Error::Config`] if two policies have one name; [`Error::Policy`] if a policy cannot plan or
/// plans what is no motion (a value that is not finite, a deviation that is not positive, weights
/// that do not sum to 1); any error of `frames`.
pub fn evaluate(
    contenders: &mut [Contender],
    frames: impl IntoIterator<Item = Result<(String, Frame)>>,
) -> Result<Errors> {
    let mut errors = Errors { policies: unevaluated(contenders)?, ..Errors::default() };
    let mut drivers: Vec<Driver> = contenders.iter().map(driver).collect();
    let mut current = None;
    for item in frames {
        let (episode, frame) = item?;
        let known = current.filter(|&i: &usize| errors.episodes[i] == episode);
        let index = known.unwrap_or_else(|| {
            contenders.iter_mut().for_each(|contender| contender.policy.reset());
            let seen = errors.episodes.iter().position(|id| *id == episode);
            seen.unwrap_or_else(|| {
                errors.episodes.push(episode);
                errors.episodes.len() - 1
            })
        });
        current = Some(index);
        errors.push_frame(index as u32, &frame);
        if !matches!(&errors.frames[..], [.., last, this] if last.is_followed_by(this)) {
            drivers.iter_mut().for_each(Driver::reset);
        }
        for ((contender, driver), errors_of) in
            contenders.iter_mut().zip(&mut drivers).zip(&mut errors.policies)
        {
            let at = |what: String, hint| Error::Policy {
                policy: errors_of.name.clone(),
                episode: errors.episodes[index].clone(),
                frame: frame.index,
                what,
                hint,
            };
            let plan = contender.policy.plan(&frame).map_err(|e| at(e.to_string(), e.hint()))?;
            if let Some(fault) = plan.fault() {
                return Err(at(fault.to_string(), None));
            }
            if errors_of.branches.is_empty() {
                errors_of.branches = plan.attention.iter().map(|(branch, _)| *branch).collect();
            }
            let decision = driver.decide(&plan, signed_speed_mps(frame.velocity_mps));
            let knows_fusion = contender.fusion.is_some();
            let row = FrameErrors::of(&plan, &frame);
            errors_of.rows.push(row.decided(&decision, knows_fusion, &plan, &frame));
        }
    }
    errors.finish();
    Ok(errors)
}

/// No rows yet, one entry for each contender.
fn unevaluated(contenders: &[Contender]) -> Result<Vec<PolicyErrors>> {
    let mut names = BTreeSet::new();
    let of = |contender: &Contender| {
        let name = contender.policy.name().to_string();
        if !names.insert(name.clone()) {
            return Err(Error::Config {
                key: "policy".to_string(),
                what: format!("two policies are called `{name}`"),
                hint: Some("evaluate them apart, or rename one run directory".to_string()),
            });
        }
        Ok(PolicyErrors {
            name,
            sees_the_future: contender.policy.sees_the_future(),
            sight: contender.sight,
            fusion: contender.fusion,
            branches: Vec::new(),
            rows: Vec::new(),
        })
    };
    contenders.iter().map(of).collect()
}

/// What makes actions of a contender's plans.
fn driver(contender: &Contender) -> Driver {
    let fusion = contender.fusion.unwrap_or(Fusion::A2);
    Driver::new(ControlConfig::default(), fusion, FUTURE_STEP_S)
}
