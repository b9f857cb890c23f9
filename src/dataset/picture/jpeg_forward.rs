//! Blocks of samples to the coefficients that a JPEG stores (ITU-T T.81, A.3.3 and A.3.4).

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{Mat4, Vec4};

use crate::dataset::picture::jpeg_tables::{COEFFICIENTS, ZIGZAG};

/// Samples on a side of a block.
const SIDE: usize = 8;

/// Added to a number that is small beside it, this leaves the number's integer, rounded to the
/// nearest, in the lowest bits.
const ROUNDING: f32 = 12_582_912.0;

/// Cosines of `k pi / 16`.
const C1: f32 = 0.980_785_25;
const C2: f32 = 0.923_879_5;
const C3: f32 = 0.831_469_6;
const C5: f32 = 0.555_570_24;
const C6: f32 = 0.382_683_43;
const C7: f32 = 0.195_090_32;

/// Where the coefficients lie in a block that is turned, by horizontal frequency, then vertical; in
/// the order in which they are stored.
const TURNED: [u8; COEFFICIENTS] = turned();

const fn turned() -> [u8; COEFFICIENTS] {
    let mut order = ZIGZAG;
    let mut at = 0;
    while at < COEFFICIENTS {
        order[at] = ZIGZAG[at] % 8 * 8 + ZIGZAG[at] / 8;
        at += 1;
    }
    order
}

/// What the sums of a block are multiplied by to become what is stored, in a block that is turned.
#[derive(Clone, Debug)]
pub struct Factors([f32; COEFFICIENTS]);

impl Factors {
    /// Of a quantiser in the order in which coefficients are stored.
    pub fn new(quantiser: &[u8; COEFFICIENTS]) -> Factors {
        // [`sums`] leaves out the factors of T.81's formula, and the one that the cosine of the
        // fourth frequency has in all places.
        let scale = |k: usize| if k.is_multiple_of(4) { 0.5 * FRAC_1_SQRT_2 } else { 0.5 };
        let mut factors = [0.0; COEFFICIENTS];
        for (at, divisor) in TURNED.map(usize::from).into_iter().zip(quantiser) {
            factors[at] = (scale(at / SIDE) * scale(at % SIDE) / f64::from(*divisor)) as f32;
        }
        Factors(factors)
    }

    /// The coefficients of a block, in the order in which they are stored. The block begins at the
    /// first sample (0 ... 255) of rows that are `row_len` apart.
    #[inline(always)]
    pub fn coefficients(&self, samples: &[f32], row_len: usize) -> [i16; COEFFICIENTS] {
        let ([left_low, left_high], [right_low, right_high]) =
            (column_sums(samples, row_len), column_sums(&samples[4..], row_len));
        let low = sums(turn(left_low), turn(right_low));
        let high = sums(turn(left_high), turn(right_high));
        let mut all = [0.0; COEFFICIENTS];
        for (row, (low, high)) in low.iter().flatten().zip(high.iter().flatten()).enumerate() {
            low.write_to_slice(&mut all[row * SIDE..]);
            high.write_to_slice(&mut all[row * SIDE + 4..]);
        }
        // With 128 in the middle: the mean alone tells of it.
        all[0] -= 128.0 * COEFFICIENTS as f32;
        let mut turned = [0; COEFFICIENTS];
        for ((number, sum), factor) in turned.iter_mut().zip(&all).zip(&self.0) {
            *number = (sum * factor + ROUNDING).to_bits() as i16;
        }
        let mut coefficients = [0; COEFFICIENTS];
        for (number, at) in coefficients.iter_mut().zip(TURNED) {
            *number = turned[usize::from(at) % COEFFICIENTS];
        }
        coefficients
    }
}

/// [`sums`] of the first four columns of rows that are `row_len` apart.
#[inline(always)]
fn column_sums(samples: &[f32], row_len: usize) -> [[Vec4; 4]; 2] {
    let mut rows = [Vec4::ZERO; SIDE];
    for (y, row) in rows.iter_mut().enumerate() {
        *row = Vec4::from_slice(&samples[y * row_len..]);
    }
    let [a, b, c, d, e, f, g, h] = rows;
    sums([a, b, c, d], [e, f, g, h])
}

/// Rows of four to columns.
#[inline(always)]
fn turn([a, b, c, d]: [Vec4; 4]) -> [Vec4; 4] {
    let turned = Mat4::from_cols(a, b, c, d).transpose();
    [turned.x_axis, turned.y_axis, turned.z_axis, turned.w_axis]
}

/// `sum of x[n] cos((2n + 1) k pi / 16)` for all `k`, but for `k = 4` without its factor of
/// `cos(pi / 4)`. Cosines of even `k` are the same from both ends, those of odd `k` with the other
/// sign.
#[inline(always)]
fn sums([x0, x1, x2, x3]: [Vec4; 4], [x4, x5, x6, x7]: [Vec4; 4]) -> [[Vec4; 4]; 2] {
    let (s0, s1, s2, s3) = (x0 + x7, x1 + x6, x2 + x5, x3 + x4);
    let (d0, d1, d2, d3) = (x0 - x7, x1 - x6, x2 - x5, x3 - x4);
    let (outer, inner) = (s0 + s3, s1 + s2);
    let (outer_change, inner_change) = (s0 - s3, s1 - s2);
    let low = [
        outer + inner,
        d0 * C1 + d1 * C3 + d2 * C5 + d3 * C7,
        outer_change * C2 + inner_change * C6,
        d0 * C3 - d1 * C7 - d2 * C1 - d3 * C5,
    ];
    let high = [
        outer - inner,
        d0 * C5 - d1 * C1 + d2 * C7 + d3 * C3,
        outer_change * C6 - inner_change * C2,
        d0 * C7 - d1 * C5 + d2 * C3 - d3 * C1,
    ];
    [low, high]
}
