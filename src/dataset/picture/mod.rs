//! Any camera's picture to the stored one.
//!
//! **The rule.** Of the recorded picture the part `crop` is cut out (all of it, where a profile names
//! none) and scaled to the stored size, 600 x 250 unless the profile says otherwise, each axis
//! for itself: every stored pixel is the mean of the area that it covers. The intrinsics go the
//! same way, `fx' = fx * sx`, `cx' = (cx - crop.x) * sx` with `sx = stored width / crop width`, and
//! so for y ([`Camera::cropped_and_scaled`](crate::projection::Camera::cropped_and_scaled)), which
//! holds because (0, 0) is the outer corner of the first pixel on both sides. Lens distortion
//! stays in the picture and in the model. The result is a JPEG 4:2:0 of the profile's quality;
//! a recorded JPEG that has the stored size and kind already is decoded, to know that it is whole,
//! and kept byte for byte.
//!
//! ```text
//! message -> jpeg, png, webp, raw (bayer, yuv), h264 -> RGB -> scale -> jpeg
//! ```

pub mod rgb;
pub mod scale;
pub mod jpeg_header;
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

use jpeg_header::Header;
use rgb::Rgb;
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
    /// The picture, each of whose pixels stands for `reduction` x `reduction` recorded ones; those
    /// at the right and lower border for what is left.
    pub rgb: Rgb,
    pub reduction: usize,
    /// The recorded file, if it is of the stored kind.
    original: Option<&'a [u8]>,
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
    let Header { width, height, is_baseline_420 } = header;
    let crop = rule.crop.unwrap_or(Crop { x: 0, y: 0, width, height });
    let is_fine = |reduction: &&usize| {
        crop.width >= rule.width * *reduction && crop.height >= rule.height * *reduction
    };
    let reduction = jpeg::REDUCTIONS.iter().find(is_fine).copied().unwrap_or(1);
    let rgb = jpeg::decode_reduced(data, header, reduction)?;
    let original = Some(data).filter(|_| is_baseline_420);
    Ok(Decoded { width, height, rgb, reduction, original })
}

impl Decoded<'_> {
    /// A picture that was decoded whole.
    pub fn whole(rgb: Rgb) -> Decoded<'static> {
        Decoded { width: rgb.width, height: rgb.height, rgb, reduction: 1, original: None }
    }

    /// The picture as it is stored: a JPEG, by the rule above.
    ///
    /// # Errors
    ///
    /// A sentence: what is wrong with the rule.
    pub fn stored(&self, rule: &CameraRule) -> Result<Vec<u8>, String> {
        let Decoded { width, height, .. } = *self;
        let all = Crop { x: 0, y: 0, width, height };
        let crop = rule.crop.unwrap_or(all);
        if !crop.lies_inside(width, height) {
            return Err(format!("the crop does not lie inside the {width} x {height} pixels"));
        }
        let has_stored_size = crop == all && (width, height) == (rule.width, rule.height);
        if let Some(original) = self.original.filter(|_| has_stored_size) {
            return Ok(original.to_vec());
        }
        let reduced = |pixels: usize| pixels as f64 / self.reduction as f64;
        let area = Area {
            x: reduced(crop.x),
            y: reduced(crop.y),
            width: reduced(crop.width),
            height: reduced(crop.height),
        };
        let scaled = scale::resize(&self.rgb, area, rule.width, rule.height)?;
        jpeg::encode(&scaled, rule.quality)
    }
}
