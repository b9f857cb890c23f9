//! Bytes to values, for encodings that write the fields of a definition one after another.
//!
//! CDR and ROS 1's serialisation are the same walk through a definition and differ in padding and
//! in two details; a [`Layout`] says which. Nothing in such a message names its fields, so a
//! length that lies is found by running out of bytes, and everything else is believed.

use std::borrow::Cow;

use crate::{
    error::{Error, Result},
    log::{
        schema::{Arity, Element, Field, Schema},
        value::{Endian, Numbers, Scalar, Struct, Value},
    },
};

/// Most elements of a list of strings or parts in one message: a thousand times a busy radar scan.
const MAX_LIST_ELEMENTS: usize = 1 << 20;

/// Most parts in one message. A part may take no byte, so that the message's size is no bound.
const MAX_PARTS: usize = 1 << 20;

/// What encodings of this family do differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Bytes before the first field; positions are counted from behind them.
    pub head_bytes: usize,
    pub endian: Endian,
    /// Numbers begin at multiples of their size, or of this if it is less.
    pub max_align: usize,
    /// A zero byte ends a string and is counted in its length.
    pub has_nul: bool,
    /// What a type without fields takes.
    pub empty_type_bytes: usize,
}

/// Decode a whole message.
///
/// # Errors
///
/// [`Error::Decode`] with the byte: a message that is shorter than its definition needs. Lengths
/// in the message are checked against its size before anything is allocated for them.
pub fn decode<'a>(layout: Layout, schema: &'a Schema, message: &'a [u8]) -> Result<Struct<'a>> {
    Cursor::new(layout, schema, message).structure(0)
}

/// Decode the first field of a message alone: its header, where it has one.
///
/// # Errors
///
/// As [`decode`]; also if the message type has no fields.
pub fn decode_first_field<'a>(
    layout: Layout,
    schema: &'a Schema,
    message: &'a [u8],
) -> Result<Value<'a>> {
    let mut cursor = Cursor::new(layout, schema, message);
    match schema.types[0].fields.first() {
        Some(field) => cursor.field(field),
        None => Err(cursor.fail("the message has no fields")),
    }
}

struct Cursor<'a> {
    layout: Layout,
    schema: &'a Schema,
    /// The message behind its head.
    data: &'a [u8],
    at: usize,
    parts: usize,
}

impl<'a> Cursor<'a> {
    fn new(layout: Layout, schema: &'a Schema, message: &'a [u8]) -> Self {
        let data = message.get(layout.head_bytes..).unwrap_or_default();
        Cursor { layout, schema, data, at: 0, parts: 0 }
    }

    fn fail(&self, what: &str) -> Error {
        Error::Decode {
            schema: self.schema.types[0].name.clone(),
            offset: self.layout.head_bytes + self.at,
            what: what.to_string(),
        }
    }

    fn structure(&mut self, index: usize) -> Result<Struct<'a>> {
        self.parts += 1;
        if self.parts > MAX_PARTS {
            return Err(self.fail("more parts than a message may have"));
        }
        let schema = self.schema;
        let definition = &schema.types[index];
        if definition.fields.is_empty() {
            self.take(self.layout.empty_type_bytes)?;
        }
        let mut fields = Vec::with_capacity(definition.fields.len());
        for field in &definition.fields {
            fields.push((field.name.as_str(), self.field(field)?));
        }
        Ok(Struct { name: &definition.name, fields })
    }

    fn field(&mut self, field: &Field) -> Result<Value<'a>> {
        let count = match field.arity {
            Arity::One => return self.one(field.element),
            Arity::Array(count) => count,
            Arity::Sequence => self.scalar(Scalar::U32)? as usize,
        };
        if let Element::Scalar(scalar) = field.element {
            // An empty sequence is followed by no padding for its elements.
            if count > 0 {
                self.align(scalar.size());
            }
            let len = count.checked_mul(scalar.size());
            let bytes = match len {
                Some(len) => self.take(len)?,
                None => return Err(self.fail("an array longer than the memory")),
            };
            let bytes = Cow::Borrowed(bytes);
            return Ok(Value::Numbers(Numbers { bytes, scalar, endian: self.layout.endian }));
        }
        let left = self.data.len().saturating_sub(self.at);
        let most = match field.element {
            // Parts that take no byte are bounded by their number alone.
            Element::Struct(_) if self.layout.empty_type_bytes == 0 => MAX_LIST_ELEMENTS,
            _ => MAX_LIST_ELEMENTS.min(left),
        };
        if count > most {
            let what = format!("{count} elements of `{}` in too few bytes", field.name);
            return Err(self.fail(&what));
        }
        (0..count).map(|_| self.one(field.element)).collect::<Result<_>>().map(Value::List)
    }

    fn one(&mut self, element: Element) -> Result<Value<'a>> {
        match element {
            Element::Scalar(scalar @ (Scalar::F32 | Scalar::F64)) => {
                Ok(Value::Float(self.scalar(scalar)?))
            }
            Element::Scalar(scalar @ (Scalar::I64 | Scalar::U64)) => {
                self.align(scalar.size());
                let mut raw = [0; 8];
                raw.copy_from_slice(self.take(8)?);
                Ok(Value::Int(match self.layout.endian {
                    Endian::Little => i64::from_le_bytes(raw),
                    Endian::Big => i64::from_be_bytes(raw),
                }))
            }
            Element::Scalar(scalar) => Ok(Value::Int(self.scalar(scalar)? as i64)),
            Element::String => {
                let len = self.scalar(Scalar::U32)? as usize;
                let bytes = self.take(len)?;
                let ended = bytes.strip_suffix(&[0]).filter(|_| self.layout.has_nul);
                let text = ended.unwrap_or(bytes);
                Ok(Value::Text(String::from_utf8_lossy(text)))
            }
            Element::WideString => {
                let units = self.scalar(Scalar::U32)? as usize;
                let bytes = match units.checked_mul(2) {
                    Some(len) => self.take(len)?,
                    None => return Err(self.fail("a string longer than the memory")),
                };
                let bytes = Cow::Borrowed(bytes);
                let numbers = Numbers { bytes, scalar: Scalar::U16, endian: self.layout.endian };
                let units: Vec<u16> = numbers.iter().map(|unit| unit as u16).collect();
                Ok(Value::Text(Cow::Owned(String::from_utf16_lossy(&units))))
            }
            Element::Struct(index) => self.structure(index).map(Value::Struct),
        }
    }

    fn scalar(&mut self, scalar: Scalar) -> Result<f64> {
        self.align(scalar.size());
        let bytes = self.take(scalar.size())?;
        Ok(scalar.read(bytes, self.layout.endian))
    }

    fn align(&mut self, size: usize) {
        self.at = self.at.next_multiple_of(size.min(self.layout.max_align));
    }

    fn take(&mut self, len: usize) -> Result<&'a [u8]> {
        let bytes = self.at.checked_add(len).and_then(|end| self.data.get(self.at..end));
        match bytes {
            Some(bytes) => {
                self.at += len;
                Ok(bytes)
            }
            None => {
                let left = self.data.len().saturating_sub(self.at);
                Err(self.fail(&format!("{len} bytes are needed and {left} are left")))
            }
        }
    }
}
