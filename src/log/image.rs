//! Pictures as their messages hold them: a compressed file, or rows of pixels.
//!
//! Names of pixel layouts are those of ROS (`sensor_msgs/image_encodings.hpp`), which Foxglove's
//! `RawImage` shares: <https://docs.foxglove.dev/docs/sdk/schemas/raw-image>.

use crate::{
    error::{Error, Result},
    log::{
        signals::Kind,
        value::{Endian, Struct},
    },
};

/// A picture as it lies in its message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Picture<'a> {
    /// A file in memory: JPEG, PNG or WebP. Its first bytes say which, whatever `format` says.
    Compressed {
        data: &'a [u8],
    },
    Raw(Pixels<'a>),
}

/// Rows of pixels, or planes of rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixels<'a> {
    pub width: usize,
    pub height: usize,
    pub encoding: Encoding,
    /// From one row (of the first plane) to the next.
    pub row_bytes: usize,
    /// Of samples with 16 bits.
    pub endian: Endian,
    pub data: &'a [u8],
}

/// How pixels lie in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// The samples of a pixel beside each other; `rgb` says which of them are red, green and
    /// blue. Grey has one sample, which is all three.
    Interleaved { samples: usize, rgb: [usize; 3], depth: Depth },
    /// One sample a pixel behind a mosaic of colour filters: column and row of the red one in
    /// each 2 x 2; blue is diagonal to it.
    Bayer { red: [usize; 2], depth: Depth },
    /// Luma of each pixel beside the colour that two neighbours share, 4 bytes for both;
    /// `luma` is the first pixel's place among them, 0 or 1.
    Yuv422 { luma: usize },
    /// A plane of luma, then the colour that 2 x 2 pixels share.
    Yuv420(ChromaPlanes),
}

/// Bits of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    Eight,
    Sixteen,
}

/// How the colour of a 4:2:0 picture lies behind its luma.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChromaPlanes {
    /// One plane of Cb, Cr, Cb, Cr, ... (NV12).
    CbCr,
    /// One plane of Cr, Cb, Cr, Cb, ... (NV21).
    CrCb,
    /// A plane of Cb, then one of Cr, rows of half the length (I420).
    Apart,
}

impl Depth {
    pub fn bytes(self) -> usize {
        match self {
            Depth::Eight => 1,
            Depth::Sixteen => 2,
        }
    }
}

impl Encoding {
    /// The layout of that name.
    ///
    /// `8UC1`, `8UC3` and `16UC1` are OpenCV's names and say no colours: three channels are read as
    /// blue, green, red, which is OpenCV's own order and what Foxglove shows them as.
    pub fn of(name: &str) -> Option<Encoding> {
        let interleaved = |samples, rgb, depth| Some(Encoding::Interleaved { samples, rgb, depth });
        let bayer = |red, depth| Some(Encoding::Bayer { red, depth });
        match name {
            "mono8" | "8UC1" => interleaved(1, [0, 0, 0], Depth::Eight),
            "mono16" | "16UC1" => interleaved(1, [0, 0, 0], Depth::Sixteen),
            "rgb8" => interleaved(3, [0, 1, 2], Depth::Eight),
            "bgr8" | "8UC3" => interleaved(3, [2, 1, 0], Depth::Eight),
            "rgba8" => interleaved(4, [0, 1, 2], Depth::Eight),
            "bgra8" => interleaved(4, [2, 1, 0], Depth::Eight),
            "rgb16" => interleaved(3, [0, 1, 2], Depth::Sixteen),
            "bgr16" => interleaved(3, [2, 1, 0], Depth::Sixteen),
            "rgba16" => interleaved(4, [0, 1, 2], Depth::Sixteen),
            "bgra16" => interleaved(4, [2, 1, 0], Depth::Sixteen),
            "bayer_rggb8" => bayer([0, 0], Depth::Eight),
            "bayer_grbg8" => bayer([1, 0], Depth::Eight),
            "bayer_gbrg8" => bayer([0, 1], Depth::Eight),
            "bayer_bggr8" => bayer([1, 1], Depth::Eight),
            "bayer_rggb16" => bayer([0, 0], Depth::Sixteen),
            "bayer_grbg16" => bayer([1, 0], Depth::Sixteen),
            "bayer_gbrg16" => bayer([0, 1], Depth::Sixteen),
            "bayer_bggr16" => bayer([1, 1], Depth::Sixteen),
            "yuv422" | "uyvy" => Some(Encoding::Yuv422 { luma: 1 }),
            "yuv422_yuy2" | "yuyv" => Some(Encoding::Yuv422 { luma: 0 }),
            "nv12" => Some(Encoding::Yuv420(ChromaPlanes::CbCr)),
            "nv21" => Some(Encoding::Yuv420(ChromaPlanes::CrCb)),
            "i420" => Some(Encoding::Yuv420(ChromaPlanes::Apart)),
            _ => None,
        }
    }

    /// Bytes that a row (of the first plane) needs at least; `None` beyond the memory.
    fn least_row_bytes(self, width: usize) -> Option<usize> {
        match self {
            Encoding::Interleaved { samples, depth, .. } => {
                width.checked_mul(samples * depth.bytes())
            }
            Encoding::Bayer { depth, .. } => width.checked_mul(depth.bytes()),
            Encoding::Yuv422 { .. } => width.checked_next_multiple_of(2)?.checked_mul(2),
            Encoding::Yuv420(_) => Some(width),
        }
    }

    /// Bytes of a whole picture; `None` beyond the memory.
    fn bytes(self, row_bytes: usize, height: usize) -> Option<usize> {
        let first = row_bytes.checked_mul(height)?;
        let chroma_row_bytes = match self {
            Encoding::Yuv420(ChromaPlanes::CbCr | ChromaPlanes::CrCb) => {
                row_bytes.checked_next_multiple_of(2)?
            }
            Encoding::Yuv420(ChromaPlanes::Apart) => 2 * row_bytes.div_ceil(2),
            _ => return Some(first),
        };
        first.checked_add(chroma_row_bytes.checked_mul(height.div_ceil(2))?)
    }
}

/// The picture of a `sensor_msgs/CompressedImage`, `sensor_msgs/Image` or Foxglove's equals.
///
/// # Errors
///
/// [`Error::Decode`]: a depth picture, a layout that is not known, or sizes that do not fit the
/// message's bytes.
pub fn picture<'m>(kind: Kind, message: &'m Struct) -> Result<Picture<'m>> {
    let data = message.bytes("data")?;
    let fail = |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
    if kind == Kind::CompressedImage {
        // image_transport writes `16UC1; compressedDepth png` and puts a head of 12 bytes before the PNG.
        return match message.text("format") {
            Ok(format) if format.contains("compressedDepth") => {
                Err(fail(format!("`{format}` is a depth picture, and frames need a colour one")))
            }
            _ => Ok(Picture::Compressed { data }),
        };
    }
    let name = message.text("encoding")?;
    let encoding = Encoding::of(name).ok_or_else(|| match name {
        "32FC1" => fail("`32FC1` is a depth picture, and frames need a colour one".to_string()),
        other => fail(format!("pixel encoding `{other}` is not known")),
    })?;
    let size = |field: &str| -> Result<usize> {
        usize::try_from(message.int(field)?)
            .map_err(|_error| fail(format!("`{field}` is negative")))
    };
    let (width, height, row_bytes) = (size("width")?, size("height")?, size("step")?);
    let row_fits = encoding.least_row_bytes(width).is_some_and(|least| least <= row_bytes);
    let fits = encoding.bytes(row_bytes, height).is_some_and(|all| all <= data.len());
    if width == 0 || height == 0 || !row_fits || !fits {
        let what = format!(
            "{width} x {height} pixels of `{name}` in rows of {row_bytes} bytes do not fit {} bytes",
            data.len()
        );
        return Err(fail(what));
    }
    // Foxglove's type has no such field: its 16-bit samples are little-endian.
    let is_big_endian = message.int("is_bigendian").is_ok_and(|flag| flag != 0);
    let endian = if is_big_endian { Endian::Big } else { Endian::Little };
    Ok(Picture::Raw(Pixels { width, height, encoding, row_bytes, endian, data }))
}
