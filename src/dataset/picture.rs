//! Recorded pictures to stored ones: decode, cut out, scale, encode as JPEG.

use fast_image_resize::{
    FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer,
    images::{Image, ImageRef},
};
use zune_jpeg::{
    JpegDecoder,
    zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions},
};

use crate::{
    log::{
        profile::CameraRule,
        signals::{Encoding, Picture},
    },
    projection::Crop,
};

/// Largest picture that is decoded, pixels on a side.
pub const MAX_SIDE: usize = 16_384;

/// A picture in memory, RGB.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb {
    pub width: usize,
    pub height: usize,
    /// Rows of red, green, blue.
    pub data: Vec<u8>,
}

/// Decode a picture of a log.
///
/// # Errors
///
/// A sentence: what is wrong with the picture.
pub fn decode(picture: &Picture) -> Result<Rgb, String> {
    match picture {
        Picture::Compressed { data } if data.starts_with(&[0xff, 0xd8]) => decode_jpeg(data),
        Picture::Compressed { data } if data.starts_with(b"\x89PNG") => decode_png(data),
        Picture::Compressed { data } => {
            let head = &data[..data.len().min(4)];
            Err(format!("neither JPEG nor PNG: it begins with {head:02x?}"))
        }
        Picture::Raw { width, height, encoding, row_bytes, data } => {
            let mut rgb = Vec::with_capacity(width * height * 3);
            for row in data.chunks_exact(*row_bytes).take(*height) {
                let pixels =
                    row[..width * encoding.pixel_bytes()].chunks_exact(encoding.pixel_bytes());
                for pixel in pixels {
                    rgb.extend_from_slice(&match encoding {
                        Encoding::Mono8 => [pixel[0]; 3],
                        Encoding::Rgb8 | Encoding::Rgba8 => [pixel[0], pixel[1], pixel[2]],
                        Encoding::Bgr8 | Encoding::Bgra8 => [pixel[2], pixel[1], pixel[0]],
                    });
                }
            }
            Ok(Rgb { width: *width, height: *height, data: rgb })
        }
    }
}

/// Decode a JPEG, colour or grey.
///
/// # Errors
///
/// A sentence: what is wrong with the picture.
pub fn decode_jpeg(data: &[u8]) -> Result<Rgb, String> {
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::RGB)
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE)
        .set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(data), options);
    let data = decoder.decode().map_err(|error| error.to_string())?;
    let (width, height) = decoder.dimensions().ok_or("no dimensions")?;
    if data.len() != width * height * 3 {
        return Err(format!("{} bytes for {width} x {height} pixels of RGB", data.len()));
    }
    Ok(Rgb { width, height, data })
}

fn decode_png(data: &[u8]) -> Result<Rgb, String> {
    let limits = png::Limits { bytes: MAX_SIDE * MAX_SIDE * 4 };
    let mut decoder = png::Decoder::new_with_limits(std::io::Cursor::new(data), limits);
    decoder.set_transformations(png::Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let bytes = reader.output_buffer_size().ok_or("too large")?;
    let mut pixels = vec![0; bytes];
    let info = reader.next_frame(&mut pixels).map_err(|error| error.to_string())?;
    let (width, height) = (info.width as usize, info.height as usize);
    let channels = info.color_type.samples();
    let mut rgb = Vec::with_capacity(width * height * 3);
    for row in pixels.chunks_exact(info.line_size).take(height) {
        for pixel in row[..width * channels].chunks_exact(channels) {
            rgb.extend_from_slice(&match channels {
                1 | 2 => [pixel[0]; 3],
                _ => [pixel[0], pixel[1], pixel[2]],
            });
        }
    }
    Ok(Rgb { width, height, data: rgb })
}

/// Cut out `crop` (all, if `None`) and scale to `width` x `height`, each axis for itself.
///
/// Every stored pixel is the mean of the area that it covers, so fine structure does not alias.
///
/// # Errors
///
/// A sentence, if the crop does not lie inside the picture.
pub fn resize(
    picture: &Rgb,
    crop: Option<Crop>,
    width: usize,
    height: usize,
) -> Result<Rgb, String> {
    let crop = crop.unwrap_or(Crop { x: 0, y: 0, width: picture.width, height: picture.height });
    let whole = (crop.width, crop.height) == (picture.width, picture.height);
    if whole && (width, height) == (picture.width, picture.height) {
        return Ok(picture.clone());
    }
    let source =
        ImageRef::new(picture.width as u32, picture.height as u32, &picture.data, PixelType::U8x3)
            .map_err(|error| error.to_string())?;
    let mut target = Image::new(width as u32, height as u32, PixelType::U8x3);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Box)).crop(
        crop.x as f64,
        crop.y as f64,
        crop.width as f64,
        crop.height as f64,
    );
    Resizer::new().resize(&source, &mut target, &options).map_err(|error| error.to_string())?;
    Ok(Rgb { width, height, data: target.into_vec() })
}

/// A picture as it is stored: cropped and scaled by the rule, JPEG 4:2:0.
///
/// # Errors
///
/// A sentence: what is wrong with the picture or the rule.
pub fn stored(picture: &Rgb, rule: &CameraRule) -> Result<Vec<u8>, String> {
    let scaled = resize(picture, rule.crop, rule.width, rule.height)?;
    encode_jpeg(&scaled, rule.quality)
}

/// Encode as JPEG 4:2:0.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn encode_jpeg(picture: &Rgb, quality: u8) -> Result<Vec<u8>, String> {
    let too_large = |_| "more than 65,535 pixels on a side".to_string();
    let (width, height) = (
        u16::try_from(picture.width).map_err(too_large)?,
        u16::try_from(picture.height).map_err(too_large)?,
    );
    let mut jpeg = Vec::new();
    let mut encoder = jpeg_encoder::Encoder::new(&mut jpeg, quality);
    encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_2_2);
    encoder
        .encode(&picture.data, width, height, jpeg_encoder::ColorType::Rgb)
        .map_err(|error| error.to_string())?;
    Ok(jpeg)
}
