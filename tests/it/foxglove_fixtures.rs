//! Messages of Foxglove's well-known schemas, written from one table as protobuf, as JSON and as
//! ROS 2: none of it by the code that reads them.
#![allow(clippy::unwrap_used)]

use std::{collections::BTreeMap, io::Cursor};

use base64::{Engine, engine::general_purpose::STANDARD};
use mcap::{Writer, records::MessageHeader};
use prost_reflect::{
    prost::Message as _,
    prost_types::{
        DescriptorProto, EnumDescriptorProto, EnumValueDescriptorProto, FieldDescriptorProto,
        FileDescriptorProto, FileDescriptorSet,
        field_descriptor_proto::{Label, Type},
    },
};
use serde_json::{Value as Json, json};

use crate::{
    definitions::{concatenated, schema_name, types},
    fixtures::Cdr,
};

/// Name, number in protobuf, type. Written down from
/// <https://github.com/foxglove/foxglove-sdk/tree/main/schemas/proto/foxglove>, in the order of the
/// ROS definitions.
type Fields = &'static [(&'static str, u32, &'static str)];

const TYPES: &[(&str, Fields)] = &[
    ("Vector3", &[("x", 1, "double"), ("y", 2, "double"), ("z", 3, "double")]),
    (
        "Quaternion",
        &[("x", 1, "double"), ("y", 2, "double"), ("z", 3, "double"), ("w", 4, "double")],
    ),
    ("Pose", &[("position", 1, "Vector3"), ("orientation", 2, "Quaternion")]),
    (
        "CompressedImage",
        &[
            ("timestamp", 1, "time"),
            ("frame_id", 4, "string"),
            ("data", 2, "bytes"),
            ("format", 3, "string"),
        ],
    ),
    (
        "CompressedVideo",
        &[
            ("timestamp", 1, "time"),
            ("frame_id", 2, "string"),
            ("data", 3, "bytes"),
            ("format", 4, "string"),
        ],
    ),
    (
        "RawImage",
        &[
            ("timestamp", 1, "time"),
            ("frame_id", 7, "string"),
            ("width", 2, "fixed32"),
            ("height", 3, "fixed32"),
            ("encoding", 4, "string"),
            ("step", 5, "fixed32"),
            ("data", 6, "bytes"),
        ],
    ),
    (
        "CameraCalibration",
        &[
            ("timestamp", 1, "time"),
            ("frame_id", 9, "string"),
            ("width", 2, "fixed32"),
            ("height", 3, "fixed32"),
            ("distortion_model", 4, "string"),
            ("D", 5, "double[]"),
            ("K", 6, "double[9]"),
            ("R", 7, "double[9]"),
            ("P", 8, "double[12]"),
        ],
    ),
    ("PackedElementField", &[("name", 1, "string"), ("offset", 2, "fixed32"), ("type", 3, "enum")]),
    (
        "PointCloud",
        &[
            ("timestamp", 1, "time"),
            ("frame_id", 2, "string"),
            ("pose", 3, "Pose"),
            ("point_stride", 4, "fixed32"),
            ("fields", 5, "PackedElementField[]"),
            ("data", 6, "bytes"),
        ],
    ),
    (
        "FrameTransform",
        &[
            ("timestamp", 1, "time"),
            ("parent_frame_id", 2, "string"),
            ("child_frame_id", 3, "string"),
            ("translation", 4, "Vector3"),
            ("rotation", 5, "Quaternion"),
        ],
    ),
    ("FrameTransforms", &[("transforms", 1, "FrameTransform[]")]),
    ("PoseInFrame", &[("timestamp", 1, "time"), ("frame_id", 2, "string"), ("pose", 3, "Pose")]),
    (
        "PosesInFrame",
        &[("timestamp", 1, "time"), ("frame_id", 2, "string"), ("poses", 3, "Pose[]")],
    ),
    (
        "Odometry",
        &[
            ("timestamp", 1, "time"),
            ("frame_id", 2, "string"),
            ("body_frame_id", 3, "string"),
            ("pose", 4, "Pose"),
            ("linear_velocity", 5, "Vector3"),
            ("angular_velocity", 6, "Vector3"),
        ],
    ),
    (
        "LocationFix",
        &[("timestamp", 6, "time"), ("frame_id", 7, "string"), ("latitude", 1, "double")],
    ),
];

fn fields(name: &str) -> Fields {
    TYPES.iter().find(|(known, _)| *known == name).unwrap().1
}

/// The encodings of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Protobuf,
    Json,
    Ros2,
}

pub(crate) const FORMS: [Form; 3] = [Form::Protobuf, Form::Json, Form::Ros2];

/// One message: the values of a type above, as Foxglove writes them in JSON.
#[derive(Clone, Debug)]
pub(crate) struct Told {
    pub(crate) topic: &'static str,
    pub(crate) type_name: &'static str,
    pub(crate) log_time_ns: i64,
    pub(crate) values: Json,
}

impl Form {
    /// Name and content of the schema record, its encoding and that of the messages.
    pub(crate) fn schema(self, name: &str) -> (String, Vec<u8>, &'static str, &'static str) {
        match self {
            Form::Protobuf => {
                (format!("foxglove.{name}"), descriptors().encode_to_vec(), "protobuf", "protobuf")
            }
            Form::Json => {
                let schema = serde_json::to_vec(&json_schema(name)).unwrap();
                (format!("foxglove.{name}"), schema, "jsonschema", "json")
            }
            Form::Ros2 => {
                let name = ros_name(name);
                let text = concatenated(&name, &ros_types());
                (schema_name(&name), text.into_bytes(), "ros2msg", "cdr")
            }
        }
    }

    pub(crate) fn message(self, name: &str, values: &Json) -> Vec<u8> {
        match self {
            Form::Protobuf => protobuf(name, values),
            Form::Json => serde_json::to_vec(values).unwrap(),
            Form::Ros2 => {
                let mut bytes = Cdr::new(false);
                cdr(&mut bytes, name, values);
                bytes.finish()
            }
        }
    }

    /// An MCAP file.
    pub(crate) fn log(self, messages: &[Told]) -> Vec<u8> {
        let mut writer = Writer::new(Cursor::new(Vec::new())).unwrap();
        let mut channels = BTreeMap::new();
        for message in messages {
            let channel_id = *channels.entry(message.topic).or_insert_with(|| {
                let (name, schema, encoding, message_encoding) = self.schema(message.type_name);
                let schema = writer.add_schema(&name, encoding, &schema).unwrap();
                writer
                    .add_channel(schema, message.topic, message_encoding, &BTreeMap::new())
                    .unwrap()
            });
            let log_time = message.log_time_ns as u64;
            let header =
                MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
            let bytes = self.message(message.type_name, &message.values);
            writer.write_to_known_channel(&header, &bytes).unwrap();
        }
        writer.finish().unwrap();
        writer.into_inner().into_inner()
    }
}

/// A time as JSON has it.
pub(crate) fn time(stamp_ns: i64) -> Json {
    json!({"sec": stamp_ns / 1_000_000_000, "nsec": stamp_ns % 1_000_000_000})
}

pub(crate) fn base64(bytes: &[u8]) -> Json {
    Json::String(STANDARD.encode(bytes))
}

pub(crate) fn vector([x, y, z]: [f64; 3]) -> Json {
    json!({"x": x, "y": y, "z": z})
}

pub(crate) fn rotation([x, y, z, w]: [f64; 4]) -> Json {
    json!({"x": x, "y": y, "z": z, "w": w})
}

fn bytes_of(value: &Json) -> Vec<u8> {
    STANDARD.decode(value.as_str().unwrap()).unwrap()
}

/// `double[9]` is `double`, many.
fn element(kind: &str) -> (&str, bool) {
    kind.split_once('[').map_or((kind, false), |(element, _)| (element, true))
}

/// A file of descriptors that another one needs, and the one with all types above.
pub(crate) fn descriptors() -> FileDescriptorSet {
    let field = |name: &str, number: u32, kind: &str| {
        let (kind, is_list) = element(kind);
        let type_name = match kind {
            "time" => Some(".google.protobuf.Timestamp".to_string()),
            "enum" => Some(".foxglove.NumericType".to_string()),
            "string" | "bytes" | "fixed32" | "double" | "int64" | "int32" => None,
            message => Some(format!(".foxglove.{message}")),
        };
        let kind = match kind {
            "string" => Type::String,
            "bytes" => Type::Bytes,
            "fixed32" => Type::Fixed32,
            "double" => Type::Double,
            "int64" => Type::Int64,
            "int32" => Type::Int32,
            "enum" => Type::Enum,
            _ => Type::Message,
        };
        FieldDescriptorProto {
            name: Some(name.to_string()),
            number: Some(number as i32),
            label: Some(if is_list { Label::Repeated } else { Label::Optional } as i32),
            r#type: Some(kind as i32),
            type_name,
            ..Default::default()
        }
    };
    let message = |name: &str, fields: &[(&str, u32, &str)]| DescriptorProto {
        name: Some(name.to_string()),
        field: fields.iter().map(|(name, number, kind)| field(name, *number, kind)).collect(),
        ..Default::default()
    };
    let value = |(number, name): (usize, &str)| EnumValueDescriptorProto {
        name: Some(name.to_string()),
        number: Some(number as i32),
        ..Default::default()
    };
    let numeric = ["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32"];
    let timestamp = FileDescriptorProto {
        name: Some("google/protobuf/timestamp.proto".to_string()),
        package: Some("google.protobuf".to_string()),
        message_type: vec![message("Timestamp", &[("seconds", 1, "int64"), ("nanos", 2, "int32")])],
        syntax: Some("proto3".to_string()),
        ..Default::default()
    };
    let all = FileDescriptorProto {
        name: Some("foxglove/All.proto".to_string()),
        package: Some("foxglove".to_string()),
        dependency: vec!["google/protobuf/timestamp.proto".to_string()],
        message_type: TYPES.iter().map(|(name, fields)| message(name, fields)).collect(),
        enum_type: vec![EnumDescriptorProto {
            name: Some("NumericType".to_string()),
            value: numeric.into_iter().chain(["FLOAT64"]).enumerate().map(value).collect(),
            ..Default::default()
        }],
        syntax: Some("proto3".to_string()),
        ..Default::default()
    };
    FileDescriptorSet { file: vec![timestamp, all] }
}

pub(crate) fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value > 0x7f {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// A field of bytes: key, length, content.
pub(crate) fn delimited(number: u32, content: &[u8]) -> Vec<u8> {
    [varint(u64::from(number) << 3 | 2), varint(content.len() as u64), content.to_vec()].concat()
}

/// What is zero is left out, as proto3 wants it; numbers of a list are packed.
fn protobuf(name: &str, values: &Json) -> Vec<u8> {
    let mut bytes = Vec::new();
    for (field, number, kind) in fields(name) {
        let (value, (kind, is_list)) = (&values[*field], element(kind));
        let key = |wire_type: u64| varint(u64::from(*number) << 3 | wire_type);
        bytes.extend(match (kind, value) {
            (_, Json::Null) => Vec::new(),
            ("double", Json::Array(numbers)) => {
                let packed = numbers.iter().flat_map(|v| v.as_f64().unwrap().to_le_bytes());
                delimited(*number, &packed.collect::<Vec<_>>())
            }
            (message, Json::Array(list)) if is_list => {
                list.iter().flat_map(|v| delimited(*number, &protobuf(message, v))).collect()
            }
            ("double", v) if v.as_f64() == Some(0.0) => Vec::new(),
            ("double", v) => [key(1), v.as_f64().unwrap().to_le_bytes().to_vec()].concat(),
            ("fixed32" | "enum", v) if v.as_u64() == Some(0) => Vec::new(),
            ("fixed32", v) => {
                [key(5), (v.as_u64().unwrap() as u32).to_le_bytes().to_vec()].concat()
            }
            ("enum", v) => [key(0), varint(v.as_u64().unwrap())].concat(),
            ("string", v) => delimited(*number, v.as_str().unwrap().as_bytes()),
            ("bytes", v) => delimited(*number, &bytes_of(v)),
            ("time", v) => {
                let part = |number: u64, name: &str| match v[name].as_u64().unwrap() {
                    0 => Vec::new(),
                    value => [varint(number << 3), varint(value)].concat(),
                };
                delimited(*number, &[part(1, "sec"), part(2, "nsec")].concat())
            }
            (message, v) => delimited(*number, &protobuf(message, v)),
        });
    }
    bytes
}

fn json_schema(name: &str) -> Json {
    let of_kind = |kind: &str| match kind {
        "time" => json!({"type": "object", "title": "time", "properties": {
            "sec": {"type": "integer", "minimum": 0}, "nsec": {"type": "integer", "minimum": 0}}}),
        "string" => json!({"type": "string"}),
        "bytes" => json!({"type": "string", "contentEncoding": "base64"}),
        "fixed32" | "enum" => json!({"type": "integer", "minimum": 0}),
        "double" => json!({"type": "number"}),
        message => json_schema(message),
    };
    let properties = fields(name).iter().map(|(field, _, kind)| {
        let part = match element(kind) {
            (kind, true) => json!({"type": "array", "items": of_kind(kind)}),
            (kind, false) => of_kind(kind),
        };
        (field.to_string(), part)
    });
    let properties: serde_json::Map<_, _> = properties.collect();
    json!({"title": format!("foxglove.{name}"), "type": "object", "properties": properties})
}

/// Foxglove's ROS definitions take the types that ROS has.
fn ros_name(name: &str) -> String {
    match name {
        "Pose" | "Vector3" | "Quaternion" => format!("geometry_msgs/{name}"),
        _ => format!("foxglove_msgs/{name}"),
    }
}

fn ros_types() -> BTreeMap<String, String> {
    let mut all = types();
    for (name, fields) in TYPES.iter().filter(|(name, _)| ros_name(name).starts_with("foxglove")) {
        let line = |(field, _, kind): &(&str, u32, &str)| {
            let (element, array) = kind.split_at(kind.find('[').unwrap_or(kind.len()));
            let (element, array) = match element {
                "time" => ("builtin_interfaces/Time".to_string(), array),
                "bytes" => ("uint8".to_string(), "[]"),
                "fixed32" => ("uint32".to_string(), array),
                "enum" => ("uint8".to_string(), array),
                "double" => ("float64".to_string(), array),
                "string" => ("string".to_string(), array),
                message => (ros_name(message), array),
            };
            format!("{element}{array} {}", field.to_lowercase())
        };
        all.insert(ros_name(name), fields.iter().map(line).collect::<Vec<_>>().join("\n"));
    }
    all
}

fn cdr(bytes: &mut Cdr, name: &str, values: &Json) {
    for (field, _, kind) in fields(name) {
        let value = &values[*field];
        match (element(kind).0, value) {
            ("double", Json::Array(numbers)) => {
                if kind.ends_with("[]") {
                    bytes.u32(numbers.len() as u32);
                }
                let numbers: Vec<_> = numbers.iter().map(|v| v.as_f64().unwrap()).collect();
                bytes.f64s(&numbers);
            }
            (message, Json::Array(list)) => {
                bytes.u32(list.len() as u32);
                list.iter().for_each(|v| cdr(bytes, message, v));
            }
            ("double", v) => {
                bytes.f64(v.as_f64().unwrap());
            }
            ("fixed32", v) => {
                bytes.u32(v.as_u64().unwrap() as u32);
            }
            ("enum", v) => {
                bytes.u8(v.as_u64().unwrap() as u8);
            }
            ("string", v) => {
                bytes.text(v.as_str().unwrap());
            }
            ("bytes", v) => {
                bytes.bytes(&bytes_of(v));
            }
            ("time", v) => {
                bytes.i32(v["sec"].as_i64().unwrap() as i32);
                bytes.u32(v["nsec"].as_u64().unwrap() as u32);
            }
            (message, v) => cdr(bytes, message, v),
        }
    }
}
