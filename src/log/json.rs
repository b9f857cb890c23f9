//! JSON text to values.
//!
//! MCAP's profile: the messages are UTF-8 JSON and the schema, if there is one, is a JSON Schema,
//! <https://mcap.dev/spec/registry#jsonschema>. A schema is asked for one thing only: which
//! strings are bytes in base64 (`contentEncoding`, JSON Schema 2020-12 section 8.3 of its
//! validation part). Types come from the messages themselves.

use std::{borrow::Cow, cell::Cell, collections::BTreeMap, fmt};

use base64::{Engine, engine::general_purpose};
use serde::de::{self, DeserializeSeed, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::{
    error::{Error, Result},
    log::value::{Endian, Numbers, Scalar, Struct, Value},
};

/// Most values in one message. Nesting is bounded by the parser, at 128.
const MAX_VALUES: usize = 1 << 20;

/// Integers up to here are exact in a float.
const MAX_EXACT: f64 = 9_007_199_254_740_992.0;

/// A field of this name holds bytes in every message that pmp reads, whatever its schema says.
const BYTES_FIELD: &str = "data";

/// Padding is left out by some writers.
const BASE64: general_purpose::GeneralPurpose = general_purpose::GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    general_purpose::GeneralPurposeConfig::new()
        .with_decode_padding_mode(base64::engine::DecodePaddingMode::Indifferent),
);

/// What is known of a message type.
#[derive(Clone, Debug)]
pub struct Schema {
    name: String,
    root: Node,
}

/// What a schema says of a place in the messages.
#[derive(Clone, Debug, Default)]
struct Node {
    is_base64: bool,
    fields: BTreeMap<String, Node>,
    items: Option<Box<Node>>,
}

/// Read a schema; an empty one says nothing.
///
/// # Errors
///
/// A sentence, if it is no JSON.
pub fn parse(name: &str, schema: &[u8]) -> Result<Schema, String> {
    let root = match schema.trim_ascii().is_empty() {
        true => Node::default(),
        false => Node::new(
            &serde_json::from_slice(schema)
                .map_err(|error| format!("its definition is no JSON: {error}"))?,
        ),
    };
    Ok(Schema { name: name.to_string(), root })
}

impl Node {
    fn new(schema: &serde_json::Value) -> Node {
        let properties = schema["properties"].as_object().into_iter().flatten();
        Node {
            is_base64: schema["contentEncoding"] == "base64",
            fields: properties.map(|(name, part)| (name.clone(), Node::new(part))).collect(),
            items: schema.get("items").map(|part| Box::new(Node::new(part))),
        }
    }
}

/// Decode a message: whole, or those of its fields alone that `only` names.
///
/// # Errors
///
/// [`Error::Decode`] with the byte: text that is no JSON object, nests more than 128 deep, has more
/// than 2^20 values, or is not the base64 that its schema says.
pub fn decode<'a>(
    schema: &'a Schema,
    message: &'a [u8],
    only: Option<&[&str]>,
) -> Result<Struct<'a>> {
    let values = Cell::new(0);
    let place = Place { name: &schema.name, node: Some(&schema.root), key: "", values: &values };
    let mut text = serde_json::Deserializer::from_slice(message);
    let value = Reading { place, only }.deserialize(&mut text).and_then(|value| {
        text.end()?;
        match value {
            Value::Struct(fields) => Ok(fields),
            _ => Err(de::Error::custom("the message is no object")),
        }
    });
    value.map_err(|error| {
        let lines = message.split(|byte| *byte == b'\n').take(error.line().saturating_sub(1));
        let before: usize = lines.map(|line| line.len() + 1).sum();
        let (schema, offset) = (schema.name.clone(), before + error.column());
        Error::Decode { schema, offset, what: error.to_string() }
    })
}

/// A place in a message.
#[derive(Clone, Copy)]
struct Place<'a, 'c> {
    /// Of the message type.
    name: &'a str,
    node: Option<&'a Node>,
    key: &'a str,
    values: &'c Cell<usize>,
}

struct Reading<'a, 'c> {
    place: Place<'a, 'c>,
    only: Option<&'c [&'c str]>,
}

impl<'a> DeserializeSeed<'a> for Reading<'a, '_> {
    type Value = Value<'a>;

    fn deserialize<D: de::Deserializer<'a>>(self, text: D) -> Result<Value<'a>, D::Error> {
        self.place.count(1)?;
        text.deserialize_any(self)
    }
}

impl<'a> Visitor<'a> for Reading<'a, '_> {
    type Value = Value<'a>;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a JSON value")
    }

    fn visit_unit<E: de::Error>(self) -> Result<Value<'a>, E> {
        Ok(Value::Absent)
    }

    fn visit_bool<E: de::Error>(self, value: bool) -> Result<Value<'a>, E> {
        Ok(Value::Int(i64::from(value)))
    }

    fn visit_i64<E: de::Error>(self, value: i64) -> Result<Value<'a>, E> {
        Ok(Value::Int(value))
    }

    fn visit_u64<E: de::Error>(self, value: u64) -> Result<Value<'a>, E> {
        Ok(Value::Int(value as i64))
    }

    fn visit_f64<E: de::Error>(self, value: f64) -> Result<Value<'a>, E> {
        // Some writers put a point behind every number.
        let is_integer = value.fract() == 0.0 && value.abs() < MAX_EXACT;
        Ok(if is_integer { Value::Int(value as i64) } else { Value::Float(value) })
    }

    fn visit_borrowed_str<E: de::Error>(self, text: &'a str) -> Result<Value<'a>, E> {
        self.place.text(Cow::Borrowed(text))
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<Value<'a>, E> {
        self.place.text(Cow::Owned(text.to_string()))
    }

    fn visit_seq<A: SeqAccess<'a>>(self, mut items: A) -> Result<Value<'a>, A::Error> {
        let node = self.place.node.and_then(|node| node.items.as_deref());
        let place = Place { node, key: "", ..self.place };
        let mut bytes = Vec::new();
        let mut list = Vec::new();
        while let Some(item) = items.next_element_seed(Reading { place, only: None })? {
            match item {
                // Bytes take no more memory than their text, so they are not counted.
                Value::Int(byte @ 0..=255) if list.is_empty() => {
                    bytes.push(byte as u8);
                    place.values.set(place.values.get() - 1);
                }
                item => {
                    place.count(bytes.len())?;
                    list.extend(bytes.drain(..).map(|byte| Value::Int(i64::from(byte))));
                    list.push(item);
                }
            }
        }
        if !bytes.is_empty() {
            let (bytes, scalar) = (Cow::Owned(bytes), Scalar::U8);
            return Ok(Value::Numbers(Numbers { bytes, scalar, endian: Endian::Little }));
        }
        let number = |item: &Value| match item {
            Value::Int(value) => Some(*value as f64),
            Value::Float(value) => Some(*value),
            _ => None,
        };
        let numbers: Option<Vec<f64>> = list.iter().map(number).collect();
        Ok(match numbers {
            Some(numbers) if !list.is_empty() => {
                let bytes = numbers.into_iter().flat_map(f64::to_le_bytes).collect();
                let (bytes, scalar) = (Cow::Owned(bytes), Scalar::F64);
                Value::Numbers(Numbers { bytes, scalar, endian: Endian::Little })
            }
            _ => Value::List(list),
        })
    }

    fn visit_map<A: MapAccess<'a>>(self, mut entries: A) -> Result<Value<'a>, A::Error> {
        let mut fields = Vec::new();
        while let Some(key) = entries.next_key_seed(Key)? {
            let is_wanted = |key: &&str| self.only.is_none_or(|only| only.contains(key));
            let Some(key) = key.filter(is_wanted) else {
                entries.next_value::<IgnoredAny>()?;
                continue;
            };
            let node = self.place.node.and_then(|node| node.fields.get(key));
            let place = Place { node, key, ..self.place };
            fields.push((key, entries.next_value_seed(Reading { place, only: None })?));
        }
        Ok(Value::Struct(Struct { name: self.place.name, fields }))
    }
}

impl<'a> Place<'a, '_> {
    /// Note values that take memory.
    fn count<E: de::Error>(&self, more: usize) -> Result<(), E> {
        let values = self.values.get() + more;
        self.values.set(values);
        match values > MAX_VALUES {
            true => Err(de::Error::custom("more values than a message may have")),
            false => Ok(()),
        }
    }

    fn text<E: de::Error>(self, text: Cow<'a, str>) -> Result<Value<'a>, E> {
        let is_base64 = self.node.is_some_and(|node| node.is_base64);
        if !is_base64 && self.key != BYTES_FIELD {
            return Ok(Value::Text(text));
        }
        match BASE64.decode(text.as_bytes()) {
            Ok(bytes) => {
                let (bytes, scalar) = (Cow::Owned(bytes), Scalar::U8);
                Ok(Value::Numbers(Numbers { bytes, scalar, endian: Endian::Little }))
            }
            Err(error) if is_base64 => {
                Err(de::Error::custom(format!("`{}` is no base64: {error}", self.key)))
            }
            Err(_) => Ok(Value::Text(text)),
        }
    }
}

/// The name of a field; `None` for one written with escapes, which no field that pmp reads is.
struct Key;

impl<'a> DeserializeSeed<'a> for Key {
    type Value = Option<&'a str>;

    fn deserialize<D: de::Deserializer<'a>>(self, text: D) -> Result<Self::Value, D::Error> {
        text.deserialize_str(self)
    }
}

impl<'a> Visitor<'a> for Key {
    type Value = Option<&'a str>;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("the name of a field")
    }

    fn visit_borrowed_str<E: de::Error>(self, name: &'a str) -> Result<Self::Value, E> {
        Ok(Some(name))
    }

    fn visit_str<E: de::Error>(self, _name: &str) -> Result<Self::Value, E> {
        Ok(None)
    }
}
