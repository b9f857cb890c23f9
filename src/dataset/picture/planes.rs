//! A picture as luma and colour differences, each at a resolution of its own.
//!
//! What is stored is a JPEG of luma and, for each 2 x 2 pixels, two colour differences. A recorded
//! JPEG has them already, and scaled each for itself they are the stored ones: no pixel has to
//! become red, green and blue on the way.

use fast_image_resize::{
    FilterType, PixelType, ResizeAlg, ResizeOptions, Resizer,
    images::{Image, ImageRef},
};

use crate::dataset::picture::{scale::Area, transpose::transposed};

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

/// First the rows, then the columns, as rows of the plane turned: to make one row of several is
/// far less work than to make one sample of several beside each other, and turning is little.
fn resize_into(
    plane: &Plane,
    area: Area,
    width: usize,
    height: usize,
    into: &mut [u8],
) -> Result<(), String> {
    let [across, down] = plane.pixels.map(|pixels| pixels as f64);
    let rows = scale_rows(&plane.data, plane.width, (area.y / down, area.height / down), height)?;
    let turned = transposed(&rows, plane.width);
    let columns = scale_rows(&turned, height, (area.x / across, area.width / across), width)?;
    into.copy_from_slice(&transposed(&columns, height));
    Ok(())
}

/// Make so many rows of some of those there are: from where, and how many.
fn scale_rows(
    source: &[u8],
    row_len: usize,
    (from, rows): (f64, f64),
    into_rows: usize,
) -> Result<Vec<u8>, String> {
    let height = source.len() / row_len;
    let source = ImageRef::new(row_len as u32, height as u32, source, PixelType::U8)
        .map_err(|error| error.to_string())?;
    let mut target = Image::new(row_len as u32, into_rows as u32, PixelType::U8);
    let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Box)).crop(
        0.0,
        from,
        row_len as f64,
        rows,
    );
    Resizer::new().resize(&source, &mut target, &options).map_err(|error| error.to_string())?;
    Ok(target.into_vec())
}
