//! Message definitions as text (`ros2msg`, and the same grammar in ROS 1) to a type tree.
//!
//! A definition holds the type itself and, after separator lines, every type that it uses, so a
//! log explains its own messages and no type is built into this crate. Grammar: the ROS 2
//! interface definition of messages, <https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html>.

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

/// Parse the concatenated definitions of the message `name` (`pkg/msg/Type` or `pkg/Type`).
///
/// # Errors
///
/// [`Error::Definition`] with the line: a field that cannot be read, a type that is neither
/// built in nor defined, a type that contains itself.
pub fn parse(name: &str, text: &str) -> Result<Schema> {
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
    let index: BTreeMap<String, usize> =
        raw.iter().enumerate().rev().map(|(at, (name, _))| (name.clone(), at)).collect();
    let mut types = Vec::with_capacity(raw.len());
    for (type_name, fields) in raw {
        let package = type_name.split('/').next().unwrap_or_default().to_string();
        let fields = fields
            .into_iter()
            .map(|field| {
                let element = element(&field.type_name, &package, &index).ok_or_else(|| {
                    Error::Definition {
                        schema: name.into(),
                        line: field.line,
                        what: format!("type `{}` is not defined in the log", field.type_name),
                    }
                })?;
                Ok(Field { name: field.name, element, arity: field.arity })
            })
            .collect::<Result<_>>()?;
        types.push(StructType { name: type_name, fields });
    }
    let schema = Schema { types };
    let mut below = vec![None; schema.types.len()];
    schema.check_depth(0, 0, &mut below).map_err(|what| Error::Definition {
        schema: name.into(),
        line: 1,
        what,
    })?;
    Ok(schema)
}

impl Schema {
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

/// `pkg/msg/Type` and `pkg/Type` are the same type.
pub fn short_name(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}

/// One line of a definition: `None` for blanks, comments and constants.
fn field(line: &str, number: usize) -> Result<Option<RawField>, String> {
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

fn element(name: &str, package: &str, types: &BTreeMap<String, usize>) -> Option<Element> {
    let scalar = match name {
        "bool" => Scalar::Bool,
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
        "wstring" => return Some(Element::WideString),
        _ => {
            let short = short_name(name);
            let candidates = match short.as_str() {
                "Header" => vec!["std_msgs/Header".to_string()],
                local if !local.contains('/') => vec![format!("{package}/{local}")],
                _ => vec![short.clone()],
            };
            let found = candidates.iter().find_map(|name| types.get(name));
            return found.map(|at| Element::Struct(*at));
        }
    };
    Some(Element::Scalar(scalar))
}
