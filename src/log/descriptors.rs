//! Protobuf descriptors to a type tree.
//!
//! MCAP's profile: the schema of a channel is a serialised `FileDescriptorSet` and its name is the
//! message's full name, <https://mcap.dev/spec/registry#protobuf>. The set holds every type that
//! the message uses, so a log explains its own messages.

use std::{borrow::Cow, collections::BTreeMap};

use prost::Message;
use prost_types::{
    DescriptorProto, EnumDescriptorProto, FieldDescriptorProto, FileDescriptorSet,
    field_descriptor_proto::{Label, Type},
};

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
    ZigZag(Scalar),
    Text,
    Bytes,
    /// Index in [`Schema::types`].
    Message(usize),
}

/// Link the descriptors of the message `name`, for example `foxglove.CompressedImage`.
///
/// # Errors
///
/// A sentence: the bytes are no `FileDescriptorSet` of at most 1 MiB, the message is not among its
/// types, or one that it uses is not.
pub fn parse(name: &str, descriptors: &[u8]) -> Result<Schema, String> {
    if descriptors.len() > MAX_DEFINITION_BYTES {
        return Err(format!("its descriptors are longer than {MAX_DEFINITION_BYTES} bytes"));
    }
    let set = FileDescriptorSet::decode(descriptors)
        .map_err(|error| format!("its descriptors cannot be read: {error}"))?;
    let mut named = Named::default();
    for file in &set.file {
        let package = file.package.as_deref().filter(|package| !package.is_empty());
        let scope = package.map_or(String::new(), |package| format!(".{package}"));
        named.add(&scope, &file.message_type, &file.enum_type);
    }
    let root = format!(".{name}");
    let mut names = vec![root.clone()];
    let mut index = BTreeMap::from([(root, 0)]);
    let mut types = Vec::new();
    while let Some(name) = names.get(types.len()) {
        let (name, message) = (name.trim_start_matches('.').to_string(), named.messages.get(name));
        let message = message.ok_or_else(|| format!("its descriptors do not define `{name}`"))?;
        let mut fields = Vec::with_capacity(message.field.len());
        for field in &message.field {
            let mut at_of = |inner: &str| {
                *index.entry(inner.to_string()).or_insert_with(|| {
                    names.push(inner.to_string());
                    names.len() - 1
                })
            };
            fields.extend(Field::new(field, &named, &mut at_of)?);
        }
        fields.sort_by_key(|field| field.number);
        types.push(MessageType { name, fields });
    }
    Ok(Schema { types })
}

/// The types of a set by their full names, each with a dot before it.
#[derive(Default)]
struct Named<'s> {
    messages: BTreeMap<String, &'s DescriptorProto>,
    enums: BTreeMap<String, &'s EnumDescriptorProto>,
}

impl<'s> Named<'s> {
    fn add(
        &mut self,
        scope: &str,
        messages: &'s [DescriptorProto],
        enums: &'s [EnumDescriptorProto],
    ) {
        for part in enums {
            self.enums.insert(format!("{scope}.{}", part.name()), part);
        }
        // The parser follows no more than 100 levels.
        for message in messages {
            let name = format!("{scope}.{}", message.name());
            self.add(&name, &message.nested_type, &message.enum_type);
            self.messages.insert(name, message);
        }
    }

    /// The number of an enum's value; without a name that of its first.
    fn number(&self, name: &str, value: Option<&str>) -> i64 {
        let values = self.enums.get(name).map_or(&[][..], |part| &part.value);
        let is_wanted = |known: &str| value.is_none_or(|value| value == known);
        let found = values.iter().find(|known| is_wanted(known.name()));
        found.map_or(0, |known| i64::from(known.number()))
    }
}

impl Field {
    /// `None` for a group, which is no part of proto3.
    fn new(
        descriptor: &FieldDescriptorProto,
        named: &Named,
        at_of: &mut impl FnMut(&str) -> usize,
    ) -> Result<Option<Field>, String> {
        let name = descriptor.name().to_string();
        let wrong = |what: &str| format!("its descriptors give field `{name}` no {what}");
        let number = u32::try_from(descriptor.number()).map_err(|_error| wrong("number"))?;
        let kind = Type::try_from(descriptor.r#type.unwrap_or_default());
        let element = match kind.map_err(|_error| wrong("type"))? {
            Type::Double => Element::Fixed(Scalar::F64),
            Type::Float => Element::Fixed(Scalar::F32),
            Type::Fixed32 => Element::Fixed(Scalar::U32),
            Type::Fixed64 => Element::Fixed(Scalar::U64),
            Type::Sfixed32 => Element::Fixed(Scalar::I32),
            Type::Sfixed64 => Element::Fixed(Scalar::I64),
            Type::Bool => Element::Varint(Scalar::Bool),
            Type::Int32 | Type::Enum => Element::Varint(Scalar::I32),
            Type::Uint32 => Element::Varint(Scalar::U32),
            Type::Int64 => Element::Varint(Scalar::I64),
            Type::Uint64 => Element::Varint(Scalar::U64),
            Type::Sint32 => Element::ZigZag(Scalar::I32),
            Type::Sint64 => Element::ZigZag(Scalar::I64),
            Type::String => Element::Text,
            Type::Bytes => Element::Bytes,
            Type::Message => Element::Message(at_of(descriptor.type_name())),
            Type::Group => return Ok(None),
        };
        // Maps are lists of entries, here as on the wire.
        let is_list = descriptor.label() == Label::Repeated;
        // Only proto2 says a default.
        let said = descriptor.default_value.as_deref();
        let default = match element {
            _ if is_list => element.no_elements(),
            Element::Message(_) => Value::Absent,
            Element::Text => Value::Text(Cow::Owned(said.unwrap_or_default().to_string())),
            Element::Bytes => bytes_value(Cow::Owned(said.unwrap_or_default().into())),
            Element::Fixed(Scalar::F32 | Scalar::F64) => {
                let number = said.map_or(Ok(0.0), str::parse);
                Value::Float(number.map_err(|_error| wrong("default that is a number"))?)
            }
            _ if descriptor.r#type() == Type::Enum => {
                Value::Int(named.number(descriptor.type_name(), said))
            }
            _ => {
                let number = match said {
                    None | Some("false") => Ok(0),
                    Some("true") => Ok(1),
                    Some(text) => text.parse().or_else(|_| text.parse().map(u64::cast_signed)),
                };
                Value::Int(number.map_err(|_error| wrong("default that is an integer"))?)
            }
        };
        Ok(Some(Field { number, name, element, is_list, default }))
    }
}

impl Element {
    /// How a list of these is stored: numbers as such, all else value by value.
    fn no_elements(self) -> Value<'static> {
        let scalar = match self {
            Element::Fixed(scalar) => scalar,
            Element::Varint(Scalar::U64) => Scalar::U64,
            Element::Varint(_) | Element::ZigZag(_) => Scalar::I64,
            Element::Text | Element::Bytes | Element::Message(_) => return Value::List(Vec::new()),
        };
        Value::Numbers(Numbers { bytes: Cow::Borrowed(&[]), scalar, endian: Endian::Little })
    }
}

/// Bytes as a value.
pub fn bytes_value(bytes: Cow<[u8]>) -> Value {
    Value::Numbers(Numbers { bytes, scalar: Scalar::U8, endian: Endian::Little })
}
