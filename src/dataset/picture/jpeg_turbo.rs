//! JPEG by libjpeg-turbo, which can shrink a picture while it decodes it.

use turbojpeg::{Compressor, Decompressor, Image, PixelFormat, ScalingFactor, Subsamp};

use crate::dataset::picture::{jpeg_header::Header, rgb::Rgb};

/// By how much pictures can be shrunk while they are decoded, most first. A picture of 8n + k
/// pixels keeps a column for the k: the last one stands for less of the picture than the others.
pub const REDUCTIONS: [usize; 4] = [8, 4, 2, 1];

/// Decode at 1 / `reduction` of the size, rounded up.
///
/// # Errors
///
/// A sentence: what is wrong with the picture; also where libjpeg-turbo would only warn.
pub fn decode(jpeg: &[u8], header: Header, reduction: usize) -> Result<Rgb, String> {
    let said = |error: turbojpeg::Error| error.to_string();
    let mut decoder = Decompressor::new().map_err(said)?;
    decoder.set_scaling_factor(ScalingFactor::new(1, reduction)).map_err(said)?;
    let (width, height) = (header.width.div_ceil(reduction), header.height.div_ceil(reduction));
    let mut data = vec![0; 3 * width * height];
    let pixels = &mut data[..];
    let rgb = Image { pixels, width, pitch: 3 * width, height, format: PixelFormat::RGB };
    decoder.decompress(jpeg, rgb).map_err(said)?;
    Ok(Rgb { width, height, data })
}

/// Encode as JPEG 4:2:0.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn encode(picture: &Rgb, quality: u8) -> Result<Vec<u8>, String> {
    let said = |error: turbojpeg::Error| error.to_string();
    let mut encoder = Compressor::new().map_err(said)?;
    encoder.set_quality(i32::from(quality)).map_err(said)?;
    encoder.set_subsamp(Subsamp::Sub2x2).map_err(said)?;
    let Rgb { width, height, ref data } = *picture;
    let rgb =
        Image { pixels: &data[..], width, pitch: 3 * width, height, format: PixelFormat::RGB };
    encoder.compress_to_vec(rgb).map_err(said)
}
