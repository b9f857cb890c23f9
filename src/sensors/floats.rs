//! Arithmetic on numbers of 32 bits that is quicker than the standard library's, which takes care of
//! what is no number and of what is too large.

/// The lesser of two numbers; without the care that [`f32::min`] takes of what is none, which costs.
#[inline]
pub fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The greater of two numbers.
#[inline]
pub fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Largest whole number that is not greater.
#[inline]
pub fn floor(value: f32) -> i32 {
    let towards_zero = value as i32;
    towards_zero - i32::from((towards_zero as f32) > value)
}

/// Floats of this size are whole: to add it rounds, quicker than any conversion.
pub const WHOLE: f32 = (3 << 22) as f32;

/// The whole number below, and what is left, in [0, 1]; for numbers within 4 million. A whole number
/// itself may be seen as the end of the step before.
#[inline]
pub fn split(value: f32) -> (i32, f32) {
    let rounded = (value - 0.5) + WHOLE;
    (rounded.to_bits().wrapping_sub(WHOLE.to_bits()) as i32, value - (rounded - WHOLE))
}

/// The nearest whole number; for numbers within 4 million.
#[inline]
pub fn nearest(value: f32) -> i32 {
    (value + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits()) as i32
}

/// The least whole number that is not less; for numbers within 4 million.
#[inline]
pub fn ceil(value: f32) -> i32 {
    let nearest = nearest(value);
    nearest + i32::from((nearest as f32) < value)
}
