//! WebP, lossy or lossless; transparency is left out.

use std::io::Cursor;

use image_webp::WebPDecoder;

use crate::dataset::picture::rgb::{MAX_PIXELS, Rgb, check_size};

/// Whether a picture begins as every WebP does.
pub fn is_webp(data: &[u8]) -> bool {
    data.starts_with(b"RIFF") && data.get(8..12) == Some(b"WEBP")
}

/// Decode a WebP.
///
/// # Errors
///
/// A sentence: what is wrong with the picture. An animation is none.
pub fn decode(data: &[u8]) -> Result<Rgb, String> {
    let mut decoder = WebPDecoder::new(Cursor::new(data)).map_err(|error| error.to_string())?;
    decoder.set_memory_limit(4 * MAX_PIXELS);
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    if decoder.is_animated() {
        return Err("an animated WebP, which is no single picture".to_string());
    }
    let mut pixels = vec![0; decoder.output_buffer_size().ok_or("larger than the memory")?];
    decoder.read_image(&mut pixels).map_err(|error| error.to_string())?;
    if decoder.has_alpha() {
        pixels = pixels.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    }
    Ok(Rgb { width, height, data: pixels })
}
