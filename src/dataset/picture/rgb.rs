//! A picture in memory.

/// Largest picture that is read: pixels on a side, and altogether (201 MB of RGB).
pub const MAX_SIDE: usize = 16_384;
pub const MAX_PIXELS: usize = 1 << 26;

/// Rows of red, green, blue, 8 bits each (sRGB, as cameras give them).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb {
    pub width: usize,
    pub height: usize,
    /// `3 * width * height` bytes.
    pub data: Vec<u8>,
}

/// Refuse a size before anything is allocated for it.
///
/// # Errors
///
/// A sentence: no pixels, or more than [`MAX_SIDE`] on a side or [`MAX_PIXELS`] altogether.
pub fn check_size(width: usize, height: usize) -> Result<(), String> {
    let sides = 1..=MAX_SIDE;
    if sides.contains(&width) && sides.contains(&height) && width * height <= MAX_PIXELS {
        return Ok(());
    }
    Err(format!(
        "{width} x {height} pixels; pictures may have 1 to {MAX_SIDE} on a side and {MAX_PIXELS} \
         altogether"
    ))
}
