//! JPEG in Rust alone: decoded by zune-jpeg, encoded by jpeg-encoder.

use jpeg_encoder::{ColorType, Encoder, EncodingError, ImageBuffer, JpegColorType, SamplingFactor};
use zune_jpeg::{
    JpegDecoder,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

use crate::dataset::picture::{
    jpeg_header::Header,
    planes::Stored,
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
    let (width, height) = size(picture.width, picture.height)?;
    encode_by(quality, |encoder| encoder.encode(&picture.data, width, height, ColorType::Rgb))
}

/// Encode luma and colour differences as they are.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn encode_planes(picture: &Stored, quality: u8) -> Result<Vec<u8>, String> {
    let size = size(picture.width, picture.height)?;
    encode_by(quality, |encoder| encoder.encode_image(Repeated { picture, size }))
}

fn size(width: usize, height: usize) -> Result<(u16, u16), String> {
    let sides = u16::try_from(width).ok().zip(u16::try_from(height).ok());
    sides.ok_or_else(|| "more than 65,535 pixels on a side".to_string())
}

fn encode_by(
    quality: u8,
    encode: impl FnOnce(Encoder<&mut Vec<u8>>) -> Result<(), EncodingError>,
) -> Result<Vec<u8>, String> {
    let mut jpeg = Vec::new();
    let mut encoder = Encoder::new(&mut jpeg, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    encode(encoder).map_err(|error| error.to_string())?;
    Ok(jpeg)
}

/// Colour differences repeated for each of the pixels that share them: the encoder, which wants
/// one for each, takes their mean.
struct Repeated<'p> {
    picture: &'p Stored,
    size: (u16, u16),
}

impl ImageBuffer for Repeated<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        JpegColorType::Ycbcr
    }

    fn width(&self) -> u16 {
        self.size.0
    }

    fn height(&self) -> u16 {
        self.size.1
    }

    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        let Stored { width, ref data, .. } = *self.picture;
        let (luma, colour) = self.picture.lens();
        let y = usize::from(y);
        buffers[0].extend_from_slice(&data[y * width..][..width]);
        let row = luma + y / 2 * (width / 2);
        for (buffer, start) in buffers[1..].iter_mut().zip([row, row + colour]) {
            buffer.extend(data[start..][..width / 2].iter().flat_map(|sample| [*sample; 2]));
        }
    }
}
