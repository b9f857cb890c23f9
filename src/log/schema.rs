//! Message definitions as text (`ros2msg` and `ros1msg`) to a type tree.
//!
//! A definition holds the type itself and, after separator lines, every type that it uses, so a
//! log explains its own messages and no type is built into this crate. Grammar: the ROS 2
//! interface definition of messages, <https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html>,
//! and ROS 1's older form of it with words of its own, <https://wiki.ros.org/msg>.

use std::collections::BTreeMap;

use crate::{
    error::{Error, Result},
    log::value::Scalar,
};

/// Deepest nesting of types that is followed. Real messages stay below 10.
const MAX_DEPTH: usize = 64;

/// A message type with all the types that it uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// The types; the message itself is the first.
    pub types: Vec<StructType>,
}

/// A type with its fields in wire order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StructType {
    /// `package/Name`.
    pub name: String,
    pub fields: Vec<Field>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    pub name: String,
    pub element: Element,
    pub arity: Arity,
}

/// What a field holds one or many of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    Scalar(Scalar),
    String,
    WideString,
    /// Index in [`Schema::types`].
    Struct(usize),
}

/// How many a field holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arity {
    One,
    Array(usize),
    /// As many as the message says; an upper bound in the definition does not change the wire.
    Sequence,
}

/// A field before its type's name is looked up.
struct RawField {
    line: usize,
    type_name: String,
    name: String,
    arity: Arity,
}

/// Whose words a definition uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dialect {
    Ros1,
    Ros2,
}

/// Parse the concatenated ROS 2 definitions of the message `name` (`pkg/msg/Type` or `pkg/Type`).
///
/// # Errors
///
/// [`Error::Definition`] with the line: a field that cannot be read, a type that is neither
/// built in nor defined, a type that contains itself.
pub fn parse(name: &str, text: &str) -> Result<Schema> {
    parse_dialect(Dialect::Ros2, name, text)
}

/// Parse the concatenated ROS 1 definitions of the message `name` (`pkg/Type`). Its `time` and
/// `duration` become types with the fields `sec` and `nsec`.
///
/// # Errors
///
/// As [`parse`].
pub fn parse_ros1(name: &str, text: &str) -> Result<Schema> {
    parse_dialect(Dialect::Ros1, name, text)
}

fn parse_dialect(dialect: Dialect, name: &str, text: &str) -> Result<Schema> {
    let root = short_name(name);
    let mut raw: Vec<(String, Vec<RawField>)> = vec![(root.clone(), Vec::new())];
    let mut after_separator = false;
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        let fail = |what: String| Error::Definition { schema: name.into(), line: index + 1, what };
        if line.len() >= 3 && line.bytes().all(|byte| byte == b'=') {
            after_separator = true;
        } else if let Some(part) = line.strip_prefix("MSG:").filter(|_| after_separator) {
            raw.push((short_name(part.trim()), Vec::new()));
            after_separator = false;
        } else if let Some(field) = field(line, index + 1).map_err(fail)?
            && let Some((_, fields)) = raw.last_mut()
        {
            fields.push(field);
        }
    }
    if dialect == Dialect::Ros1 {
        for (name, number) in [("time", "uint32"), ("duration", "int32")] {
            let field = |name: &str| RawField {
                line: 1,
                type_name: number.to_string(),
                name: name.to_string(),
                arity: Arity::One,
            };
            raw.push((name.to_string(), vec![field("sec"), field("nsec")]));
        }
    }
    let index: BTreeMap<String, usize> =
        raw.iter().enumerate().rev().map(|(at, (name, _))| (name.clone(), at)).collect();
    let mut types = Vec::with_capacity(raw.len());
    for (type_name, fields) in raw {
        let package = type_name.split('/').next().unwrap_or_default().to_string();
        let fields = fields
            .into_iter()
            .map(|field| {
                let element = element(dialect, &field.type_name, &package, &index);
                let element = element.ok_or_else(|| Error::Definition {
                    schema: name.into(),
                    line: field.line,
                    what: format!("type `{}` is not defined in the log", field.type_name),
                })?;
                Ok(Field { name: field.name, element, arity: field.arity })
            })
            .collect::<Result<_>>()?;
        types.push(StructType { name: type_name, fields });
    }
    Schema::of(name, types)
}

impl Schema {
    /// A schema of these types, the message `name` first.
    ///
    /// # Errors
    ///
    /// [`Error::Definition`] if a type contains itself or types nest too deeply to be followed.
    pub fn of(name: &str, types: Vec<StructType>) -> Result<Schema> {
        let schema = Schema { types };
        let mut below = vec![None; schema.types.len()];
        match schema.check_depth(0, 0, &mut below) {
            Ok(_) => Ok(schema),
            Err(what) => Err(Error::Definition { schema: name.into(), line: 1, what }),
        }
    }

    /// Levels below a type. Each type is walked once, however many ways lead to it: `below` holds
    /// what is known, and `Some(None)` marks the types on the way down.
    fn check_depth(
        &self,
        at: usize,
        level: usize,
        below: &mut [Option<Option<usize>>],
    ) -> Result<usize, String> {
        let levels = match below[at] {
            Some(None) => return Err(format!("type `{}` contains itself", self.types[at].name)),
            Some(Some(levels)) => levels,
            None if level > MAX_DEPTH => 0,
            None => {
                below[at] = Some(None);
                let mut levels = 0;
                for field in &self.types[at].fields {
                    if let Element::Struct(inner) = field.element {
                        levels = levels.max(1 + self.check_depth(inner, level + 1, below)?);
                    }
                }
                below[at] = Some(Some(levels));
                levels
            }
        };
        match level + levels <= MAX_DEPTH {
            true => Ok(levels),
            false => Err(format!("type `{}` nests more than {MAX_DEPTH} deep", self.types[0].name)),
        }
    }
}

/// `pkg/msg/Type`, `pkg::msg::Type` and `pkg/Type` are the same type.
pub fn short_name(name: &str) -> String {
    name.replace("::", "/").replacen("/msg/", "/", 1)
}

/// One line of a definition: `None` for blanks, comments and constants.
fn field(line: &str, number: usize) -> Result<Option<RawField>, String> {
    // A string constant of ROS 1 may hold a `#`: what is cut off is its value, which nobody needs.
    let code = line.split('#').next().unwrap_or_default().trim();
    if code.is_empty() {
        return Ok(None);
    }
    let (type_text, rest) = code
        .split_once(char::is_whitespace)
        .ok_or_else(|| format!("`{code}` has a type and no name"))?;
    let rest = rest.trim();
    let name_end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
    let (name, tail) = (&rest[..name_end], rest[name_end..].trim());
    if name.is_empty() {
        return Err(format!("`{code}` has no field name"));
    }
    if tail.starts_with('=') {
        return Ok(None);
    }
    // What else follows a name is a default value, which is not on the wire.
    let (type_name, arity) = match type_text.split_once('[') {
        None => (type_text, Arity::One),
        Some((base, bound)) => {
            let bound = bound.strip_suffix(']').ok_or_else(|| format!("`{type_text}`: no `]`"))?;
            let arity = match bound {
                "" => Arity::Sequence,
                bound if bound.starts_with("<=") => Arity::Sequence,
                count => Arity::Array(
                    count.parse().map_err(|_error| format!("`{count}` is not an array size"))?,
                ),
            };
            (base, arity)
        }
    };
    // `string<=10` bounds the string, which does not change the wire either.
    let type_name = type_name.split("<=").next().unwrap_or_default().to_string();
    Ok(Some(RawField { line: number, type_name, name: name.to_string(), arity }))
}

fn element(
    dialect: Dialect,
    name: &str,
    package: &str,
    types: &BTreeMap<String, usize>,
) -> Option<Element> {
    let scalar = match name {
        "bool" => Scalar::Bool,
        "byte" if dialect == Dialect::Ros1 => Scalar::I8,
        "int8" => Scalar::I8,
        "uint8" | "byte" | "char" => Scalar::U8,
        "int16" => Scalar::I16,
        "uint16" => Scalar::U16,
        "int32" => Scalar::I32,
        "uint32" => Scalar::U32,
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        "float32" => Scalar::F32,
        "float64" => Scalar::F64,
        "string" => return Some(Element::String),
        "wstring" if dialect == Dialect::Ros2 => return Some(Element::WideString),
        _ => {
            let short = short_name(name);
            let full = match short.as_str() {
                "Header" => "std_msgs/Header".to_string(),
                "time" | "duration" if dialect == Dialect::Ros1 => short,
                local if !local.contains('/') => format!("{package}/{local}"),
                _ => short,
            };
            return types.get(&full).map(|at| Element::Struct(*at));
        }
    };
    Some(Element::Scalar(scalar))
}
