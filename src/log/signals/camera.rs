//! Cameras as they were calibrated.

use crate::{
    error::{Error, Result},
    log::value::Struct,
    projection::{Camera, Distortion},
};

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
