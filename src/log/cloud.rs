//! Point clouds of any layout, read where they lie.
//!
//! `sensor_msgs/PointCloud2`: points of `point_step` bytes in rows of `row_step`, each field at
//! its own offset with its own type. `foxglove.PointCloud`: points of `point_stride` bytes in one
//! row, little-endian, placed in their frame by a pose. Nothing is assumed of the order, the
//! padding or the types.

use glam::DVec3;

use crate::{
    error::{Error, Result},
    log::{
        signals::{self, Pose},
        value::{Endian, Scalar, Struct, Value},
    },
};

/// A field of every point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CloudField {
    pub name: String,
    /// Bytes from the start of the point.
    pub offset: usize,
    pub scalar: Scalar,
}

/// A cloud as it lies in its message.
#[derive(Clone, Debug)]
pub struct Cloud<'a> {
    pub fields: Vec<CloudField>,
    /// Where its points sit in its frame, if they are not in that frame already.
    pub frame_from_points: Option<Pose>,
    data: &'a [u8],
    endian: Endian,
    width: usize,
    height: usize,
    point_step: usize,
    row_step: usize,
}

impl<'a> Cloud<'a> {
    /// Read the layout of a `sensor_msgs/PointCloud2` or a `foxglove.PointCloud`.
    ///
    /// # Errors
    ///
    /// [`Error::Decode`] if a field does not lie inside a point, a type is unknown, the data is
    /// shorter than width, height and steps say, or it ends inside a point.
    pub fn new(message: &'a Struct) -> Result<Cloud<'a>> {
        let fail =
            |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
        let size = |field: &str| -> Result<usize> {
            usize::try_from(message.int(field)?)
                .map_err(|_error| fail(format!("`{field}` is negative")))
        };
        let data = message.bytes("data")?;
        if message.get("point_stride").is_some() {
            let point_step = size("point_stride")?;
            if point_step == 0 || !data.len().is_multiple_of(point_step) {
                let bytes = data.len();
                return Err(fail(format!("{bytes} bytes are no points of {point_step} bytes")));
            }
            let pose = match message.get("pose") {
                None | Some(Value::Absent) => None,
                Some(_) => Some(signals::pose(message.part("pose")?)?),
            };
            return Ok(Cloud {
                fields: fields(message, point_step, "type", foxglove_scalar)?,
                frame_from_points: pose,
                data,
                endian: Endian::Little,
                width: data.len() / point_step,
                height: 1,
                point_step,
                row_step: data.len(),
            });
        }
        let endian = if message.int("is_bigendian")? == 0 { Endian::Little } else { Endian::Big };
        let (width, height) = (size("width")?, size("height")?);
        let (point_step, row_step) = (size("point_step")?, size("row_step")?);
        let fields = fields(message, point_step, "datatype", scalar)?;

        let rows_end = height.saturating_sub(1).checked_mul(row_step);
        let last_row = width.checked_mul(point_step);
        let needed = rows_end.zip(last_row).and_then(|(rows, last)| rows.checked_add(last));
        if width > 0 && height > 0 && needed.is_none_or(|needed| needed > data.len()) {
            let what = format!(
                "{width} x {height} points of {point_step} bytes do not fit {} bytes of data",
                data.len()
            );
            return Err(fail(what));
        }
        // Rows that lie in each other would be billions of points in a few bytes.
        if height > 1 && last_row.is_none_or(|row| row > row_step) {
            let what = format!("{height} rows of {width} points in steps of {row_step} bytes");
            return Err(fail(what));
        }
        let height = if width == 0 { 0 } else { height };
        let frame_from_points = None;
        Ok(Cloud { fields, frame_from_points, data, endian, width, height, point_step, row_step })
    }

    /// The field of that name, upper or lower case.
    pub fn field(&self, name: &str) -> Option<&CloudField> {
        self.fields.iter().find(|field| field.name.eq_ignore_ascii_case(name))
    }

    /// Fields x, y and z.
    ///
    /// # Errors
    ///
    /// [`Error::Decode`] if the cloud has no such fields.
    pub fn xyz(&self) -> Result<[&CloudField; 3]> {
        match (self.field("x"), self.field("y"), self.field("z")) {
            (Some(x), Some(y), Some(z)) => Ok([x, y, z]),
            _ => {
                let have: Vec<_> = self.fields.iter().map(|field| field.name.as_str()).collect();
                let what = format!("no x, y, z; its fields are {}", have.join(", "));
                Err(Error::Decode { schema: "a point cloud".into(), offset: 0, what })
            }
        }
    }

    /// Where the points are by fields x, y and z, in the order of the message.
    pub fn positions(&self, [x, y, z]: [&CloudField; 3]) -> impl Iterator<Item = DVec3> {
        let is_f32 = |field: &CloudField| field.scalar == Scalar::F32;
        let is_usual = is_f32(x) && is_f32(y) && is_f32(z) && self.endian == Endian::Little;
        let offsets = [x, y, z].map(|field| field.offset);
        let fields = [x, y, z].map(Clone::clone);
        self.points().map(move |point| match is_usual {
            // Tens of thousands of times, so without a look at each number's type.
            true => DVec3::from_array(offsets.map(|offset| point.f32(offset))),
            false => DVec3::from_array([0, 1, 2].map(|axis: usize| point.get(&fields[axis]))),
        })
    }

    /// Points in the order of the message.
    pub fn points(&self) -> impl Iterator<Item = CloudPoint<'a>> {
        let (data, endian) = (self.data, self.endian);
        let (width, point_step, row_step) = (self.width, self.point_step, self.row_step);
        (0..self.height).flat_map(move |row| {
            (0..width).map(move |column| {
                let start = row * row_step + column * point_step;
                CloudPoint { bytes: &data[start..start + point_step], endian }
            })
        })
    }
}

/// One point, not yet decoded.
#[derive(Clone, Copy, Debug)]
pub struct CloudPoint<'a> {
    bytes: &'a [u8],
    endian: Endian,
}

impl CloudPoint<'_> {
    #[inline(always)]
    fn f32(&self, offset: usize) -> f64 {
        let bytes = self.bytes[offset..].first_chunk().copied().unwrap_or_default();
        f64::from(f32::from_le_bytes(bytes))
    }

    /// The value of a field of the same cloud.
    pub fn get(&self, field: &CloudField) -> f64 {
        field.scalar.read(&self.bytes[field.offset..], self.endian)
    }
}

/// The fields of every point; `type_field` names the number that stands for the type.
fn fields(
    message: &Struct,
    point_step: usize,
    type_field: &str,
    scalar: fn(i64) -> Option<Scalar>,
) -> Result<Vec<CloudField>> {
    let fail = |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
    let field = |part: &Struct| {
        let (name, datatype) = (part.text("name")?.to_string(), part.int(type_field)?);
        let scalar = scalar(datatype)
            .ok_or_else(|| fail(format!("field `{name}` has unknown type {datatype}")))?;
        let offset = usize::try_from(part.int("offset")?)
            .map_err(|_error| fail(format!("field `{name}` has a negative offset")))?;
        if offset.checked_add(scalar.size()).is_none_or(|end| end > point_step) {
            return Err(fail(format!("field `{name}` does not lie inside a point")));
        }
        Ok(CloudField { name, offset, scalar })
    };
    message.parts("fields")?.map(field).collect()
}

/// `foxglove.PackedElementField.NumericType`.
fn foxglove_scalar(datatype: i64) -> Option<Scalar> {
    Some(match datatype {
        1 => Scalar::U8,
        2 => Scalar::I8,
        3 => Scalar::U16,
        4 => Scalar::I16,
        5 => Scalar::U32,
        6 => Scalar::I32,
        7 => Scalar::F32,
        8 => Scalar::F64,
        _ => return None,
    })
}

/// `sensor_msgs/PointField` datatypes.
fn scalar(datatype: i64) -> Option<Scalar> {
    Some(match datatype {
        1 => Scalar::I8,
        2 => Scalar::U8,
        3 => Scalar::I16,
        4 => Scalar::U16,
        5 => Scalar::I32,
        6 => Scalar::U32,
        7 => Scalar::F32,
        8 => Scalar::F64,
        _ => return None,
    })
}
