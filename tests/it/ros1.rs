//! ROS 1: random definitions with their messages, hostile ones, and a whole drive.
#![allow(clippy::unwrap_used)]

use std::{fmt::Write as _, path::Path, process::Command};

use pmp::{
    error::Error,
    frame::Frame,
    log::{
        ros1,
        schema::{self, Schema},
        signals::Kind,
        value::Value,
    },
};
use proptest::prelude::*;
use serde_json::Value as Json;

use crate::{
    decoding::{Random, values},
    definitions::{TOPIC_TYPES, ros1_definition},
    fixtures::{Cdr, DriveLog, Format, Layout},
    ingest::{frames, into},
    writers::python,
};

/// What a field must decode to; arrays of numbers as numbers.
#[derive(Clone, Debug)]
enum Expected {
    Int(i64),
    Float(f64),
    Text(String),
    Numbers(Vec<f64>),
    List(Vec<Expected>),
    Part(Vec<(String, Expected)>),
}

impl Expected {
    fn is(&self, value: &Value) -> bool {
        match (self, value) {
            (Expected::Int(a), Value::Int(b)) => a == b,
            (Expected::Float(a), Value::Float(b)) => a == b,
            (Expected::Text(a), Value::Text(b)) => a == b,
            (Expected::Numbers(a), Value::Numbers(b)) => a.iter().copied().eq(b.iter()),
            (Expected::List(a), Value::List(b)) => {
                a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.is(b))
            }
            (Expected::Part(a), Value::Struct(b)) => {
                a.len() == b.fields.len()
                    && a.iter().zip(&b.fields).all(|(a, b)| a.0 == b.0 && a.1.is(&b.1))
            }
            _ => false,
        }
    }

    /// As an item of an array of a type.
    fn number(&self, word: &str) -> Option<f64> {
        match self {
            Expected::Int(value) if word == "uint64" => Some(*value as u64 as f64),
            Expected::Int(value) => Some(*value as f64),
            Expected::Float(value) => Some(*value),
            _ => None,
        }
    }
}

/// A made type: field names, types in ROS 1's words, and `None` for one, or how many if fixed.
struct Type {
    name: String,
    fields: Vec<(String, String, Option<Option<usize>>)>,
}

/// Types of which each uses only later ones, with a `Header` as the last; the first is the message.
fn random_types(random: &mut Random) -> Vec<Type> {
    const WORDS: [&str; 17] = [
        "bool", "byte", "char", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64",
        "uint64", "float32", "float64", "string", "time", "duration", "Header",
    ];
    let count = 1 + random.below(4);
    let package = |i: usize| ["one_msgs", "two_msgs"][i % 2];
    let mut types: Vec<Type> = (0..count)
        .map(|i| {
            let fields = (0..random.below(6).max(usize::from(i == 0))).map(|field| {
                let part = (i + 1 < count && random.below(3) == 0)
                    .then(|| i + 1 + random.below(count - i - 1));
                let word = match part {
                    Some(part) if package(part) == package(i) && random.below(2) == 0 => {
                        format!("Type{part}")
                    }
                    Some(part) => format!("{}/Type{part}", package(part)),
                    None => WORDS[random.below(WORDS.len())].to_string(),
                };
                let many = match random.below(6) {
                    0 | 1 => Some(None),
                    2 => Some(Some(1 + random.below(4))),
                    _ => None,
                };
                (format!("field_{field}"), word, many)
            });
            Type { name: format!("{}/Type{i}", package(i)), fields: fields.collect() }
        })
        .collect();
    let header = [("seq", "uint32"), ("stamp", "time"), ("frame_id", "string")];
    let fields = header.map(|(name, word)| (name.to_string(), word.to_string(), None));
    types.push(Type { name: "std_msgs/Header".to_string(), fields: fields.into() });
    types
}

/// The definition of the first type, with comments and constants in it.
fn definition(types: &[Type], random: &mut Random) -> String {
    let mut text = String::new();
    for (i, part) in types.iter().enumerate() {
        if i > 0 {
            writeln!(text, "{}\nMSG: {}", "=".repeat(80), part.name).unwrap();
        }
        for (name, word, many) in &part.fields {
            let many = match many {
                None => String::new(),
                Some(None) => "[]".to_string(),
                Some(Some(count)) => format!("[{count}]"),
            };
            let comment = ["", "# a comment = of=it", " # 1"][random.below(3)];
            writeln!(text, "{word}{many}  {name} {comment}").unwrap();
        }
        text += [
            "",
            "\n# only this\n",
            "int8 A=-1\nstring B=#no comment, \"a = b\"\n",
            "string C= # D\n",
        ][random.below(4)];
    }
    text
}

fn random_value(
    types: &[Type],
    scope: &str,
    word: &str,
    random: &mut Random,
    out: &mut Cdr,
) -> Expected {
    let bits = random.bits();
    macro_rules! int {
        ($t:ty) => {{
            out.number((bits as $t).to_le_bytes());
            Expected::Int(bits as $t as i64)
        }};
    }
    match word {
        "bool" => {
            out.u8(u8::from(bits & 1 == 1));
            Expected::Int(i64::from(bits & 1 == 1))
        }
        "byte" | "int8" => int!(i8),
        "char" | "uint8" => int!(u8),
        "int16" => int!(i16),
        "uint16" => int!(u16),
        "int32" => int!(i32),
        "uint32" => int!(u32),
        "int64" => int!(i64),
        "uint64" => int!(u64),
        "float32" => {
            out.f32(f32::from(bits as i16) / 8.0);
            Expected::Float(f64::from(bits as i16) / 8.0)
        }
        "float64" => {
            out.f64(bits as i64 as f64 / 1024.0);
            Expected::Float(bits as i64 as f64 / 1024.0)
        }
        "string" => {
            // A zero byte at the end is as good as any other here.
            let text = random.text() + ["", "\0"][random.below(2)];
            out.text(&text);
            Expected::Text(text)
        }
        "time" | "duration" => {
            let word = if word == "time" { "uint32" } else { "int32" };
            let mut part = |name: &str| {
                (name.to_string(), random_value(types, scope, word, random, &mut *out))
            };
            Expected::Part(vec![part("sec"), part("nsec")])
        }
        _ => {
            let names = [
                word.to_string(),
                format!("{}/{word}", scope.split('/').next().unwrap()),
                format!("std_msgs/{word}"),
            ];
            let part = types.iter().find(|part| names.contains(&part.name)).unwrap();
            random_part(types, part, random, out)
        }
    }
}

/// Write a random value of a type and say what was written.
fn random_part(types: &[Type], part: &Type, random: &mut Random, out: &mut Cdr) -> Expected {
    let fields = part.fields.iter().map(|(name, word, many)| {
        let Some(many) = many else {
            return (name.clone(), random_value(types, &part.name, word, random, out));
        };
        let count = many.unwrap_or_else(|| random.below(4));
        if many.is_none() {
            out.u32(count as u32);
        }
        let items: Vec<Expected> =
            (0..count).map(|_| random_value(types, &part.name, word, random, out)).collect();
        let is_number = word.starts_with(|c: char| c.is_ascii_lowercase())
            && !word.contains('/')
            && !["string", "time", "duration"].contains(&word.as_str());
        let value = match is_number {
            true => Expected::Numbers(items.iter().filter_map(|item| item.number(word)).collect()),
            false => Expected::List(items),
        };
        (name.clone(), value)
    });
    Expected::Part(fields.collect())
}

fn parsed(name: &str) -> Schema {
    schema::parse_ros1(name, &ros1_definition(name)).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn ros1_values_of_any_definition_come_back_and_no_cut_message_decodes(seed in any::<u64>()) {
        let mut random = Random(seed);
        let types = random_types(&mut random);
        let text = definition(&types, &mut random);
        let schema = schema::parse_ros1(&types[0].name, &text).unwrap();
        let mut out = Cdr::ros1();
        let expected = random_part(&types, &types[0], &mut random, &mut out);
        let message = out.finish();
        let decoded = Value::Struct(ros1::decode(&schema, &message).unwrap());
        prop_assert!(expected.is(&decoded), "{text}\n{expected:?}\n{decoded:?}");
        for len in 0..message.len() {
            let cut = ros1::decode(&schema, &message[..len]);
            prop_assert!(
                matches!(cut, Err(Error::Decode { offset, .. }) if offset <= len),
                "{len} of {} bytes decode: {text}", message.len()
            );
        }
    }

    #[test]
    fn random_bytes_are_a_ros1_message_or_an_error(
        at in 0..TOPIC_TYPES.len(),
        message in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let schema = parsed(TOPIC_TYPES[at]);
        if let Ok(decoded) = ros1::decode(&schema, &message) {
            prop_assert!(values(&Value::Struct(decoded)) <= 200 + 16 * message.len());
        }
    }
}

#[test]
fn ros1_definitions_of_every_topic_type_are_read_and_known() {
    for name in TOPIC_TYPES {
        let schema = parsed(name);
        assert_eq!(schema.types[0].name, name);
        assert!(Kind::of(name).is_some() || name == "std_msgs/Header", "{name}");
    }
    for name in ["sensor_msgs/Imu", "sensor_msgs/msg/Imu", "sensor_msgs::msg::Imu"] {
        assert_eq!(Kind::of(name), Some(Kind::Imu), "{name}");
    }
}

#[test]
fn words_of_one_ros_are_not_words_of_the_other() {
    let error = |result: Result<Schema, Error>| result.unwrap_err().to_string();
    for word in ["time", "duration", "time[]"] {
        assert!(schema::parse_ros1("a/B", &format!("{word} t")).is_ok());
        let said = error(schema::parse("a/B", &format!("uint8 a\n{word} t")));
        assert!(said.starts_with("message definition of a/B, line 2: type `"), "{said}");
    }
    let said = error(schema::parse_ros1("a/B", "wstring w"));
    assert_eq!(said, "message definition of a/B, line 1: type `wstring` is not defined in the log");

    let text = "byte a\nchar b";
    let (one, two) = (schema::parse_ros1("a/B", text), schema::parse("a/B", text));
    let (one, two) = (one.unwrap(), two.unwrap());
    let decoded = ros1::decode(&one, &[255, 255]).unwrap();
    assert_eq!((decoded.int("a").unwrap(), decoded.int("b").unwrap()), (-1, 255));
    let decoded = pmp::log::cdr::decode(&two, &[0, 1, 0, 0, 255, 255]).unwrap();
    assert_eq!((decoded.int("a").unwrap(), decoded.int("b").unwrap()), (255, 255));
}

#[test]
fn lengths_beyond_a_ros1_message_are_errors() {
    for word in ["string", "string[]", "uint8[]", "float64[]", "time[]", "E[]", "F[]"] {
        let text = format!("{word} many\n===\nMSG: a/E\n# nothing\n===\nMSG: a/F\nE[3] e\nuint8 n");
        let schema = schema::parse_ros1("a/B", &text).unwrap();
        for count in [5, 1 << 20, (1 << 20) + 1, u32::MAX / 8 + 1, u32::MAX] {
            let mut message = Cdr::ros1();
            let decoded = ros1::decode(&schema, &message.u32(count).u32(0).finish()).map(|_| ());
            // Parts that take no byte may be many, but not more than a message may have.
            assert_eq!(decoded.is_ok(), word == "E[]" && count == 5, "{word} {count}: {decoded:?}");
        }
    }
}

#[test]
fn the_same_drive_in_ros1_and_in_both_definitions_of_ros2_gives_the_same_frames() {
    let folder = tempfile::tempdir().unwrap();
    let made = |name: &str, format: Format| -> Vec<Frame> {
        let layout = Layout { format, ..Layout::default() };
        let drive = DriveLog { seconds: 1.0, layout, ..DriveLog::default() };
        let log = drive.write(folder.path(), &format!("{name}.mcap"));
        let dataset = folder.path().join(name);
        let said = into(&dataset, &[&log]);
        assert_eq!(said.code, 0, "{name}: {}", said.err);
        frames(&dataset).into_iter().map(|(_, frame)| frame).collect()
    };
    let ros2 = made("ros2msg", Format::Ros2Msg);
    assert_eq!(ros2.len(), 11);
    assert!(ros2[5].lidar.is_some() && ros2[5].radar.is_some() && ros2[5].action.steer.is_some());
    assert!(made("ros2idl", Format::Ros2Idl) == ros2);
    assert!(made("ros1", Format::Ros1) == ros2);
}

/// Whether a value says what another decoder's JSON says; arrays of numbers are lists there.
fn is_json(value: &Value, json: &Json) -> bool {
    match (value, json) {
        (Value::Int(a), Json::Bool(b)) => *a == i64::from(*b),
        (Value::Int(a), b) => b.as_i64() == Some(*a) || b.as_u64() == Some(*a as u64),
        (Value::Float(a), b) => b.as_f64() == Some(*a),
        (Value::Text(a), b) => b.as_str() == Some(a),
        (Value::Numbers(a), Json::Array(b)) => {
            let number =
                |item: &Json| item.as_f64().or(item.as_bool().map(|b| f64::from(u8::from(b))));
            a.iter().map(Some).eq(b.iter().map(number))
        }
        (Value::List(a), Json::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| is_json(a, b))
        }
        (Value::Struct(a), Json::Object(b)) => {
            a.fields.len() == b.len()
                && a.fields
                    .iter()
                    .all(|(name, value)| b.get(*name).is_some_and(|json| is_json(value, json)))
        }
        _ => false,
    }
}

#[test]
fn ros1_messages_of_the_python_package_rosbags_decode_to_its_values() {
    let has_peer = Command::new(python()).args(["-c", "import rosbags"]).output();
    if !has_peer.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: {} has no package rosbags", python());
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/rosbags_ros1.py");
    let output = Command::new(python()).arg(script).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).unwrap();
    let mut types = 0;
    for line in lines.lines() {
        let said: Json = serde_json::from_str(line).unwrap();
        let text = |key: &str| said[key].as_str().unwrap();
        let schema = schema::parse_ros1(text("type"), text("definition")).unwrap();
        let hex = text("message");
        let message: Vec<u8> = (0..hex.len() / 2)
            .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap())
            .collect();
        let decoded = Value::Struct(ros1::decode(&schema, &message).unwrap());
        assert!(is_json(&decoded, &said["values"]), "{}: {decoded:?}", text("type"));
        types += 1;
    }
    assert!(types > 50, "{types} types");
}
