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

/// First the rows, then the columns: of fewer rows, since columns are what takes the time.
fn resize_into(
    plane: &Plane,
    area: Area,
    width: usize,
    height: usize,
    into: &mut [u8],
) -> Result<(), String> {
    let [across, down] = plane.pixels.map(|pixels| pixels as f64);
    let mut rows = vec![0; plane.width * height];
    let all_columns = (0.0, plane.width as f64);
    let kept_rows = (area.y / down, area.height / down);
    let size = (plane.width, plane.height);
    resize_part(&plane.data, size, (all_columns, kept_rows), &mut rows, (plane.width, height))?;
    let columns = (area.x / across, area.width / across);
    let size = (plane.width, height);
    resize_part(&rows, size, (columns, (0.0, height as f64)), into, (width, height))
}

/// Scale some columns and rows, each from where and how many.
fn resize_part(
    source: &[u8],
    (source_width, source_height): (usize, usize),
    ((x, columns), (y, rows)): ((f64, f64), (f64, f64)),
    into: &mut [u8],
    (width, height): (usize, usize),
) -> Result<(), String> {
    let source = ImageRef::new(source_width as u32, source_height as u32, source, PixelType::U8)
        .map_err(|error| error.to_string())?;
    let mut target = Image::from_slice_u8(width as u32, height as u32, into, PixelType::U8)
        .map_err(|error| error.to_string())?;
    let options = ResizeOptions::new()
        .resize_alg(ResizeAlg::Convolution(FilterType::Box))
        .crop(x, y, columns, rows);
    Resizer::new().resize(&source, &mut target, &options).map_err(|error| error.to_string())
}
