//! Protobuf and JSON messages of any kind: as another decoder reads them, or an error.
#![allow(clippy::unwrap_used)]

use pmp::log::{
    descriptors::{self, Schema},
    json, protobuf,
    value::{Struct, Value},
};
use proptest::prelude::*;
use prost_reflect::{
    DescriptorPool, DynamicMessage, Value as Other,
    prost::Message as _,
    prost_types::{
        DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet,
        field_descriptor_proto::{Label, Type},
    },
};
use serde_json::json;

use crate::foxglove_fixtures::{Form, delimited, descriptors, time, varint};

/// Field numbers of `a.All`: its number types, one and many of each, then itself.
const NUMBER_TYPES: [Type; 13] = [
    Type::Double,
    Type::Float,
    Type::Int32,
    Type::Int64,
    Type::Uint32,
    Type::Uint64,
    Type::Sint32,
    Type::Sint64,
    Type::Fixed32,
    Type::Fixed64,
    Type::Sfixed32,
    Type::Sfixed64,
    Type::Bool,
];

/// A message type with a field of every kind: numbers from 1 and 101, `text`, `bytes`, itself.
fn everything(syntax: &str) -> Vec<u8> {
    let field = |number: i32, kind: Type, label: Label| FieldDescriptorProto {
        name: Some(format!("f{number}")),
        number: Some(number),
        label: Some(label as i32),
        r#type: Some(kind as i32),
        type_name: (kind == Type::Message).then(|| ".a.All".to_string()),
        default_value: (syntax == "proto2" && number == 3).then(|| "-7".to_string()),
        ..Default::default()
    };
    let all = NUMBER_TYPES.into_iter().chain([Type::String, Type::Bytes, Type::Message]);
    let fields = all.zip(1..).flat_map(|(kind, number)| {
        [field(number, kind, Label::Optional), field(100 + number, kind, Label::Repeated)]
    });
    let message = DescriptorProto {
        name: Some("All".to_string()),
        field: fields.collect(),
        ..Default::default()
    };
    let file = FileDescriptorProto {
        name: Some("a.proto".to_string()),
        package: Some("a".to_string()),
        message_type: vec![message],
        syntax: Some(syntax.to_string()),
        ..Default::default()
    };
    FileDescriptorSet { file: vec![file] }.encode_to_vec()
}

fn numbers(list: &[Other]) -> Option<Vec<f64>> {
    list.iter().map(number).collect()
}

fn number(value: &Other) -> Option<f64> {
    Some(match value {
        Other::Bool(v) => f64::from(u8::from(*v)),
        Other::I32(v) => f64::from(*v),
        Other::U32(v) => f64::from(*v),
        Other::I64(v) => *v as f64,
        Other::U64(v) => *v as f64,
        Other::F32(v) => f64::from(*v),
        Other::F64(v) => *v,
        _ => return None,
    })
}

/// Numbers are the same, or both none.
fn equal(a: f64, b: f64) -> bool {
    a == b || a.is_nan() && b.is_nan()
}

/// Whether pmp's value and the other decoder's are the same.
fn same(ours: &Value, theirs: &Other) -> bool {
    match (ours, theirs) {
        (Value::Int(a), Other::U64(b)) => *a as u64 == *b,
        (Value::Int(a), Other::I64(b)) => a == b,
        (Value::Int(a), b) => number(b) == Some(*a as f64),
        (Value::Float(a), b) => number(b).is_some_and(|b| equal(*a, b)),
        (Value::Text(a), Other::String(b)) => a == b,
        (Value::Numbers(a), Other::Bytes(b)) => *a.bytes == **b,
        (Value::Numbers(a), Other::List(b)) => numbers(b)
            .is_some_and(|b| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| equal(a, b))),
        (Value::List(a), Other::List(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
        }
        (Value::Struct(a), Other::Message(b)) => same_struct(a, b),
        _ => false,
    }
}

fn same_struct(ours: &Struct, theirs: &DynamicMessage) -> bool {
    ours.fields.iter().all(|(name, value)| match value {
        Value::Absent => !theirs.has_field_by_name(name),
        value => same(value, &theirs.get_field_by_name(name).unwrap()),
    })
}

fn both(syntax: &str) -> (Schema, DescriptorPool) {
    let set = everything(syntax);
    (descriptors::parse("a.All", &set).unwrap(), DescriptorPool::decode(&set[..]).unwrap())
}

/// The bytes of a message of `a.All` whose keys are right more often than by chance.
fn wire() -> impl Strategy<Value = Vec<u8>> {
    let number = prop_oneof![1..17_u32, 101..117_u32, Just(500_u32)];
    let leaf = (number, any::<u64>(), 0..5_u8, prop::collection::vec(any::<u8>(), 0..20));
    let field = leaf.prop_map(|(number, value, choice, bytes)| {
        let key = |wire_type: u64| varint(u64::from(number) << 3 | wire_type);
        let own = match number % 100 {
            1 | 10 | 12 => 1,
            2 | 9 | 11 => 5,
            14.. => 2,
            _ => 0,
        };
        match if choice == 0 && number > 100 { 2 } else { own } {
            0 => [key(0), varint(value >> (value % 64))].concat(),
            1 => [key(1), value.to_le_bytes().to_vec()].concat(),
            5 => [key(5), (value as u32).to_le_bytes().to_vec()].concat(),
            _ if number % 100 < 14 => delimited(number, &[0; 16]),
            _ if number % 100 == 16 => delimited(number, &[0x18, 5]),
            _ if number % 100 == 14 => delimited(number, b"text"),
            _ => delimited(number, &bytes),
        }
    });
    let fields = prop::collection::vec(field, 0..12).prop_map(|fields| fields.concat());
    fields.prop_recursive(4, 32, 4, |inner| {
        let part = (prop_oneof![Just(16_u32), Just(116)], inner);
        let parts = part.prop_map(|(number, inner)| delimited(number, &inner));
        prop::collection::vec(parts, 1..4).prop_map(|parts| parts.concat())
    })
}

/// All values in a value.
fn count(value: &Value) -> usize {
    match value {
        Value::List(list) => 1 + list.iter().map(count).sum::<usize>(),
        Value::Struct(part) => 1 + part.fields.iter().map(|(_, value)| count(value)).sum::<usize>(),
        Value::Numbers(numbers) => 1 + numbers.len(),
        _ => 1,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..Default::default() })]

    #[test]
    fn messages_decode_as_the_other_decoder_reads_them(message in wire(), is_new in any::<bool>()) {
        let (schema, pool) = both(if is_new { "proto3" } else { "proto2" });
        let descriptor = pool.get_message_by_name("a.All").unwrap();
        let theirs = DynamicMessage::decode(descriptor, &message[..]).unwrap();
        let ours = protobuf::decode(&schema, &message).unwrap();
        prop_assert!(same_struct(&ours, &theirs), "{ours:?}");
        for len in 0..message.len() {
            // Some beginnings of a message are messages.
            let _ = protobuf::decode(&schema, &message[..len]);
        }
    }

    #[test]
    fn random_bytes_are_an_error_or_a_message(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let (schema, _) = both("proto3");
        if let Ok(message) = protobuf::decode(&schema, &bytes) {
            prop_assert!(count(&Value::Struct(message)) <= 40 + 40 * bytes.len());
        }
        let schema = json::parse("a", b"{}").unwrap();
        let _ = json::decode(&schema, &bytes, None);
        let _ = descriptors::parse("a.All", &bytes);
    }

    #[test]
    fn damaged_descriptors_are_an_error_or_others(at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let mut set = descriptors().encode_to_vec();
        *at.get_mut(&mut set) = byte;
        if let Ok(schema) = descriptors::parse("foxglove.PointCloud", &set) {
            let _ = protobuf::decode(&schema, &[0x0a, 0, 0x2a, 0]);
        }
    }
}

#[test]
fn messages_and_definitions_cut_short_are_no_panic() {
    let values = json!({
        "timestamp": time(7_000_000_005), "frame_id": "camera", "width": 2, "height": 3,
        "encoding": "rgb8", "step": 6, "data": "AAECAwQFBgcICQoLDA0ODxAR",
    });
    let (_, set, ..) = Form::Protobuf.schema("RawImage");
    for len in 0..set.len() {
        let _ = descriptors::parse("foxglove.RawImage", &set[..len]);
    }
    let schema = descriptors::parse("foxglove.RawImage", &set).unwrap();
    let message = Form::Protobuf.message("RawImage", &values);
    for len in 0..message.len() {
        let _ = protobuf::decode(&schema, &message[..len]);
    }
    let schema = json::parse("foxglove.RawImage", &Form::Json.schema("RawImage").1).unwrap();
    let message = Form::Json.message("RawImage", &values);
    for len in 0..message.len() {
        assert!(json::decode(&schema, &message[..len], None).is_err());
    }
    assert!(json::decode(&schema, &message, None).is_ok());
}

#[test]
fn deep_and_endless_protobuf_is_refused() {
    let (schema, _) = both("proto3");
    let refused = |message: &[u8]| protobuf::decode(&schema, message).unwrap_err().to_string();
    for number in [16, 116] {
        let deep = (0..1000).fold(Vec::new(), |inner, _| delimited(number, &inner));
        assert!(refused(&deep).contains("parts nest more than 64 deep"));
    }
    assert!(refused(&delimited(116, &[]).repeat(100_000)).contains("more values than"));
    assert!(refused(&delimited(114, &[]).repeat(2_000_000)).contains("more values than"));
    assert!(refused(&delimited(103, &vec![0; 2_000_000])).contains("more values than"));
    // Numbers of a fixed size are not copied, however many they are.
    let packed = delimited(101, &vec![0; 24_000_000]);
    let message = protobuf::decode(&schema, &packed).unwrap();
    assert_eq!(message.numbers("f101").unwrap().len(), 3_000_000);
    let huge = [varint(115 << 3 | 2), varint(u64::MAX)].concat();
    assert!(refused(&huge).contains("18446744073709551615 bytes are needed and 0 are left"));
    assert!(refused(&[0xff; 11]).contains("a number of more than 10 bytes"));
    assert!(refused(&delimited(101, &[0; 7])).contains("7 bytes of 8-byte numbers"));
    assert!(refused(&delimited(1, &[0; 8])).contains("`f1` has wire type 2"));
    // Groups of fields that nobody knows are left out to their ends.
    let groups = [[0x83, 0x7d].repeat(5000), [0x84, 0x7d].repeat(5000)].concat();
    assert!(protobuf::decode(&schema, &groups).is_ok());
    assert!(protobuf::decode(&schema, &groups[..groups.len() - 1]).is_err());
    let long = descriptors::parse("a.All", &vec![0; 2 << 20]).unwrap_err();
    assert_eq!(long, "its descriptors are longer than 1048576 bytes");
}

#[test]
fn parts_in_pieces_are_one_part() {
    let (schema, _) = both("proto3");
    // f3 = 5 in one piece, f4 = 6 in the other; 16 is the part.
    let message = [delimited(16, &[0x18, 5]), delimited(16, &[0x20, 6])].concat();
    let decoded = protobuf::decode(&schema, &message).unwrap();
    let part = decoded.part("f16").unwrap();
    assert_eq!((part.int("f3").unwrap(), part.int("f4").unwrap()), (5, 6));
}

#[test]
fn deep_and_endless_json_is_refused() {
    let schema = json::parse("a", b"").unwrap();
    let refused =
        |text: &str| json::decode(&schema, text.as_bytes(), None).unwrap_err().to_string();
    for open in ["[", "{\"a\":"] {
        assert!(refused(&format!("{{\"a\":{}", open.repeat(100_000))).contains("recursion limit"));
    }
    let many = |number: &str| format!("{{\"a\":[{}0]}}", format!("{number},").repeat(2_000_000));
    assert!(refused(&many("300")).contains("more values than a message may have"));
    // Bytes take less memory than their text.
    let bytes = many("7");
    let bytes = json::decode(&schema, bytes.as_bytes(), None).unwrap();
    assert_eq!(bytes.bytes("a").unwrap().len(), 2_000_001);
    assert!(refused("[]").contains("the message is no object"));
    assert!(refused("{} 1").contains("trailing characters"));
    assert!(
        refused("{\n\"a\": x}").contains("at byte 8 of the message"),
        "{}",
        refused("{\n\"a\": x}")
    );
    let of_bytes = br#"{"properties": {"a": {"type": "string", "contentEncoding": "base64"}}}"#;
    let schema = json::parse("a", of_bytes).unwrap();
    let error = json::decode(&schema, br#"{"a": "?"}"#, None).unwrap_err();
    assert!(error.to_string().contains("`a` is no base64"), "{error}");
    // Only the fields that were asked for are looked into.
    assert!(json::decode(&schema, br#"{"a": "?"}"#, Some(&["b"])).unwrap().fields.is_empty());
}

#[test]
fn json_that_nests_too_deeply_is_refused_where_it_is_asked_for() {
    let schema = json::parse("a/All", b"").unwrap();
    let nested = |levels: usize, open: &str, close: &str| {
        format!("{{\"data\": {}0{}}}", open.repeat(levels), close.repeat(levels)).into_bytes()
    };
    for (open, close) in [("[", "]"), ("{\"a\":", "}")] {
        assert!(json::decode(&schema, &nested(100, open, close), None).is_ok());
        for levels in [128, 100_000] {
            let text = nested(levels, open, close);
            let why = json::decode(&schema, &text, None).unwrap_err().to_string();
            assert!(why.contains("recursion limit"), "{why}");
            // What nobody asks for is passed over, however deep it is.
            assert!(json::decode(&schema, &text, Some(&["header"])).unwrap().fields.is_empty());
        }
    }
    let schema = format!("{}{{}}{}", "{\"items\":".repeat(100_000), "}".repeat(100_000));
    let why = json::parse("a/All", schema.as_bytes()).unwrap_err();
    assert!(why.contains("recursion limit"), "{why}");
}

#[test]
fn bytes_in_json_may_be_base64_or_numbers() {
    let schema = json::parse("sensor_msgs/CompressedImage", b"").unwrap();
    let bytes: Vec<u8> = (0..=255).chain([0, 7, 255]).collect();
    let spaced = format!("{bytes:?}").replace(", ", " ,\n ");
    let pointed = format!("{bytes:?}").replace(',', ".0,").replace(']', ".0]");
    for list in [format!("{bytes:?}"), spaced, pointed] {
        let text = format!("{{\"format\": \"jpeg\", \"data\": {list}}}");
        let message = json::decode(&schema, text.as_bytes(), None).unwrap();
        assert_eq!(message.bytes("data").unwrap(), bytes, "{text}");
    }
    // None of these is a list of bytes.
    for list in ["[255, 256]", "[-1, 2]", "[1, 0.5]", "[1, null]", "[1, [2]]", "[\"/9j/\"]", "7"] {
        let text = format!("{{\"format\": \"jpeg\", \"data\": {list}}}");
        let message = json::decode(&schema, text.as_bytes(), None).unwrap();
        assert!(message.bytes("data").is_err(), "{list}");
    }
}
