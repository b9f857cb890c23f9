//! JPEG by libjpeg-turbo.

use turbojpeg::{Compressor, Decompressor, Image, PixelFormat, Subsamp, YuvImage};

use crate::dataset::picture::{jpeg_header::Header, planes::Stored, rgb::Rgb};

/// Decode.
///
/// # Errors
///
/// A sentence: what is wrong with the picture; also where libjpeg-turbo would only warn.
pub fn decode(jpeg: &[u8], header: Header) -> Result<Rgb, String> {
    let said = |error: turbojpeg::Error| error.to_string();
    let mut decoder = Decompressor::new().map_err(said)?;
    let Header { width, height, .. } = header;
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
    let mut encoder = encoder(quality).map_err(said)?;
    encoder.set_subsamp(Subsamp::Sub2x2).map_err(said)?;
    let Rgb { width, height, ref data } = *picture;
    let rgb =
        Image { pixels: &data[..], width, pitch: 3 * width, height, format: PixelFormat::RGB };
    encoder.compress_to_vec(rgb).map_err(said)
}

/// Encode luma and colour differences as they are.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn encode_planes(picture: &Stored, quality: u8) -> Result<Vec<u8>, String> {
    let said = |error: turbojpeg::Error| error.to_string();
    let mut encoder = encoder(quality).map_err(said)?;
    let Stored { width, height, ref data } = *picture;
    let planes = YuvImage { pixels: &data[..], width, align: 1, height, subsamp: Subsamp::Sub2x2 };
    encoder.compress_yuv_to_vec(planes).map_err(said)
}

fn encoder(quality: u8) -> Result<Compressor, turbojpeg::Error> {
    let mut encoder = Compressor::new()?;
    encoder.set_quality(i32::from(quality))?;
    Ok(encoder)
}
