//! What a decoded message holds, whatever its encoding was.
//!
//! Arrays of numbers and bytes borrow from the message where it has them as they are, so a picture
//! or a cloud is not copied to be looked at.

use std::borrow::Cow;

use crate::error::{Error, Result};

/// A number type of the wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Bytes on the wire.
    pub fn size(self) -> usize {
        match self {
            Scalar::Bool | Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::I64 | Scalar::U64 | Scalar::F64 => 8,
        }
    }

    /// The number in the first [`size`](Scalar::size) bytes, as f64 (exact up to 2^53).
    #[inline]
    pub fn read(self, bytes: &[u8], endian: Endian) -> f64 {
        macro_rules! number {
            ($t:ty) => {{
                let mut raw = [0; size_of::<$t>()];
                raw.copy_from_slice(&bytes[..size_of::<$t>()]);
                match endian {
                    Endian::Little => <$t>::from_le_bytes(raw),
                    Endian::Big => <$t>::from_be_bytes(raw),
                }
            }};
        }
        match self {
            Scalar::Bool | Scalar::U8 => f64::from(bytes[0]),
            Scalar::I8 => f64::from(bytes[0] as i8),
            Scalar::I16 => f64::from(number!(i16)),
            Scalar::U16 => f64::from(number!(u16)),
            Scalar::I32 => f64::from(number!(i32)),
            Scalar::U32 => f64::from(number!(u32)),
            Scalar::I64 => number!(i64) as f64,
            Scalar::U64 => number!(u64) as f64,
            Scalar::F32 => f64::from(number!(f32)),
            Scalar::F64 => number!(f64),
        }
    }
}

/// Order of bytes in a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Endian {
    Little,
    Big,
}

/// An array of numbers as it lies in the message, or as it would lie there if it is text.
#[derive(Clone, Debug, PartialEq)]
pub struct Numbers<'a> {
    pub bytes: Cow<'a, [u8]>,
    pub scalar: Scalar,
    pub endian: Endian,
}

impl<'a> Numbers<'a> {
    pub fn len(&self) -> usize {
        self.bytes.len() / self.scalar.size()
    }

    pub fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub fn iter(&self) -> impl Iterator<Item = f64> {
        let (scalar, endian) = (self.scalar, self.endian);
        self.bytes.chunks_exact(scalar.size()).map(move |bytes| scalar.read(bytes, endian))
    }
}

/// A decoded value. Integers beyond 2^53 keep their bits in [`Value::Int`].
#[derive(Clone, Debug, PartialEq)]
pub enum Value<'a> {
    Int(i64),
    Float(f64),
    Text(Cow<'a, str>),
    Numbers(Numbers<'a>),
    List(Vec<Value<'a>>),
    Struct(Struct<'a>),
    /// A part that the definition has and the message leaves out.
    Absent,
}

/// A decoded message or part of one.
#[derive(Clone, Debug, PartialEq)]
pub struct Struct<'a> {
    /// For example `geometry_msgs/Point`; used in errors.
    pub name: &'a str,
    pub fields: Vec<(&'a str, Value<'a>)>,
}

impl<'a> Struct<'a> {
    /// The field of that name.
    pub fn get(&self, field: &str) -> Option<&Value<'a>> {
        self.fields.iter().find(|(name, _)| *name == field).map(|(_, value)| value)
    }

    fn expect(&self, field: &str, kind: &str) -> Error {
        let have: Vec<_> = self.fields.iter().map(|(name, _)| *name).collect();
        Error::Decode {
            schema: self.name.to_string(),
            offset: 0,
            what: format!("no {kind} `{field}`; its fields are {}", have.join(", ")),
        }
    }

    /// A number, integer or not.
    pub fn number(&self, field: &str) -> Result<f64> {
        match self.get(field) {
            Some(Value::Int(value)) => Ok(*value as f64),
            Some(Value::Float(value)) => Ok(*value),
            _ => Err(self.expect(field, "number")),
        }
    }

    /// An integer.
    pub fn int(&self, field: &str) -> Result<i64> {
        match self.get(field) {
            Some(Value::Int(value)) => Ok(*value),
            _ => Err(self.expect(field, "integer")),
        }
    }

    /// A string.
    pub fn text(&self, field: &str) -> Result<&str> {
        match self.get(field) {
            Some(Value::Text(text)) => Ok(text),
            _ => Err(self.expect(field, "string")),
        }
    }

    /// A part.
    pub fn part(&self, field: &str) -> Result<&Struct<'a>> {
        match self.get(field) {
            Some(Value::Struct(part)) => Ok(part),
            _ => Err(self.expect(field, "part")),
        }
    }

    /// A part; `None` if the message leaves it out although its definition has it.
    pub fn optional_part(&self, field: &str) -> Result<Option<&Struct<'a>>> {
        match self.get(field) {
            Some(Value::Absent) => Ok(None),
            _ => self.part(field).map(Some),
        }
    }

    /// An array of numbers.
    pub fn numbers(&self, field: &str) -> Result<Numbers<'_>> {
        match self.get(field) {
            Some(Value::Numbers(Numbers { bytes, scalar, endian })) => {
                let (bytes, scalar, endian) = (Cow::Borrowed(&**bytes), *scalar, *endian);
                Ok(Numbers { bytes, scalar, endian })
            }
            // Text says of an empty array not what it would hold.
            Some(Value::List(list)) if list.is_empty() => {
                let (bytes, scalar) = (Cow::Borrowed(&[][..]), Scalar::F64);
                Ok(Numbers { bytes, scalar, endian: Endian::Little })
            }
            _ => Err(self.expect(field, "array of numbers")),
        }
    }

    /// An array of bytes.
    pub fn bytes(&self, field: &str) -> Result<&[u8]> {
        match self.get(field) {
            Some(Value::Numbers(numbers)) if numbers.scalar.size() == 1 => Ok(&numbers.bytes),
            _ => Err(self.expect(field, "array of bytes")),
        }
    }

    /// A list of parts.
    pub fn parts(&self, field: &str) -> Result<impl Iterator<Item = &Struct<'a>>> {
        match self.get(field) {
            Some(Value::List(list)) => Ok(list.iter().filter_map(|value| match value {
                Value::Struct(part) => Some(part),
                _ => None,
            })),
            _ => Err(self.expect(field, "list")),
        }
    }
}
