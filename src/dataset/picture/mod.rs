//! Any camera's picture to the stored one.
//!
//! **The rule.** Of the recorded picture the part `crop` is cut out (all of it, where a profile names
//! none) and scaled to the stored size, 600 x 250 unless the profile says otherwise, each axis
//! for itself: every stored pixel is the mean of the area that it covers. The intrinsics go the
//! same way, `fx' = fx * sx`, `cx' = (cx - crop.x) * sx` with `sx = stored width / crop width`, and
//! so for y ([`Camera::cropped_and_scaled`](crate::projection::Camera::cropped_and_scaled)), which
//! holds because (0, 0) is the outer corner of the first pixel on both sides. Lens distortion
//! stays in the picture and in the model. The result is a JPEG 4:2:0 of the profile's quality;
//! a recorded JPEG that has the stored size and kind already is read through, to know that it is
//! whole, and kept byte for byte.
//!
//! ```text
//! message -> png, webp, raw (bayer, yuv), h264, jpeg of other kinds -> RGB -> scale -> jpeg
//!         -> jpeg_baseline (jpeg_segments, jpeg_header, jpeg_tables, jpeg_codes) -> jpeg_shrink
//!            -> planes -> jpeg_write (jpeg_forward), or libjpeg-turbo
//! ```

pub mod rgb;
pub mod scale;
pub mod transpose;
pub mod planes;
pub mod jpeg_segments;
pub mod jpeg_header;
pub mod jpeg_tables;
pub mod jpeg_codes;
pub mod jpeg_baseline;
pub mod jpeg_shrink;
pub mod jpeg_forward;
pub mod jpeg_write;
#[cfg(not(feature = "turbojpeg"))]
pub mod jpeg_rust;
#[cfg(feature = "turbojpeg")]
pub mod jpeg_turbo;
pub mod jpeg;
pub mod png;
pub mod webp;
pub mod bayer;
pub mod yuv;
pub mod raw;
#[cfg(feature = "h264")]
pub mod h264;
#[cfg(not(feature = "h264"))]
pub mod h264_absent;

use jpeg_baseline::Baseline;
use jpeg_header::Header;
use planes::Planes;
use rgb::{Rgb, check_size};
use scale::Area;

use crate::{
    log::{image::Picture, profile::CameraRule},
    projection::Crop,
};

/// A recorded picture, ready to be stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded<'a> {
    /// Size as recorded, pixels.
    pub width: usize,
    pub height: usize,
    pub content: Content<'a>,
}

/// What was made of a recorded picture.
#[derive(Clone, Debug, PartialEq)]
pub enum Content<'a> {
    /// Every pixel.
    Rgb(Rgb),
    /// As finely as the rule needs it.
    Planes(Planes),
    /// Nothing, since it is of the stored kind and size and whole: the recorded file.
    Kept(&'a [u8]),
}

/// Decode a picture of a log, as finely as the rule needs it.
///
/// # Errors
///
/// A sentence: what is wrong with the picture.
pub fn decode<'a>(picture: &Picture<'a>, rule: &CameraRule) -> Result<Decoded<'a>, String> {
    let rgb = match picture {
        Picture::Raw(pixels) => raw::decode(pixels)?,
        Picture::Compressed { data } if data.starts_with(jpeg::MAGIC) => {
            return decode_jpeg(data, rule);
        }
        Picture::Compressed { data } if data.starts_with(png::MAGIC) => png::decode(data)?,
        Picture::Compressed { data } if webp::is_webp(data) => webp::decode(data)?,
        Picture::Compressed { data } => {
            let head = &data[..data.len().min(4)];
            return Err(format!("neither JPEG, PNG nor WebP: it begins with {head:02x?}"));
        }
    };
    Ok(Decoded::whole(rgb))
}

fn decode_jpeg<'a>(data: &'a [u8], rule: &CameraRule) -> Result<Decoded<'a>, String> {
    let header = Header::read(data)?;
    let Header { width, height, is_baseline_420, .. } = header;
    check_size(width, height)?;
    let whole = jpeg::up_to_end(data)?;
    let all = Crop { x: 0, y: 0, width, height };
    let crop = rule.crop.unwrap_or(all);
    let has_stored_size = crop == all && (width, height) == (rule.width, rule.height);
    let has_pairs = rule.width.is_multiple_of(2) && rule.height.is_multiple_of(2);
    let is_fine = |reduction: &&usize| {
        crop.width >= rule.width * *reduction && crop.height >= rule.height * *reduction
    };
    let reduction = jpeg_shrink::REDUCTIONS.iter().find(is_fine).filter(|_| has_pairs);
    let content = match (Baseline::read(whole, &header), reduction) {
        (Some(baseline), _) if has_stored_size && is_baseline_420 => {
            baseline.check()?;
            Content::Kept(data)
        }
        (Some(baseline), Some(reduction)) => {
            Content::Planes(jpeg_shrink::decode(&baseline, *reduction)?)
        }
        (baseline, _) => {
            baseline.map_or(Ok(()), |baseline| baseline.check())?;
            Content::Rgb(jpeg::decode(data)?)
        }
    };
    Ok(Decoded { width, height, content })
}

impl Decoded<'_> {
    /// A picture that was decoded whole.
    pub fn whole(rgb: Rgb) -> Decoded<'static> {
        Decoded { width: rgb.width, height: rgb.height, content: Content::Rgb(rgb) }
    }

    /// The picture as it is stored: a JPEG, by the rule above.
    ///
    /// # Errors
    ///
    /// A sentence: what is wrong with the rule.
    pub fn stored(&self, rule: &CameraRule) -> Result<Vec<u8>, String> {
        let Decoded { width, height, .. } = *self;
        let crop = rule.crop.unwrap_or(Crop { x: 0, y: 0, width, height });
        if !crop.lies_inside(width, height) {
            return Err(format!("the crop does not lie inside the {width} x {height} pixels"));
        }
        let area = Area {
            x: crop.x as f64,
            y: crop.y as f64,
            width: crop.width as f64,
            height: crop.height as f64,
        };
        match &self.content {
            Content::Rgb(rgb) => {
                let scaled = scale::resize(rgb, area, rule.width, rule.height)?;
                jpeg::encode(&scaled, rule.quality)
            }
            Content::Planes(planes) => {
                let scaled = planes.resize(area, rule.width, rule.height)?;
                jpeg::encode_planes(&scaled, rule.quality)
            }
            Content::Kept(file) => Ok(file.to_vec()),
        }
    }
}
