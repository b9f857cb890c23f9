//! JPEG, grey or colour, by the codec that pmp was built with.

#[cfg(not(feature = "turbojpeg"))]
use crate::dataset::picture::jpeg_rust as codec;
#[cfg(feature = "turbojpeg")]
use crate::dataset::picture::jpeg_turbo as codec;
use crate::dataset::picture::{
    jpeg_header::Header,
    rgb::{Rgb, check_size},
};

/// The first bytes of every JPEG.
pub const MAGIC: &[u8] = &[0xff, 0xd8];

/// By how much pictures can be shrunk while they are decoded, most first; the last is 1.
pub const REDUCTIONS: &[usize] = &codec::REDUCTIONS;

/// Decode all of a JPEG.
///
/// # Errors
///
/// A sentence: what is wrong with the picture. One that is cut off is damaged.
pub fn decode(jpeg: &[u8]) -> Result<Rgb, String> {
    decode_reduced(jpeg, Header::read(jpeg)?, 1)
}

/// Decode at 1 / `reduction` of the size, rounded up; `reduction` is one of [`REDUCTIONS`].
///
/// # Errors
///
/// As [`decode`].
pub fn decode_reduced(jpeg: &[u8], header: Header, reduction: usize) -> Result<Rgb, String> {
    check_size(header.width, header.height)?;
    let end = end(jpeg).ok_or("a JPEG that is cut off: it has no end")?;
    codec::decode(&jpeg[..end], header, reduction)
}

/// Bytes up to the end behind the last scan. Decoders fill up a few missing bytes without a word.
fn end(jpeg: &[u8]) -> Option<usize> {
    let is_scan_or_end = |two: &[u8]| matches!(two, [0xff, 0xd9 | 0xda]);
    let last = jpeg.windows(2).rposition(is_scan_or_end)?;
    (jpeg[last + 1] == 0xd9).then_some(last + 2)
}

/// Encode as JPEG 4:2:0, quality 1 ... 100.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn encode(picture: &Rgb, quality: u8) -> Result<Vec<u8>, String> {
    codec::encode(picture, quality)
}
