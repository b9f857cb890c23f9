//! What the header of a JPEG says of its picture (ITU-T T.81, annex B).

use crate::dataset::picture::jpeg_segments::{START_OF_SCAN, segments};

/// As far as reading and keeping it needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    pub width: usize,
    pub height: usize,
    /// Colour as the stored pictures have it: baseline, Y Cb Cr, colour of 2 x 2 pixels shared.
    pub is_baseline_420: bool,
    /// Whether the samples are red, green and blue instead of luma and colour differences.
    pub is_rgb: bool,
}

impl Header {
    /// Read the header, up to the first scan.
    ///
    /// # Errors
    ///
    /// A sentence, if there is none.
    pub fn read(jpeg: &[u8]) -> Result<Header, String> {
        let mut is_rgb = false;
        let mut frame: Option<Header> = None;
        for segment in segments(jpeg) {
            let segment = segment?;
            match (segment.marker, segment.body) {
                // Adobe's segment says 0 where the samples are no luma and colour differences.
                (0xee, [b'A', b'd', b'o', b'b', b'e', .., transform]) => is_rgb = *transform == 0,
                // All frame headers: C4, C8 and CC among them are something else.
                (0xc0..=0xcf, [_, h1, h0, w1, w0, _, components @ ..])
                    if ![0xc4, 0xc8, 0xcc].contains(&segment.marker) =>
                {
                    let components = components.chunks_exact(3);
                    is_rgb |= components.clone().map(|component| component[0]).eq(*b"RGB");
                    let shares = components.map(|component| component[1]);
                    let header = Header {
                        width: usize::from(u16::from_be_bytes([*w1, *w0])),
                        height: usize::from(u16::from_be_bytes([*h1, *h0])),
                        is_baseline_420: segment.marker == 0xc0 && shares.eq([0x22, 0x11, 0x11]),
                        is_rgb: false,
                    };
                    frame = Some(header);
                }
                (START_OF_SCAN, _) => {
                    let header = frame.ok_or("a JPEG without a frame header")?;
                    let is_baseline_420 = header.is_baseline_420 && !is_rgb;
                    return Ok(Header { is_baseline_420, is_rgb, ..header });
                }
                _ => {}
            }
        }
        Err("a JPEG without picture data".to_string())
    }
}
