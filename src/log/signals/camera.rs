//! Pictures and the cameras that took them.

use crate::{
    error::{Error, Result},
    log::{signals::kind::Kind, value::Struct},
    projection::{Camera, Distortion},
};

/// A picture as it lies in its message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Picture<'a> {
    /// JPEG, PNG ...: `format` as the message says it.
    Compressed { data: &'a [u8] },
    /// Rows of pixels.
    Raw { width: usize, height: usize, encoding: Encoding, row_bytes: usize, data: &'a [u8] },
}

/// Pixel layouts of `sensor_msgs/Image`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Rgb8,
    Bgr8,
    Rgba8,
    Bgra8,
    Mono8,
}

impl Encoding {
    pub fn pixel_bytes(self) -> usize {
        match self {
            Encoding::Mono8 => 1,
            Encoding::Rgb8 | Encoding::Bgr8 => 3,
            Encoding::Rgba8 | Encoding::Bgra8 => 4,
        }
    }
}

/// `sensor_msgs/CameraInfo` or `foxglove.CameraCalibration`; the intrinsics are those of the picture of its width and height.
pub fn camera_info(message: &Struct) -> Result<Camera> {
    // ROS 2 writes k and d, ROS 1 and Foxglove K and D.
    let numbers = |lower: &str, upper: &str| -> Result<Vec<f64>> {
        Ok(message.numbers(lower).or_else(|_| message.numbers(upper))?.iter().collect())
    };
    let (k, d) = (numbers("k", "K")?, numbers("d", "D")?);
    let fail = |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
    let model = message.text("distortion_model")?;
    let distortion = if d.iter().all(|coefficient| *coefficient == 0.0) {
        Distortion::None
    } else {
        let wrong = |_| fail(format!("{} coefficients for `{model}`", d.len()));
        match model {
            "plumb_bob" => Distortion::PlumbBob(d.clone().try_into().map_err(wrong)?),
            "rational_polynomial" => {
                Distortion::RationalPolynomial(d.clone().try_into().map_err(wrong)?)
            }
            "equidistant" | "fisheye" => {
                Distortion::Equidistant(d.clone().try_into().map_err(wrong)?)
            }
            _ => return Err(fail(format!("distortion model `{model}` is not known"))),
        }
    };
    let size = |field: &str| -> Result<usize> {
        usize::try_from(message.int(field)?)
            .map_err(|_error| fail(format!("`{field}` is negative")))
    };
    match k[..] {
        [fx, _, cx, _, fy, cy, ..] if fx > 0.0 && fy > 0.0 => Ok(Camera {
            width: size("width")?,
            height: size("height")?,
            fx,
            fy,
            cx,
            cy,
            distortion,
        }),
        _ => Err(fail("an uncalibrated camera: its focal length is 0".to_string())),
    }
}

/// `sensor_msgs/CompressedImage`, `sensor_msgs/Image` or `foxglove.RawImage`.
pub fn picture<'m>(kind: Kind, message: &'m Struct) -> Result<Picture<'m>> {
    let data = message.bytes("data")?;
    if kind == Kind::CompressedImage {
        return Ok(Picture::Compressed { data });
    }
    let fail = |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
    let encoding = match message.text("encoding")? {
        "rgb8" | "8UC3" => Encoding::Rgb8,
        "bgr8" => Encoding::Bgr8,
        "rgba8" => Encoding::Rgba8,
        "bgra8" => Encoding::Bgra8,
        "mono8" | "8UC1" => Encoding::Mono8,
        other => return Err(fail(format!("pixel encoding `{other}` is not known"))),
    };
    let size = |field: &str| -> Result<usize> {
        usize::try_from(message.int(field)?)
            .map_err(|_error| fail(format!("`{field}` is negative")))
    };
    let (width, height, row_bytes) = (size("width")?, size("height")?, size("step")?);
    let row_fits = width.checked_mul(encoding.pixel_bytes()).is_some_and(|row| row <= row_bytes);
    let fits = row_bytes.checked_mul(height).is_some_and(|all| all <= data.len());
    if width == 0 || height == 0 || !row_fits || !fits {
        let what = format!(
            "{width} x {height} pixels in rows of {row_bytes} bytes do not fit {} bytes",
            data.len()
        );
        return Err(fail(what));
    }
    Ok(Picture::Raw { width, height, encoding, row_bytes, data })
}
