//! JPEG, grey or colour, by the codec that pmp was built with.

#[cfg(not(feature = "turbojpeg"))]
use crate::dataset::picture::jpeg_rust as codec;
#[cfg(feature = "turbojpeg")]
use crate::dataset::picture::jpeg_turbo as codec;
use crate::dataset::picture::{
    jpeg_header::Header,
    planes::Stored,
    rgb::{Rgb, check_size},
};

/// The first bytes of every JPEG.
pub const MAGIC: &[u8] = &[0xff, 0xd8];

/// Decode all of a JPEG.
///
/// # Errors
///
/// A sentence: what is wrong with the picture. One that is cut off is damaged.
pub fn decode(jpeg: &[u8]) -> Result<Rgb, String> {
    let header = Header::read(jpeg)?;
    check_size(header.width, header.height)?;
    codec::decode(up_to_end(jpeg)?, header)
}

/// A JPEG up to the end behind its last scan. Decoders fill up a few missing bytes without a word.
///
/// # Errors
///
/// A sentence, if there is no end.
pub fn up_to_end(jpeg: &[u8]) -> Result<&[u8], String> {
    let is_scan_or_end = |two: &[u8]| matches!(two, [0xff, 0xd9 | 0xda]);
    let last = jpeg.windows(2).rposition(is_scan_or_end).filter(|last| jpeg[last + 1] == 0xd9);
    let last = last.ok_or("a JPEG that is cut off: it has no end")?;
    Ok(&jpeg[..last + 2])
}

/// Encode as JPEG 4:2:0, quality 1 ... 100.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn encode(picture: &Rgb, quality: u8) -> Result<Vec<u8>, String> {
    codec::encode(picture, quality)
}

/// Encode luma and colour differences, quality 1 ... 100.
///
/// # Errors
///
/// As [`encode`].
pub fn encode_planes(picture: &Stored, quality: u8) -> Result<Vec<u8>, String> {
    codec::encode_planes(picture, quality)
}
