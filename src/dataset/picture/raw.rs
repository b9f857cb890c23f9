//! Rows of pixels, as `sensor_msgs/Image` and `foxglove.RawImage` have them, to RGB.
//!
//! Samples of 16 bits fill all of them: 65,535 becomes 255, rounded to the nearest, as cv_bridge
//! scales `mono16`. A camera that writes 12 bits into 16 gives dark pictures; nothing in the message
//! would tell. Luma and colour differences are BT.601 in 16 ... 235; a colour that pixels share is
//! repeated for each. Transparency is left out.

use crate::{
    dataset::picture::{
        bayer,
        rgb::{Rgb, check_size},
        yuv::{Colour, ToRgb},
    },
    log::{
        image::{ChromaPlanes, Depth, Encoding, Pixels},
        value::Endian,
    },
};

/// Decode rows of pixels.
///
/// # Errors
///
/// A sentence: what is wrong with the picture.
pub fn decode(pixels: &Pixels) -> Result<Rgb, String> {
    let Pixels { width, height, endian, .. } = *pixels;
    check_size(width, height)?;
    let mut data = Vec::with_capacity(3 * width * height);
    match pixels.encoding {
        Encoding::Interleaved { samples, rgb, depth } => {
            let step = depth.bytes();
            for row in rows(pixels, width * samples * step) {
                for pixel in row.chunks_exact(samples * step) {
                    data.extend(rgb.map(|at| sample(&pixel[at * step..], depth, endian)));
                }
            }
        }
        Encoding::Bayer { red, depth } => {
            let rows = rows(pixels, width * depth.bytes());
            let samples = rows.flat_map(|row| row.chunks_exact(depth.bytes()));
            let mosaic: Vec<u8> = samples.map(|bytes| sample(bytes, depth, endian)).collect();
            return Ok(bayer::demosaic(width, height, red, &mosaic));
        }
        Encoding::Yuv422 { luma } => {
            let to_rgb = ToRgb::new(Colour::UNSAID);
            for row in rows(pixels, 2 * width.next_multiple_of(2)) {
                for x in 0..width {
                    let pair = &row[x / 2 * 4..][..4];
                    let (cb, cr) = (pair[1 - luma], pair[3 - luma]);
                    data.extend(to_rgb.pixel(pair[luma + x % 2 * 2], cb, cr));
                }
            }
        }
        Encoding::Yuv420(planes) => {
            let to_rgb = ToRgb::new(Colour::UNSAID);
            let chroma = Chroma::new(pixels, planes);
            for (y, row) in rows(pixels, width).enumerate() {
                for (x, luma) in row.iter().enumerate() {
                    let [cb, cr] = chroma.at(x / 2, y / 2);
                    data.extend(to_rgb.pixel(*luma, cb, cr));
                }
            }
        }
    }
    Ok(Rgb { width, height, data })
}

/// The used part of every row of the first plane.
fn rows<'a>(pixels: &Pixels<'a>, used_bytes: usize) -> impl Iterator<Item = &'a [u8]> {
    let rows = pixels.data.chunks(pixels.row_bytes).take(pixels.height);
    rows.map(move |row| &row[..used_bytes])
}

/// The sample at the beginning of some bytes, in 8 bits.
fn sample(bytes: &[u8], depth: Depth, endian: Endian) -> u8 {
    let wide = match (depth, endian) {
        (Depth::Eight, _) => return bytes[0],
        (Depth::Sixteen, Endian::Little) => u16::from_le_bytes([bytes[0], bytes[1]]),
        (Depth::Sixteen, Endian::Big) => u16::from_be_bytes([bytes[0], bytes[1]]),
    };
    // 65,535 = 255 * 257.
    ((u32::from(wide) + 128) / 257) as u8
}

/// The colour planes of a 4:2:0 picture.
struct Chroma<'a> {
    cb: &'a [u8],
    cr: &'a [u8],
    /// From one sample to the next, and from one row to the next.
    step: usize,
    row_bytes: usize,
}

impl<'a> Chroma<'a> {
    fn new(pixels: &Pixels<'a>, planes: ChromaPlanes) -> Chroma<'a> {
        let data = &pixels.data[pixels.row_bytes * pixels.height..];
        let row_bytes = pixels.row_bytes.next_multiple_of(2);
        match planes {
            ChromaPlanes::CbCr => Chroma { cb: data, cr: &data[1..], step: 2, row_bytes },
            ChromaPlanes::CrCb => Chroma { cb: &data[1..], cr: data, step: 2, row_bytes },
            ChromaPlanes::Apart => {
                let row_bytes = row_bytes / 2;
                let cr = &data[row_bytes * pixels.height.div_ceil(2)..];
                Chroma { cb: data, cr, step: 1, row_bytes }
            }
        }
    }

    fn at(&self, x: usize, y: usize) -> [u8; 2] {
        let at = y * self.row_bytes + x * self.step;
        [self.cb[at], self.cr[at]]
    }
}
