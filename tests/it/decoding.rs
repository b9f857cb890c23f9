//! Definitions and messages, read by pmp and by independent crates: both must say the same.
#![allow(clippy::unwrap_used)]

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
};

use pmp::{
    error::Error,
    log::{
        cdr,
        schema::{self, Schema},
        signals::Kind,
        value::{Struct, Value},
    },
};
use proptest::prelude::*;
use re_cdr::{BigEndian, CdrReader, LittleEndian};
use re_ros_msg::{
    MessageSchema,
    deserialize::{
        MapResolver, TypeResolver as _, Value as Other, decode_message,
        primitive_array::PrimitiveArray,
    },
    message_spec::{ArraySize, BuiltInType, MessageSpecification, Type, message_package},
};

use crate::{
    definitions::{TOPIC_TYPES, concatenated, definition, schema_name, types},
    fixtures::{Cdr, shared},
};

/// A small generator of numbers (SplitMix64), so that a seed says everything.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    pub(crate) fn text(&mut self) -> String {
        let letters = ['a', 'Z', '0', ' ', '/', 'ß', '車', '🚗'];
        (0..self.below(6)).map(|_| letters[self.below(letters.len())]).collect()
    }

    fn scalar(&mut self, kind: &BuiltInType) -> Other {
        let bits = self.bits();
        match kind {
            BuiltInType::Bool => Other::Bool(bits & 1 == 1),
            BuiltInType::Byte | BuiltInType::Char | BuiltInType::UInt8 => Other::U8(bits as u8),
            BuiltInType::Int8 => Other::I8(bits as i8),
            BuiltInType::Int16 => Other::I16(bits as i16),
            BuiltInType::UInt16 => Other::U16(bits as u16),
            BuiltInType::Int32 => Other::I32(bits as i32),
            BuiltInType::UInt32 => Other::U32(bits as u32),
            BuiltInType::Int64 => Other::I64(bits as i64),
            BuiltInType::UInt64 => Other::U64(bits),
            // Whole numbers: NaN would not equal itself.
            BuiltInType::Float32 => Other::F32(f32::from(bits as i16) / 8.0),
            BuiltInType::Float64 => Other::F64(bits as i64 as f64 / 1024.0),
            BuiltInType::String(_) => Other::String(self.text()),
            BuiltInType::WString(_) => panic!("the other decoder has no wide strings"),
        }
    }
}

/// A message type as the other parser understands it.
struct Oracle {
    root: MessageSpecification,
    specs: Vec<(String, MessageSpecification)>,
}

impl Oracle {
    fn parse(name: &str, text: &str) -> Oracle {
        let parsed = MessageSchema::parse(name, text).unwrap();
        let mut specs = vec![(name.to_string(), parsed.spec.clone())];
        for spec in parsed.dependencies {
            specs.push((spec.name.clone(), spec));
        }
        // `Header` alone means that of std_msgs in every package.
        let header = specs.iter().find(|(name, _)| name == "std_msgs/Header");
        if let Some((_, header)) = header.cloned() {
            let packages: BTreeSet<String> = specs
                .iter()
                .filter_map(|(name, _)| Some(message_package(name)?.to_string()))
                .collect();
            specs.extend(packages.iter().map(|p| (format!("{p}/Header"), header.clone())));
        }
        Oracle { root: parsed.spec, specs }
    }

    fn resolver(&self) -> MapResolver<'_> {
        MapResolver::new(self.specs.iter().map(|(name, spec)| (name.clone(), spec)))
    }

    /// Values of the right types.
    fn random(&self, random: &mut Random) -> Other {
        self.random_message(&self.root, random)
    }

    fn random_message(&self, spec: &MessageSpecification, random: &mut Random) -> Other {
        let field = |field: &re_ros_msg::message_spec::Field| {
            (field.name.clone(), self.random_value(spec, &field.ty, random))
        };
        Other::Message(spec.fields.iter().map(field).collect())
    }

    fn random_value(
        &self,
        scope: &MessageSpecification,
        kind: &Type,
        random: &mut Random,
    ) -> Other {
        match kind {
            Type::BuiltIn(kind) => random.scalar(kind),
            Type::Complex(name) => {
                let spec = self.resolver().resolve(scope, name).unwrap().clone();
                match spec.underlying_type_if_enum_like().unwrap() {
                    Some(kind) => random.scalar(kind),
                    None => self.random_message(&spec, random),
                }
            }
            Type::Array { ty, size } => {
                let count = match size {
                    ArraySize::Fixed(count) => *count,
                    ArraySize::Bounded(most) => random.below(most + 1),
                    ArraySize::Unbounded => random.below(4),
                };
                Other::Sequence((0..count).map(|_| self.random_value(scope, ty, random)).collect())
            }
        }
    }

    /// Write a value of [`random`](Oracle::random) with the tests' own encoder.
    fn encode(&self, spec: &MessageSpecification, value: &Other, cdr: &mut Cdr) {
        let Other::Message(fields) = value else { panic!("a message is a map") };
        for field in &spec.fields {
            self.encode_value(spec, &field.ty, &fields[&field.name], cdr);
        }
    }

    fn encode_value(
        &self,
        scope: &MessageSpecification,
        kind: &Type,
        value: &Other,
        cdr: &mut Cdr,
    ) {
        match (kind, value) {
            (Type::Array { ty, size }, Other::Sequence(items)) => {
                if !matches!(size, ArraySize::Fixed(_)) {
                    cdr.u32(items.len() as u32);
                }
                items.iter().for_each(|item| self.encode_value(scope, ty, item, cdr));
            }
            (Type::Complex(name), Other::Message(_)) => {
                let spec = self.resolver().resolve(scope, name).unwrap().clone();
                self.encode(&spec, value, cdr);
            }
            (_, Other::Bool(value)) => {
                cdr.u8(u8::from(*value));
            }
            (_, Other::I8(value)) => {
                cdr.number(value.to_le_bytes());
            }
            (_, Other::U8(value)) => {
                cdr.u8(*value);
            }
            (_, Other::I16(value)) => {
                cdr.number(value.to_le_bytes());
            }
            (_, Other::U16(value)) => {
                cdr.number(value.to_le_bytes());
            }
            (_, Other::I32(value)) => {
                cdr.i32(*value);
            }
            (_, Other::U32(value)) => {
                cdr.u32(*value);
            }
            (_, Other::I64(value)) => {
                cdr.number(value.to_le_bytes());
            }
            (_, Other::U64(value)) => {
                cdr.number(value.to_le_bytes());
            }
            (_, Other::F32(value)) => {
                cdr.f32(*value);
            }
            (_, Other::F64(value)) => {
                cdr.f64(*value);
            }
            (_, Other::String(text)) => {
                cdr.text(text);
            }
            (kind, value) => panic!("{value:?} is no {kind:?}"),
        }
    }

    /// What the other decoder reads.
    fn decode(&self, message: &[u8], is_big_endian: bool) -> Other {
        let (body, resolver) = (&message[4..], self.resolver());
        if is_big_endian {
            let mut reader = CdrReader::<BigEndian>::new(body);
            decode_message(&mut reader, &self.root, &resolver).unwrap()
        } else {
            let mut reader = CdrReader::<LittleEndian>::new(body);
            decode_message(&mut reader, &self.root, &resolver).unwrap()
        }
    }
}

/// Whether pmp's value and the other decoder's are the same.
fn same(ours: &Value, theirs: &Other) -> bool {
    match (ours, theirs) {
        (Value::Int(a), Other::Bool(b)) => *a == i64::from(*b),
        (Value::Int(a), Other::I8(b)) => *a == i64::from(*b),
        (Value::Int(a), Other::U8(b)) => *a == i64::from(*b),
        (Value::Int(a), Other::I16(b)) => *a == i64::from(*b),
        (Value::Int(a), Other::U16(b)) => *a == i64::from(*b),
        (Value::Int(a), Other::I32(b)) => *a == i64::from(*b),
        (Value::Int(a), Other::U32(b)) => *a == i64::from(*b),
        (Value::Int(a), Other::I64(b)) => a == b,
        (Value::Int(a), Other::U64(b)) => *a as u64 == *b,
        (Value::Float(a), Other::F32(b)) => *a == f64::from(*b),
        (Value::Float(a), Other::F64(b)) => a == b,
        (Value::Text(a), Other::String(b)) => a == b,
        (Value::List(a), Other::Array(b) | Other::Sequence(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
        }
        (Value::List(a), Other::PrimitiveArray(b) | Other::PrimitiveSeq(b)) => {
            let PrimitiveArray::String(b) = b else { return false };
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, &Other::String(b.clone())))
        }
        (Value::Numbers(a), b) => numbers(b).is_some_and(|b| a.iter().eq(b)),
        (Value::Struct(a), Other::Message(b)) => same_struct(a, b),
        // A type of constants alone is one byte, which pmp does not look at.
        (Value::Struct(a), Other::U8(_) | Other::I8(_) | Other::Bool(_)) => a.fields.is_empty(),
        _ => false,
    }
}

fn same_struct(ours: &Struct, theirs: &BTreeMap<String, Other>) -> bool {
    if ours.fields.is_empty() {
        return theirs.keys().eq(["structure_needs_at_least_one_member"]);
    }
    ours.fields.len() == theirs.len()
        && ours.fields.iter().all(|(name, value)| same(value, &theirs[*name]))
}

/// The items of an array of numbers.
fn numbers(value: &Other) -> Option<Vec<f64>> {
    fn floats<T: Copy>(items: &[T], float: impl Fn(T) -> f64) -> Option<Vec<f64>> {
        Some(items.iter().map(|item| float(*item)).collect())
    }
    match value {
        Other::PrimitiveArray(array) | Other::PrimitiveSeq(array) => match array {
            PrimitiveArray::Bool(items) => floats(items, |item| f64::from(u8::from(item))),
            PrimitiveArray::I8(items) => floats(items, f64::from),
            PrimitiveArray::U8(items) => floats(items, f64::from),
            PrimitiveArray::I16(items) => floats(items, f64::from),
            PrimitiveArray::U16(items) => floats(items, f64::from),
            PrimitiveArray::I32(items) => floats(items, f64::from),
            PrimitiveArray::U32(items) => floats(items, f64::from),
            PrimitiveArray::I64(items) => floats(items, |item| item as f64),
            PrimitiveArray::U64(items) => floats(items, |item| item as f64),
            PrimitiveArray::F32(items) => floats(items, f64::from),
            PrimitiveArray::F64(items) => floats(items, |item| item),
            PrimitiveArray::String(_) => None,
        },
        // The generator makes sequences of scalars; the other decoder makes arrays of numbers.
        Other::Sequence(items) => items.iter().map(number).collect(),
        _ => None,
    }
}

fn number(value: &Other) -> Option<f64> {
    Some(match value {
        Other::Bool(value) => f64::from(u8::from(*value)),
        Other::I8(value) => f64::from(*value),
        Other::U8(value) => f64::from(*value),
        Other::I16(value) => f64::from(*value),
        Other::U16(value) => f64::from(*value),
        Other::I32(value) => f64::from(*value),
        Other::U32(value) => f64::from(*value),
        Other::I64(value) => *value as f64,
        Other::U64(value) => *value as f64,
        Other::F32(value) => f64::from(*value),
        Other::F64(value) => *value,
        _ => return None,
    })
}

/// Encode random values of a definition, decode them in every way, and compare.
fn check(name: &str, text: &str, seed: u64) {
    let schema = schema::parse(&schema_name(name), text).unwrap();
    let oracle = Oracle::parse(name, text);
    let mut random = Random(seed);
    let values = oracle.random(&mut random);
    for is_big_endian in [false, true] {
        let mut cdr = Cdr::new(is_big_endian);
        oracle.encode(&oracle.root, &values, &mut cdr);
        let message = cdr.finish();
        let said = |what: &str| format!("{what}, big endian {is_big_endian}, seed {seed}:\n{text}");
        let ours = Value::Struct(cdr::decode(&schema, &message).unwrap());
        assert!(same(&ours, &values), "{}", said("not what was encoded"));
        let theirs = oracle.decode(&message, is_big_endian);
        assert!(same(&ours, &theirs), "{}", said("not what the other decoder reads"));

        let mut cdr = Cdr::version_2(is_big_endian);
        oracle.encode(&oracle.root, &values, &mut cdr);
        let ours = cdr.finish();
        let ours = Value::Struct(cdr::decode(&schema, &ours).unwrap());
        assert!(same(&ours, &values), "{}", said("not what was encoded in version 2"));

        for len in 0..message.len() {
            let cut = cdr::decode(&schema, &message[..len]);
            assert!(
                matches!(cut, Err(Error::Decode { offset, .. }) if offset <= message.len() + 8),
                "{}",
                said("a message that is cut off decodes")
            );
        }
    }
}

/// A definition of a few types that use each other, with what else may stand in one: comments,
/// constants, defaults, bounds.
pub(crate) fn random_definition(random: &mut Random) -> (String, BTreeMap<String, String>) {
    const SCALARS: [&str; 15] = [
        "bool",
        "byte",
        "char",
        "int8",
        "uint8",
        "int16",
        "uint16",
        "int32",
        "uint32",
        "int64",
        "uint64",
        "float32",
        "float64",
        "string",
        "string<=8",
    ];
    let count = 1 + random.below(4);
    let package = |i: usize| ["one_msgs", "two_msgs"][i % 2];
    let name = |i: usize| format!("{}/Type{i}", package(i));
    let mut types = BTreeMap::new();
    for i in 0..count {
        let mut text = String::new();
        for field in 0..random.below(6).max(usize::from(i == 0)) {
            let part = (i + 1 < count && random.below(3) == 0)
                .then(|| i + 1 + random.below(count - i - 1));
            let element = match part {
                Some(part) if package(part) == package(i) && random.below(2) == 0 => {
                    format!("Type{part}")
                }
                Some(part) => name(part),
                None => SCALARS[random.below(SCALARS.len())].to_string(),
            };
            let arity = match random.below(6) {
                0 => "[]".to_string(),
                1 => format!("[{}]", 1 + random.below(4)),
                2 => format!("[<={}]", 1 + random.below(4)),
                _ => String::new(),
            };
            let default = match (element.as_str(), arity.as_str()) {
                ("int32" | "float64", "") if random.below(2) == 0 => " 7",
                _ => "",
            };
            let comment = ["", "  # said in a comment", " # [] = a/B"][random.below(3)];
            text += &format!("{element}{arity}   field_{field}{default}{comment}\n");
        }
        text +=
            ["# end\n", "\n# nothing here\n", "uint8 CONSTANT=1\n", "int32 A = -1\nint32 B=2\n"]
                [random.below(4)];
        types.insert(name(i), text);
    }
    (name(0), types)
}

fn parsed(name: &str) -> Schema {
    schema::parse(&schema_name(name), &definition(name)).unwrap()
}

#[test]
fn messages_of_every_topic_type_decode_as_the_other_decoder_reads_them() {
    for name in TOPIC_TYPES {
        assert!(Kind::of(&schema_name(name)).is_some() || name == "std_msgs/Header", "{name}");
        for seed in 0..8 {
            check(name, &definition(name), seed);
        }
    }
}

#[test]
fn definitions_of_released_packages_decode_as_the_other_decoder_reads_them() {
    let Some(folder) = shared("msgs") else { return };
    let mut all = types();
    let mut names = Vec::new();
    for package in fs::read_dir(folder).unwrap() {
        let package = package.unwrap();
        for file in fs::read_dir(package.path()).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_some_and(|extension| extension == "msg") {
                let package = package.file_name().into_string().unwrap();
                let name = format!("{package}/{}", path.file_stem().unwrap().to_str().unwrap());
                all.insert(name.clone(), fs::read_to_string(path).unwrap());
                names.push(name);
            }
        }
    }
    assert!(names.len() > 20, "{} definitions", names.len());
    for name in names {
        for seed in 0..4 {
            check(&name, &concatenated(&name, &all), seed);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn values_of_any_definition_come_back(seed in any::<u64>()) {
        let mut random = Random(seed);
        let (name, types) = random_definition(&mut random);
        check(&name, &concatenated(&name, &types), seed);
    }

    #[test]
    fn random_bytes_are_an_error_or_a_message_and_never_more(
        at in 0..TOPIC_TYPES.len(),
        kind in 0..4_u8,
        body in prop::collection::vec(any::<u8>(), 0..400),
    ) {
        let schema = parsed(TOPIC_TYPES[at]);
        let mut message = vec![0, [0, 1, 6, 7][usize::from(kind)], 0, 0];
        message.extend(&body);
        if let Ok(decoded) = cdr::decode(&schema, &message) {
            prop_assert!(values(&Value::Struct(decoded)) <= 200 + 16 * message.len());
        }
        // Without a head that was made for it: it must only not panic.
        let _ = cdr::decode(&schema, &body);
    }

    #[test]
    fn random_text_is_a_definition_or_an_error_with_its_line(text in "[a-z0-9/ \\[\\]<=#\n]{0,200}") {
        if let Err(error) = schema::parse("a/msg/B", &text) {
            let said = error.to_string();
            prop_assert!(said.starts_with("message definition of a/msg/B, line "), "{said}");
        }
    }
}

/// Values in a tree; arrays of numbers are one, since they stay where they are.
pub(crate) fn values(value: &Value) -> usize {
    match value {
        Value::List(items) => 1 + items.iter().map(values).sum::<usize>(),
        Value::Struct(part) => 1 + part.fields.iter().map(|(_, v)| values(v)).sum::<usize>(),
        _ => 1,
    }
}

#[test]
fn lengths_beyond_the_message_are_errors_that_say_where() {
    let mut scan = Cdr::new(false);
    scan.header(0, "radar").u32(u32::MAX);
    let error = cdr::decode(&parsed("radar_msgs/RadarScan"), &scan.finish()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "cannot decode radar_msgs/RadarScan at byte 28 of the message: \
         4294967295 elements of `returns` in too few bytes"
    );

    let mut image = Cdr::new(false);
    image.header(0, "").text("jpeg").u32(u32::MAX - 7).u8(1);
    let error = cdr::decode(&parsed("sensor_msgs/CompressedImage"), &image.finish()).unwrap_err();
    assert!(error.to_string().ends_with("4294967288 bytes are needed and 1 are left"), "{error}");

    let mut header = Cdr::new(true);
    header.i32(0).u32(0).u32(u32::MAX);
    assert!(cdr::decode(&parsed("std_msgs/Header"), &header.finish()).is_err());
}

#[test]
fn wide_strings_are_utf_16_without_an_end() {
    let schema = schema::parse("a/msg/B", "wstring text\nuint8 behind").unwrap();
    for is_big_endian in [false, true] {
        let mut cdr = Cdr::new(is_big_endian);
        let units: Vec<u16> = "Zoë 🚗".encode_utf16().collect();
        cdr.u32(units.len() as u32);
        for unit in units {
            cdr.number(unit.to_le_bytes());
        }
        let message = cdr.u8(9).finish();
        let value = cdr::decode(&schema, &message).unwrap();
        assert_eq!(value.text("text").unwrap(), "Zoë 🚗");
        assert_eq!(value.int("behind").unwrap(), 9);
    }
}

#[test]
fn encodings_that_are_not_plain_cdr_are_named() {
    let error = cdr::decode(&parsed("std_msgs/Header"), &[0, 3, 0, 0, 0]).unwrap_err();
    assert!(error.to_string().ends_with("encapsulation 0x00 0x03 is not plain CDR"), "{error}");
    let error = cdr::decode(&parsed("std_msgs/Header"), &[0, 1]).unwrap_err();
    assert!(error.to_string().ends_with("shorter than its encapsulation header"), "{error}");
}

#[test]
fn definitions_that_cannot_be_read_are_errors_with_their_line() {
    let error = |text: &str| schema::parse("a/msg/B", text).unwrap_err().to_string();
    let begin = "message definition of a/msg/B, line ";
    assert_eq!(error("int32 a\n\nC c"), format!("{begin}3: type `C` is not defined in the log"));
    assert_eq!(error("int32"), format!("{begin}1: `int32` has a type and no name"));
    assert_eq!(error("int32[x] a"), format!("{begin}1: `x` is not an array size"));
    assert_eq!(error("int32[2 a"), format!("{begin}1: `int32[2`: no `]`"));
    assert_eq!(error("B b"), format!("{begin}1: type `a/B` contains itself"));
}

#[test]
fn a_definition_of_many_paths_is_read_as_fast_as_its_text() {
    // Every type holds the next one twice: 2 to the power of 50 ways from the top to the bottom.
    let mut text = "T1 a\nT1 b\n".to_string();
    for i in 1..50 {
        let fields = format!("T{0} a\nT{0} b", i + 1);
        text += &format!("===\nMSG: a/T{i}\n{fields}\n");
    }
    text += "===\nMSG: a/T50\nuint8[0] nothing\n";
    let schema = schema::parse("a/msg/T0", &text).unwrap();
    // Nothing in it takes a byte, so that the message's end is no end.
    let error = cdr::decode(&schema, &[0, 1, 0, 0, 0, 0, 0, 0]).unwrap_err();
    assert!(error.to_string().ends_with("more parts than a message may have"), "{error}");
}

#[test]
fn a_definition_that_nests_too_deeply_is_an_error() {
    let mut text = "T1 a\n".to_string();
    for i in 1..200_000 {
        text += &format!("===\nMSG: a/T{i}\nT{} a\n", i + 1);
    }
    text += "===\nMSG: a/T200000\nuint8 end\n";
    let error = schema::parse("a/msg/T0", &text).unwrap_err();
    assert!(error.to_string().ends_with("nests more than 64 deep"), "{error}");
}
