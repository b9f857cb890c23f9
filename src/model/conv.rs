//! The convolution of the encoders: 3 x 3, stride 2, padding 1, as a matrix product.
//!
//! candle's own backward pass is a naive transposed convolution, several times as slow as the
//! forward pass. Here the nine pixels under the kernel are laid out as rows of a matrix, and both
//! passes are matrix products. Activations are `[C, B, H, W]`, so that the product of
//! `[C_out, 9 C]` and `[9 C, B H W]` is the next activation, and nothing is ever transposed.

use candle_core::Tensor;

use crate::error::Result;

/// Convolve and halve the picture.
///
/// # Shapes
///
/// | name     | shape                   | note                              |
/// |----------|-------------------------|-----------------------------------|
/// | `x`      | `[C, B, H, W]`          | channels first; H and W even      |
/// | `weight` | `[C_out, C, 3, 3]`      | as PyTorch and candle have it     |
/// | `bias`   | `[C_out]`               |                                   |
/// | returns  | `[C_out, B, H/2, W/2]`  |                                   |
///
/// # Errors
///
/// [`Error::Tensor`](crate::error::Error::Tensor) if shapes disagree or a side is odd.
pub fn conv3x3_stride2(x: &Tensor, weight: &Tensor, bias: &Tensor) -> Result<Tensor> {
    let (channels, batch, height, width) = x.dims4()?;
    let (h, w) = (height / 2, width / 2);
    // Two zeros above and to the left: one is the padding, the other keeps the sides even.
    let padded = x.pad_with_zeros(2, 2, 0)?.pad_with_zeros(3, 2, 0)?;
    let halves = padded.reshape((channels * batch, h + 1, 2, w + 1, 2))?;
    // The pixels of even and odd rows and columns: output (i, j) looks at the odd ones of i and
    // i + 1 and at the even ones of i + 1, likewise for j.
    let phase = |row: usize, column: usize| {
        halves.narrow(2, row, 1)?.narrow(4, column, 1)?.reshape((channels, batch, h + 1, w + 1))
    };
    let phases = [[phase(0, 0)?, phase(0, 1)?], [phase(1, 0)?, phase(1, 1)?]];
    let places = [(1, 0), (0, 1), (1, 1)]; // (phase, offset) of the three rows of the kernel
    let mut taps = Vec::with_capacity(9);
    for (row, down) in places {
        for (column, right) in places {
            taps.push(phases[row][column].narrow(2, down, h)?.narrow(3, right, w)?);
        }
    }
    let columns = Tensor::cat(&taps, 0)?.reshape((9 * channels, batch * h * w))?;
    let kernel = weight.permute((0, 2, 3, 1))?.flatten_from(1)?; // [C_out, 9 C], C fastest
    let out = kernel.matmul(&columns)?.broadcast_add(&bias.unsqueeze(1)?)?;
    Ok(out.reshape(((), batch, h, w))?)
}
