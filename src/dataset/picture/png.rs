//! PNG, of any colour type and depth; transparency is left out.

use std::io::Cursor;

use png::{Decoder, Limits, Transformations};

use crate::dataset::picture::rgb::{MAX_PIXELS, Rgb, check_size};

/// The first bytes of every PNG.
pub const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Decode a PNG. Samples of 16 bits keep their upper 8.
///
/// # Errors
///
/// A sentence: what is wrong with the picture.
pub fn decode(data: &[u8]) -> Result<Rgb, String> {
    let mut decoder = Decoder::new_with_limits(Cursor::new(data), Limits { bytes: 4 * MAX_PIXELS });
    decoder.set_transformations(Transformations::normalize_to_color8());
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    check_size(reader.info().width as usize, reader.info().height as usize)?;
    let mut pixels = vec![0; reader.output_buffer_size().ok_or("larger than the memory")?];
    let info = reader.next_frame(&mut pixels).map_err(|error| error.to_string())?;
    let (width, height) = (info.width as usize, info.height as usize);
    let samples = info.color_type.samples();
    let rows = pixels.chunks_exact(info.line_size).take(height);
    let pixels = rows.flat_map(|row| row[..width * samples].chunks_exact(samples));
    let mut rgb = Vec::with_capacity(3 * width * height);
    for pixel in pixels {
        rgb.extend_from_slice(&match pixel {
            [grey] | [grey, _] => [*grey; 3],
            _ => [pixel[0], pixel[1], pixel[2]],
        });
    }
    Ok(Rgb { width, height, data: rgb })
}
