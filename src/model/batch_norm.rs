//! stub
use crate::{error::Result, model::pass::Pass};
use candle_core::Tensor;
use candle_nn::{Init, VarBuilder};
#[derive(Clone, Debug)]
pub struct BatchNorm {
    w: Tensor,
    b: Tensor,
    m: Tensor,
    v: Tensor,
}
impl BatchNorm {
    pub fn new(c: usize, vb: VarBuilder) -> Result<Self> {
        let get = |n: &str, x: f64| vb.get_with_hints(c, n, Init::Const(x));
        Ok(Self {
            w: get("weight", 1.0)?,
            b: get("bias", 0.0)?,
            m: get("running_mean", 0.0)?,
            v: get("running_var", 1.0)?,
        })
    }
    pub fn forward_relu(&self, x: &Tensor, r: Option<&Tensor>, _pass: &Pass) -> Result<Tensor> {
        let y = x
            .broadcast_sub(&self.m)?
            .broadcast_div(&(&self.v + 1e-5)?.sqrt()?)?
            .broadcast_mul(&self.w)?
            .broadcast_add(&self.b)?;
        Ok(match r {
            Some(r) => (y + r)?.relu()?,
            None => y.relu()?,
        })
    }
}
