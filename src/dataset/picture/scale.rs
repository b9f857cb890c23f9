//! Cutting out and scaling.

use std::borrow::Cow;

use fast_image_resize::{
    FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer,
    images::{Image, ImageRef},
};

use crate::dataset::picture::rgb::Rgb;

/// A part of a picture, pixels from its top left corner; its borders may cut through pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Area {
    /// All of a picture.
    pub fn whole(picture: &Rgb) -> Area {
        Area { x: 0.0, y: 0.0, width: picture.width as f64, height: picture.height as f64 }
    }
}

/// Cut out `area` and scale it to `width` x `height`, each axis for itself.
///
/// Every new pixel is the mean of the area that it covers, so fine structure does not alias.
///
/// # Errors
///
/// A sentence, if the area does not lie inside the picture.
pub fn resize(
    picture: &Rgb,
    area: Area,
    width: usize,
    height: usize,
) -> Result<Cow<'_, Rgb>, String> {
    if area == Area::whole(picture) && (width, height) == (picture.width, picture.height) {
        return Ok(Cow::Borrowed(picture));
    }
    let source =
        ImageRef::new(picture.width as u32, picture.height as u32, &picture.data, PixelType::U8x3)
            .map_err(|error| error.to_string())?;
    let mut target = Image::new(width as u32, height as u32, PixelType::U8x3);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Box)).crop(
        area.x,
        area.y,
        area.width,
        area.height,
    );
    Resizer::new().resize(&source, &mut target, &options).map_err(|error| error.to_string())?;
    Ok(Cow::Owned(Rgb { width, height, data: target.into_vec() }))
}
