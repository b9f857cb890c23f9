//! stub
use crate::error::Result;
use candle_core::Tensor;
#[derive(Clone, Copy, Debug)]
pub struct Conv {
    pub stride: usize,
    pub padding: usize,
}
impl Conv {
    pub fn out(self, side: usize, kernel: usize) -> usize {
        (side + 2 * self.padding - kernel) / self.stride + 1
    }
}
pub fn conv2d(x: &Tensor, weight: &Tensor, bias: Option<&Tensor>, conv: Conv) -> Result<Tensor> {
    let y =
        x.permute((0, 3, 1, 2))?.contiguous()?.conv2d(weight, conv.padding, conv.stride, 1, 1)?;
    let y = y.permute((0, 2, 3, 1))?.contiguous()?;
    Ok(match bias {
        Some(b) => y.broadcast_add(b)?,
        None => y,
    })
}
