//! What every network says, and how every network's inputs are scaled.

use candle_core::Tensor;
use candle_nn::ops::sigmoid;

use crate::{
    dataset::batch::Inputs,
    error::{Error, Result},
    model::{mixture::Mixture, net_config::ActionRange, pass::Pass},
};

/// Velocity inputs are divided by this: the 43 km/h of TCP and CILRS.
pub const VELOCITY_UNIT_MPS: f64 = 12.0;

/// Waypoints are divided by half of the route's 51.6 m.
const ROUTE_UNIT_M: f64 = 26.0;

/// What a network says. A network that does not plan has no motion, and so on.
#[derive(Clone, Debug)]
pub struct Output {
    /// `[B, 3]`: steer in [-1, 1], throttle and brake in [0, 1] (a1 of the paper).
    pub action: Tensor,
    /// `[B, branches]`, each row summing to 1, in the order of the network's branches.
    pub attention: Option<Tensor>,
    pub motion: Option<Mixture>,
    /// `[B, 1]`: the speed of now, guessed without being told, in [`VELOCITY_UNIT_MPS`].
    pub speed: Option<Tensor>,
}

/// `[B, 3]` of any numbers to an action; in its range, but for [`ActionRange::Cut`] while learning.
///
/// # Errors
///
/// [`Error::Tensor`] if there are not three.
pub fn action(raw: &Tensor, range: ActionRange, pass: &Pass) -> Result<Tensor> {
    let (steer, pedals) = (raw.narrow(1, 0, 1)?, raw.narrow(1, 1, 2)?);
    let (steer, pedals) = match range {
        ActionRange::Squashed => (steer.tanh()?, sigmoid(&pedals)?),
        ActionRange::Cut if pass.learns() => return Ok(raw.clone()),
        ActionRange::Cut => (steer.clamp(-1f32, 1f32)?, pedals.clamp(0f32, 1f32)?),
    };
    Ok(Tensor::cat(&[steer, pedals], 1)?)
}

/// `[B, 2]`, of the size of 1.
///
/// # Errors
///
/// [`Error::Tensor`] if memory runs out.
pub fn scaled_velocity(inputs: &Inputs) -> Result<Tensor> {
    Ok((&inputs.velocity / VELOCITY_UNIT_MPS)?)
}

/// `[B, 260]`, of the size of 1.
///
/// # Errors
///
/// [`Error::Tensor`] if memory runs out.
pub fn scaled_route(inputs: &Inputs) -> Result<Tensor> {
    Ok((&inputs.route / ROUTE_UNIT_M)?)
}

/// `[B, 1]`, m/s.
///
/// # Errors
///
/// [`Error::Tensor`] if memory runs out.
pub fn speed_mps(inputs: &Inputs) -> Result<Tensor> {
    Ok(inputs.velocity.sqr()?.sum_keepdim(1)?.sqrt()?)
}

/// A picture that the network has to have.
///
/// # Errors
///
/// [`Error::Config`] if the batch was made without it.
pub fn picture<'i>(picture: &'i Option<Tensor>, name: &str) -> Result<&'i Tensor> {
    picture.as_ref().ok_or_else(|| Error::Config {
        key: format!("net.{name}"),
        what: "the network has this branch, but the batch has no such picture".into(),
        hint: None,
    })
}
