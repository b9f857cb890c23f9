//! Point clouds of any layout, read where they lie.
//!
//! `sensor_msgs/PointCloud2`: points of `point_step` bytes in rows of `row_step`, each field at
//! its own offset with its own type. Nothing is assumed of the order, the padding or the types.

use crate::{
    error::{Error, Result},
    log::value::{Endian, Scalar, Struct},
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
    data: &'a [u8],
    endian: Endian,
    width: usize,
    height: usize,
    point_step: usize,
    row_step: usize,
}

impl<'a> Cloud<'a> {
    /// Read the layout of a `sensor_msgs/PointCloud2`.
    ///
    /// # Errors
    ///
    /// [`Error::Decode`] if a field does not lie inside a point, a type is unknown, or the data
    /// is shorter than width, height and steps say.
    pub fn new(message: &Struct<'a>) -> Result<Cloud<'a>> {
        let fail =
            |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
        let size = |field: &str| -> Result<usize> {
            usize::try_from(message.int(field)?)
                .map_err(|_error| fail(format!("`{field}` is negative")))
        };
        let endian = if message.int("is_bigendian")? == 0 { Endian::Little } else { Endian::Big };
        let (width, height) = (size("width")?, size("height")?);
        let (point_step, row_step) = (size("point_step")?, size("row_step")?);
        let data = message.bytes("data")?;

        let mut fields = Vec::new();
        for part in message.parts("fields")? {
            let (name, datatype) = (part.text("name")?.to_string(), part.int("datatype")?);
            let scalar = scalar(datatype)
                .ok_or_else(|| fail(format!("field `{name}` has unknown type {datatype}")))?;
            let offset = usize::try_from(part.int("offset")?)
                .map_err(|_error| fail(format!("field `{name}` has a negative offset")))?;
            if offset.checked_add(scalar.size()).is_none_or(|end| end > point_step) {
                return Err(fail(format!("field `{name}` does not lie inside a point")));
            }
            fields.push(CloudField { name, offset, scalar });
        }

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
        Ok(Cloud { fields, data, endian, width, height, point_step, row_step })
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
                Err(Error::Decode { schema: "sensor_msgs/PointCloud2".into(), offset: 0, what })
            }
        }
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
    /// The value of a field of the same cloud.
    pub fn get(&self, field: &CloudField) -> f64 {
        field.scalar.read(&self.bytes[field.offset..], self.endian)
    }
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
