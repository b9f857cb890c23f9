//! Protobuf bytes to values, by the descriptors that the log carries.
//!
//! The wire format of <https://protobuf.dev/programming-guides/encoding/>. Messages are
//! walked here, because pictures and clouds can then stay where they lie and every limit is ours,
//! neither of which a library's dynamic message offers.

use std::{borrow::Cow, ops::Range};

use crate::{
    error::{Error, Result},
    log::{
        descriptors::{Element, Field, MessageType, Schema, bytes_value},
        value::{Endian, Scalar, Struct, Value},
    },
};

/// Deepest nesting of parts that is followed. Real messages stay below 10.
const MAX_DEPTH: usize = 64;

/// Most values in one message, absent ones among them. Bytes and packed numbers of a fixed size
/// count once, since they are not copied.
const MAX_VALUES: usize = 1 << 20;

/// Decode a whole message. Fields that it leaves out have their defaults, and parts that it
/// leaves out are [`Value::Absent`]: not leaving them out is how a writer says that they are zero.
///
/// # Errors
///
/// [`Error::Decode`] with the byte: the message ends early, a field is of another type than its
/// definition says, parts nest more than 64 deep, or there are more than 2^20 values. Lengths in
/// the message are checked against its size before anything is allocated for them.
pub fn decode<'a>(schema: &'a Schema, message: &'a [u8]) -> Result<Struct<'a>> {
    let whole = 0..message.len();
    Decoding { schema, message, values: 0 }.structure(0, &[whole], 0)
}

const VARINT: u64 = 0;
const EIGHT_BYTES: u64 = 1;
const LENGTH: u64 = 2;
const GROUP: u64 = 3;
const END_GROUP: u64 = 4;
const FOUR_BYTES: u64 = 5;

impl Element {
    /// The wire type of one element.
    fn wire_type(self) -> u64 {
        match self {
            Element::Varint(_) | Element::ZigZag(_) => VARINT,
            Element::Fixed(scalar) if scalar.size() == 8 => EIGHT_BYTES,
            Element::Fixed(_) => FOUR_BYTES,
            Element::Text | Element::Bytes | Element::Message(_) => LENGTH,
        }
    }

    fn integer(self, varint: u64) -> i64 {
        match self {
            // Longer numbers than the type lose their upper bits.
            Element::ZigZag(scalar) => {
                let bits = if scalar == Scalar::I32 { varint & 0xffff_ffff } else { varint };
                (bits >> 1) as i64 ^ -((bits & 1) as i64)
            }
            Element::Varint(Scalar::Bool) => i64::from(varint != 0),
            Element::Varint(Scalar::I32) => i64::from(varint as i32),
            Element::Varint(Scalar::U32) => i64::from(varint as u32),
            _ => varint as i64,
        }
    }
}

struct Decoding<'a> {
    schema: &'a Schema,
    message: &'a [u8],
    values: usize,
}

impl<'a> Decoding<'a> {
    fn fail(&self, offset: usize, what: String) -> Error {
        Error::Decode { schema: self.schema.types[0].name.clone(), offset, what }
    }

    fn count(&mut self, values: usize, at: usize) -> Result<()> {
        self.values += values;
        match self.values <= MAX_VALUES {
            true => Ok(()),
            false => Err(self.fail(at, "more values than a message may have".to_string())),
        }
    }

    /// A part of the message. It may come in pieces, which mean what they would mean in a row.
    fn structure(
        &mut self,
        index: usize,
        pieces: &[Range<usize>],
        depth: usize,
    ) -> Result<Struct<'a>> {
        let schema = self.schema;
        let MessageType { name, fields } = &schema.types[index];
        let start = pieces[0].start;
        self.count(fields.len() + 1, start)?;
        if depth > MAX_DEPTH {
            return Err(self.fail(start, format!("parts nest more than {MAX_DEPTH} deep")));
        }
        let mut values: Vec<Value> = fields.iter().map(|field| field.default.clone()).collect();
        let mut inner_pieces: Vec<(usize, usize, Range<usize>)> = Vec::new();
        for piece in pieces {
            let mut at = piece.start;
            while at < piece.end {
                let key_at = at;
                let key = self.varint(&mut at, piece.end)?;
                let wire_type = key & 7;
                let found = u32::try_from(key >> 3)
                    .ok()
                    .and_then(|number| fields.binary_search_by_key(&number, |f| f.number).ok());
                let Some(slot) = found else {
                    self.skip(wire_type, &mut at, piece.end)?;
                    continue;
                };
                let (field, value) = (&fields[slot], &mut values[slot]);
                match field.element {
                    Element::Message(inner) if wire_type == LENGTH => {
                        let range = self.length(&mut at, piece.end)?;
                        match value {
                            Value::List(list) => {
                                list.push(Value::Struct(self.structure(
                                    inner,
                                    &[range],
                                    depth + 1,
                                )?));
                            }
                            _ => {
                                self.count(1, key_at)?;
                                inner_pieces.push((slot, inner, range));
                            }
                        }
                    }
                    element if wire_type == element.wire_type() => {
                        self.element(field, &mut at, piece.end, value)?;
                    }
                    element if wire_type == LENGTH && field.is_list => {
                        let packed = self.length(&mut at, piece.end)?;
                        self.packed(element, packed, value)?;
                    }
                    _ => {
                        let what = format!("`{}` has wire type {wire_type}", field.name);
                        return Err(self.fail(key_at, what));
                    }
                }
            }
        }
        inner_pieces.sort_by_key(|(slot, _, _)| *slot);
        for same in inner_pieces.chunk_by(|a, b| a.0 == b.0) {
            let pieces: Vec<_> = same.iter().map(|(_, _, piece)| piece.clone()).collect();
            let (slot, inner, _) = same[0];
            values[slot] = Value::Struct(self.structure(inner, &pieces, depth + 1)?);
        }
        let fields = fields.iter().map(|field| field.name.as_str()).zip(values).collect();
        Ok(Struct { name, fields })
    }

    /// One element, which is no message, at its own key.
    fn element(
        &mut self,
        field: &Field,
        at: &mut usize,
        end: usize,
        value: &mut Value<'a>,
    ) -> Result<()> {
        let key_end = *at;
        let one = match field.element {
            Element::Fixed(scalar) => {
                let bytes = self.take(scalar.size() as u64, at, end)?;
                if let Value::Numbers(numbers) = value {
                    extend(&mut numbers.bytes, bytes);
                    return Ok(());
                }
                match scalar {
                    Scalar::F32 | Scalar::F64 => Value::Float(scalar.read(bytes, Endian::Little)),
                    Scalar::I64 | Scalar::U64 => {
                        let mut raw = [0; 8];
                        raw.copy_from_slice(bytes);
                        Value::Int(i64::from_le_bytes(raw))
                    }
                    _ => Value::Int(scalar.read(bytes, Endian::Little) as i64),
                }
            }
            element @ (Element::Varint(_) | Element::ZigZag(_)) => {
                let integer = element.integer(self.varint(at, end)?);
                if let Value::Numbers(numbers) = value {
                    self.count(1, key_end)?;
                    extend_owned(&mut numbers.bytes, integer);
                    return Ok(());
                }
                Value::Int(integer)
            }
            Element::Text => {
                let range = self.length(at, end)?;
                Value::Text(String::from_utf8_lossy(&self.message[range]))
            }
            Element::Bytes | Element::Message(_) => {
                let range = self.length(at, end)?;
                bytes_value(Cow::Borrowed(&self.message[range]))
            }
        };
        match value {
            Value::List(list) => {
                self.count(1, key_end)?;
                list.push(one);
            }
            _ => *value = one,
        }
        Ok(())
    }

    /// Many numbers behind one key.
    fn packed(
        &mut self,
        element: Element,
        packed: Range<usize>,
        value: &mut Value<'a>,
    ) -> Result<()> {
        let Value::Numbers(numbers) = value else {
            return Err(self.fail(packed.start, "what is no number is packed".to_string()));
        };
        if let Element::Fixed(scalar) = element {
            if !packed.len().is_multiple_of(scalar.size()) {
                let what = format!("{} bytes of {}-byte numbers", packed.len(), scalar.size());
                return Err(self.fail(packed.start, what));
            }
            extend(&mut numbers.bytes, &self.message[packed]);
            return Ok(());
        }
        let mut at = packed.start;
        while at < packed.end {
            self.count(1, at)?;
            let integer = element.integer(self.varint(&mut at, packed.end)?);
            extend_owned(&mut numbers.bytes, integer);
        }
        Ok(())
    }

    /// Leave out a field that the definition does not have, with all that is in it.
    fn skip(&self, wire_type: u64, at: &mut usize, end: usize) -> Result<()> {
        let mut groups = 0_usize;
        let mut wire_type = wire_type;
        loop {
            let len = match wire_type {
                VARINT => {
                    self.varint(at, end)?;
                    0
                }
                LENGTH => self.varint(at, end)?,
                EIGHT_BYTES => 8,
                FOUR_BYTES => 4,
                GROUP => {
                    groups += 1;
                    0
                }
                END_GROUP if groups > 0 => {
                    groups -= 1;
                    0
                }
                _ => return Err(self.fail(*at, format!("wire type {wire_type}"))),
            };
            self.take(len, at, end)?;
            if groups == 0 {
                return Ok(());
            }
            wire_type = self.varint(at, end)? & 7;
        }
    }

    fn varint(&self, at: &mut usize, end: usize) -> Result<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.take(1, at, end)?[0];
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Ok(value);
            }
        }
        Err(self.fail(*at, "a number of more than 10 bytes".to_string()))
    }

    /// Where the bytes lie whose number comes first.
    fn length(&self, at: &mut usize, end: usize) -> Result<Range<usize>> {
        let len = self.varint(at, end)?;
        let start = *at;
        self.take(len, at, end)?;
        Ok(start..*at)
    }

    fn take(&self, len: u64, at: &mut usize, end: usize) -> Result<&'a [u8]> {
        let left = end - *at;
        if len > left as u64 {
            return Err(self.fail(*at, format!("{len} bytes are needed and {left} are left")));
        }
        let start = *at;
        *at += len as usize;
        Ok(&self.message[start..*at])
    }
}

/// Numbers usually lie in one place, and are copied only where they do not.
fn extend<'a>(all: &mut Cow<'a, [u8]>, more: &'a [u8]) {
    match all.is_empty() {
        true => *all = Cow::Borrowed(more),
        false => all.to_mut().extend_from_slice(more),
    }
}

fn extend_owned(all: &mut Cow<[u8]>, integer: i64) {
    all.to_mut().extend_from_slice(&integer.to_le_bytes());
}
