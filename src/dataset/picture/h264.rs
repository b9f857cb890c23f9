//! H.264 to RGB, by Cisco's OpenH264.

use openh264::formats::YUVSource;

use crate::{
    dataset::picture::{
        rgb::{Rgb, check_size},
        yuv::{Colour, Matrix, ToRgb},
    },
    log::{h264::Sequence, video::Parameters},
};

/// Whether pmp was built with a decoder.
pub const IS_BUILT_IN: bool = true;

/// Decodes the packets of one group of pictures, from its key frame on.
pub struct Decoder {
    decoder: openh264::decoder::Decoder,
    to_rgb: ToRgb,
}

impl Decoder {
    /// A decoder that knows the parameters of the key frame to come.
    ///
    /// # Errors
    ///
    /// A sentence: pictures that are too large, or colours that are not read.
    pub fn new(parameters: &Parameters) -> Result<Decoder, String> {
        let Sequence { coded_width, coded_height, .. } = parameters.sequence;
        check_size(coded_width, coded_height)?;
        let to_rgb = ToRgb::new(colour(&parameters.sequence)?);
        let mut decoder = openh264::decoder::Decoder::new().map_err(|error| error.to_string())?;
        decoder.decode(&parameters.units).map_err(|_error| cannot("the parameters"))?;
        Ok(Decoder { decoder, to_rgb })
    }

    /// Decode the next packet; its picture, if it is wanted.
    ///
    /// # Errors
    ///
    /// A sentence: what is wrong with the packet. No packet after it can be decoded then.
    pub fn decode(&mut self, packet: &[u8], is_wanted: bool) -> Result<Option<Rgb>, String> {
        let picture = self.decoder.decode(packet).map_err(|_error| cannot("a packet"))?;
        let picture = picture.ok_or("a packet of the video gave no picture")?;
        if !is_wanted {
            return Ok(None);
        }
        let (width, height) = picture.dimensions();
        check_size(width, height)?;
        let (luma_stride, cb_stride, cr_stride) = picture.strides();
        let mut data = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            let luma = &picture.y()[y * luma_stride..][..width];
            let cb = &picture.u()[y / 2 * cb_stride..][..width.div_ceil(2)];
            let cr = &picture.v()[y / 2 * cr_stride..][..width.div_ceil(2)];
            for (pair, (cb, cr)) in luma.chunks(2).zip(cb.iter().zip(cr)) {
                data.extend(pair.iter().flat_map(|luma| self.to_rgb.pixel(*luma, *cb, *cr)));
            }
        }
        Ok(Some(Rgb { width, height, data }))
    }
}

fn cannot(what: &str) -> String {
    format!("OpenH264 cannot decode {what} of the video; it reads 8 bits, 4:2:0, progressive")
}

/// Table E-5 of H.264.
fn colour(sequence: &Sequence) -> Result<Colour, String> {
    let matrix = match sequence.matrix {
        None => Colour::UNSAID.matrix,
        Some(1) => Matrix::Bt709,
        Some(5 | 6) => Matrix::Bt601,
        Some(9) => Matrix::Bt2020,
        Some(other) => return Err(format!("colour matrix {other} of the video is not read")),
    };
    Ok(Colour { matrix, is_full_range: sequence.is_full_range })
}
