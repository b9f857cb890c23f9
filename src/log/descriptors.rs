//! Protobuf descriptors to a type tree.
//!
//! MCAP's profile: the schema of a channel is a serialised `FileDescriptorSet` and its name is the
//! message's full name, <https://mcap.dev/spec/registry#protobuf>. The set holds every type that
//! the message uses, so a log explains its own messages.

use std::{borrow::Cow, collections::BTreeMap};

use prost_reflect::{DescriptorPool, FieldDescriptor, Kind, MessageDescriptor};

use crate::log::value::{Endian, Numbers, Scalar, Value};

/// Longest definition that is read: linking takes a hundred times its size.
const MAX_DEFINITION_BYTES: usize = 1 << 20;

/// A message type with all the types that it uses.
#[derive(Clone, Debug)]
pub struct Schema {
    /// The types; the message itself is the first.
    pub types: Vec<MessageType>,
}

/// A type with the fields that its messages may have.
#[derive(Clone, Debug)]
pub struct MessageType {
    pub name: String,
    /// Ascending by number.
    pub fields: Vec<Field>,
}

#[derive(Clone, Debug)]
pub struct Field {
    pub number: u32,
    pub name: String,
    pub element: Element,
    pub is_list: bool,
    /// What the field holds where the message does not have it.
    pub default: Value<'static>,
}

/// What a field holds one or many of.
#[derive(Clone, Copy, Debug)]
pub enum Element {
    /// Its bytes, little-endian.
    Fixed(Scalar),
    Varint(Scalar),
    /// A varint whose lowest bit is the sign.
    ZigZag,
    Text,
    Bytes,
    /// Index in [`Schema::types`].
    Message(usize),
}

/// Link the descriptors of the message `name`, for example `foxglove.CompressedImage`.
///
/// # Errors
///
/// A sentence: the bytes are no `FileDescriptorSet` of at most 1 MiB, its parts do not fit
/// together, or the message is not among them.
pub fn parse(name: &str, descriptors: &[u8]) -> Result<Schema, String> {
    if descriptors.len() > MAX_DEFINITION_BYTES {
        return Err(format!("its descriptors are longer than {MAX_DEFINITION_BYTES} bytes"));
    }
    let pool = DescriptorPool::decode(descriptors)
        .map_err(|error| format!("its descriptors cannot be read: {error}"))?;
    let root = pool
        .get_message_by_name(name)
        .ok_or_else(|| format!("its descriptors do not define `{name}`"))?;
    let mut messages = vec![root];
    let mut index = BTreeMap::from([(name.to_string(), 0)]);
    let mut types = Vec::new();
    while let Some(message) = messages.get(types.len()).cloned() {
        let mut at_of = |inner: MessageDescriptor| {
            *index.entry(inner.full_name().to_string()).or_insert_with(|| {
                messages.push(inner);
                messages.len() - 1
            })
        };
        let mut fields: Vec<_> =
            message.fields().map(|field| Field::new(&field, &mut at_of)).collect();
        fields.sort_by_key(|field| field.number);
        types.push(MessageType { name: message.full_name().to_string(), fields });
    }
    Ok(Schema { types })
}

impl Field {
    fn new(
        descriptor: &FieldDescriptor,
        at_of: &mut impl FnMut(MessageDescriptor) -> usize,
    ) -> Field {
        let element = match descriptor.kind() {
            Kind::Double => Element::Fixed(Scalar::F64),
            Kind::Float => Element::Fixed(Scalar::F32),
            Kind::Fixed32 => Element::Fixed(Scalar::U32),
            Kind::Fixed64 => Element::Fixed(Scalar::U64),
            Kind::Sfixed32 => Element::Fixed(Scalar::I32),
            Kind::Sfixed64 => Element::Fixed(Scalar::I64),
            Kind::Bool => Element::Varint(Scalar::Bool),
            Kind::Int32 | Kind::Enum(_) => Element::Varint(Scalar::I32),
            Kind::Uint32 => Element::Varint(Scalar::U32),
            Kind::Int64 => Element::Varint(Scalar::I64),
            Kind::Uint64 => Element::Varint(Scalar::U64),
            Kind::Sint32 | Kind::Sint64 => Element::ZigZag,
            Kind::String => Element::Text,
            Kind::Bytes => Element::Bytes,
            Kind::Message(inner) => Element::Message(at_of(inner)),
        };
        // Maps are lists of entries on the wire.
        let is_list = descriptor.is_list() || descriptor.is_map();
        let (number, name) = (descriptor.number(), descriptor.name().to_string());
        let default = match (is_list, element) {
            (true, _) => element.no_elements(),
            (false, Element::Message(_)) => Value::Absent,
            (false, _) => value_of(&descriptor.default_value()),
        };
        Field { number, name, element, is_list, default }
    }
}

impl Element {
    /// How a list of these is stored: numbers as such, all else value by value.
    fn no_elements(self) -> Value<'static> {
        let scalar = match self {
            Element::Fixed(scalar) => scalar,
            Element::Varint(Scalar::U64) => Scalar::U64,
            Element::Varint(_) | Element::ZigZag => Scalar::I64,
            Element::Text | Element::Bytes | Element::Message(_) => return Value::List(Vec::new()),
        };
        Value::Numbers(Numbers { bytes: Cow::Borrowed(&[]), scalar, endian: Endian::Little })
    }
}

/// The default of a field that is one value and no message; in proto2 the definition may say it.
fn value_of(default: &prost_reflect::Value) -> Value<'static> {
    use prost_reflect::Value as Default;
    match default {
        Default::Bool(value) => Value::Int(i64::from(*value)),
        Default::I32(value) | Default::EnumNumber(value) => Value::Int(i64::from(*value)),
        Default::I64(value) => Value::Int(*value),
        Default::U32(value) => Value::Int(i64::from(*value)),
        Default::U64(value) => Value::Int(*value as i64),
        Default::F32(value) => Value::Float(f64::from(*value)),
        Default::F64(value) => Value::Float(*value),
        Default::String(value) => Value::Text(Cow::Owned(value.clone())),
        Default::Bytes(value) => bytes_value(Cow::Owned(value.to_vec())),
        Default::Message(_) | Default::List(_) | Default::Map(_) => Value::Absent,
    }
}

/// Bytes as a value.
pub fn bytes_value(bytes: Cow<[u8]>) -> Value {
    Value::Numbers(Numbers { bytes, scalar: Scalar::U8, endian: Endian::Little })
}
