//! A picture as luma and colour differences, each at a resolution of its own.
//!
//! What is stored is a JPEG of luma and, for each 2 x 2 pixels, two colour differences. A recorded
//! JPEG has them already, and scaled each for itself they are the stored ones: no pixel has to
//! become red, green and blue on the way.

use fast_image_resize::{
    FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer,
    images::{Image, ImageRef},
};

use crate::dataset::picture::scale::Area;

/// Rows of samples; the picture lies at the top left, what is beyond it at the right and lower
/// border repeats or continues it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    pub width: usize,
    pub height: usize,
    /// `width * height` samples.
    pub data: Vec<u8>,
    /// Recorded pixels that a sample stands for, beside and above each other.
    pub pixels: [usize; 2],
}

/// Luma, and Cb and Cr where the picture is not grey (JFIF: BT.601 in 0 ... 255).
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    pub luma: Plane,
    pub colour: Option<[Plane; 2]>,
}

/// Luma of every pixel, then Cb, then Cr of every 2 x 2, rows without padding (I420).
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// Even.
    pub width: usize,
    pub height: usize,
    pub data: Vec<u8>,
}

impl Stored {
    /// Bytes of luma, and of each colour difference.
    pub fn lens(&self) -> (usize, usize) {
        let luma = self.width * self.height;
        (luma, luma / 4)
    }
}

impl Planes {
    /// Cut out `area`, in recorded pixels, and scale it to `width` x `height`, both even, each axis
    /// for itself: every sample is the mean of the area that it covers.
    ///
    /// # Errors
    ///
    /// A sentence, if the area does not lie inside the picture.
    pub fn resize(&self, area: Area, width: usize, height: usize) -> Result<Stored, String> {
        let mut stored = Stored { width, height, data: vec![128; width * height * 3 / 2] };
        let (luma, colours) = stored.lens();
        let (first, rest) = stored.data.split_at_mut(luma);
        resize_into(&self.luma, area, width, height, first)?;
        if let Some(planes) = &self.colour {
            for (plane, into) in planes.iter().zip(rest.chunks_exact_mut(colours)) {
                resize_into(plane, area, width / 2, height / 2, into)?;
            }
        }
        Ok(stored)
    }
}

fn resize_into(
    plane: &Plane,
    area: Area,
    width: usize,
    height: usize,
    into: &mut [u8],
) -> Result<(), String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let (source_width, source_height) = (plane.width as u32, plane.height as u32);
    let source = ImageRef::new(source_width, source_height, &plane.data, PixelType::U8)
        .map_err(|error| said(&error))?;
    let mut target = Image::from_slice_u8(width as u32, height as u32, into, PixelType::U8)
        .map_err(|error| said(&error))?;
    let [across, down] = plane.pixels.map(|pixels| pixels as f64);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Box)).crop(
        area.x / across,
        area.y / down,
        area.width / across,
        area.height / down,
    );
    Resizer::new().resize(&source, &mut target, &options).map_err(|error| said(&error))
}
