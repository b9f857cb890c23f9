//! JPEG in Rust alone: decoded by zune-jpeg; from RGB encoded by jpeg-encoder, from planes by us.

use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use zune_jpeg::{
    JpegDecoder,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

pub use crate::dataset::picture::jpeg_write::write as encode_planes;
use crate::dataset::picture::{
    jpeg_header::Header,
    rgb::{MAX_SIDE, Rgb},
};

/// Decode.
///
/// Data that lacks within, with the end in its place, is not noticed here: of a baseline picture
/// [`Baseline::check`](crate::dataset::picture::jpeg_baseline::Baseline::check) tells.
///
/// # Errors
///
/// A sentence: what is wrong with the picture.
pub fn decode(jpeg: &[u8], header: Header) -> Result<Rgb, String> {
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::RGB)
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
        .set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(jpeg), options);
    let data = decoder.decode().map_err(|error| error.to_string())?;
    let Header { width, height, .. } = header;
    if data.len() != width * height * 3 {
        return Err(format!("{} bytes for {width} x {height} pixels of RGB", data.len()));
    }
    Ok(Rgb { width, height, data })
}

/// Encode as JPEG 4:2:0.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn encode(picture: &Rgb, quality: u8) -> Result<Vec<u8>, String> {
    let sides = u16::try_from(picture.width).ok().zip(u16::try_from(picture.height).ok());
    let (width, height) = sides.ok_or("more than 65,535 pixels on a side")?;
    let mut jpeg = Vec::new();
    let mut encoder = Encoder::new(&mut jpeg, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    let encoded = encoder.encode(&picture.data, width, height, ColorType::Rgb);
    encoded.map_err(|error| error.to_string())?;
    Ok(jpeg)
}
