//! IDL definitions: the same types as the `.msg` texts that they were made from, and what errors say.
#![allow(clippy::unwrap_used)]

use pmp::log::{
    idl,
    schema::{self, Arity, Element, Schema},
    value::Scalar,
};
use proptest::prelude::*;

use crate::{
    decoding::{Random, random_definition},
    definitions::{self, TOPIC_TYPES, concatenated, idl_definition, schema_name, types},
};

/// As rosidl writes it.
const TEMPERATURE: &str = r#"================================================================================
IDL: sensor_msgs/msg/Temperature
// generated from rosidl_adapter/resource/msg.idl.em
// with input from sensor_msgs/msg/Temperature.msg
// generated code does not contain a copyright notice

#include "std_msgs/msg/Header.idl"

module sensor_msgs {
  module msg {
    @verbatim (language="comment", text=
      "Single temperature reading.")
    struct Temperature {
      @verbatim (language="comment", text=
        "timestamp is the time the temperature was measured" "\n"
        "frame_id is the location of the temperature reading")
      std_msgs::msg::Header header;

      @verbatim (language="comment", text=
        "Measurement of the Temperature in Degrees Celsius.")
      @unit (value="celsius")
      @default (value=-273.15)
      double temperature;

      double variance;
    };
  };
};

================================================================================
IDL: std_msgs/msg/Header
#include "builtin_interfaces/msg/Time.idl"
module std_msgs { module msg {
  struct Header { builtin_interfaces::msg::Time stamp; string frame_id; };
}; };
================================================================================
IDL: builtin_interfaces/msg/Time
module builtin_interfaces { module msg { struct Time { int32 sec; uint32 nanosec; }; }; };
"#;

fn fields(schema: &Schema) -> Vec<(&str, Element, Arity)> {
    let fields = schema.types[0].fields.iter();
    fields.map(|field| (field.name.as_str(), field.element, field.arity)).collect()
}

fn error(text: &str) -> String {
    idl::parse("a/msg/B", text).unwrap_err().to_string()
}

#[test]
fn a_definition_as_rosidl_writes_it_is_read() {
    let schema = idl::parse("sensor_msgs/msg/Temperature", TEMPERATURE).unwrap();
    let msg = "std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n===\n\
               MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n===\n\
               MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec";
    assert_eq!(schema, schema::parse("sensor_msgs/msg/Temperature", msg).unwrap());
}

#[test]
fn idl_of_every_topic_type_gives_the_types_of_its_msg_text() {
    for name in TOPIC_TYPES {
        let msg = schema::parse(&schema_name(name), &concatenated(name, &types())).unwrap();
        assert_eq!(idl::parse(&schema_name(name), &idl_definition(name)).unwrap(), msg, "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    #[test]
    fn idl_of_any_definition_gives_the_types_of_its_msg_text(seed in any::<u64>()) {
        let (name, types) = random_definition(&mut Random(seed));
        let msg = schema::parse(&schema_name(&name), &concatenated(&name, &types)).unwrap();
        let text = definitions::idl(&name, &types);
        match idl::parse(&schema_name(&name), &text) {
            Ok(schema) => prop_assert_eq!(schema, msg, "{}", text),
            Err(error) => prop_assert!(false, "{error}\n{text}"),
        }
    }

    #[test]
    fn random_idl_is_a_definition_or_an_error_with_its_line(
        words in prop::collection::vec(0..WORDS.len(), 0..60),
    ) {
        let words: Vec<&str> = words.into_iter().map(|at| WORDS[at]).collect();
        let text = format!("module a {{ module msg {{ {}", words.join(" "));
        if let Err(error) = idl::parse("a/msg/B", &text) {
            let said = error.to_string();
            prop_assert!(said.starts_with("message definition of a/msg/B, line "), "{said}");
        }
    }
}

/// What random definitions are made of.
const WORDS: [&str; 33] = [
    "struct",
    "B",
    "{",
    "}",
    ";",
    "};",
    "}; };",
    "long",
    "unsigned",
    "double",
    "x",
    "typedef",
    "T",
    "T x;",
    "long x;",
    "[3]",
    "[",
    "sequence",
    "<",
    ">",
    "sequence<T>",
    "string<4>",
    "const",
    "=",
    "@",
    "(",
    ")",
    "enum",
    "\"",
    "/*",
    "a::msg::B",
    "\n====\nIDL: a/msg/C\n",
    "ß",
];

#[test]
fn idl_that_is_cut_off_is_an_error_or_all_of_its_types() {
    let whole = idl::parse("sensor_msgs/msg/Temperature", TEMPERATURE).unwrap();
    for len in 0..TEMPERATURE.len() {
        match idl::parse("sensor_msgs/msg/Temperature", &TEMPERATURE[..len]) {
            Ok(schema) => assert!(schema == whole && len >= TEMPERATURE.len() - 2, "{len}"),
            Err(error) => {
                let said = error.to_string();
                assert!(said.starts_with("message definition of sensor_msgs/msg/"), "{said}");
            }
        }
    }
}

#[test]
fn typedefs_constants_enums_and_array_sizes_say_what_lies_in_a_message() {
    let text = "
        const unsigned short ROWS = 2;
        module a { module msg {
          module B_Constants { const long COLUMNS = 3; const string S = \"a;\" \"}\"; };
          typedef double Row[B_Constants::COLUMNS];
          typedef Row Matrix[ROWS];
          typedef sequence<octet, 8> Bytes;
          @appendable enum Gear { PARK, @value(4) DRIVE };
          struct Other;
          @final struct B {
            Matrix m; Row rows[4], row; Bytes bytes; Gear gear, gears[2]; wstring<5> w;
            sequence<string<3>, 5> names; ::a::msg::Other other; long long x[2][2];
          };
          struct Other { char c; };
        }; };";
    let schema = idl::parse("a/msg/B", text).unwrap();
    let scalar = Element::Scalar;
    let expected = [
        ("m", scalar(Scalar::F64), Arity::Array(6)),
        ("rows", scalar(Scalar::F64), Arity::Array(12)),
        ("row", scalar(Scalar::F64), Arity::Array(3)),
        ("bytes", scalar(Scalar::U8), Arity::Sequence),
        ("gear", scalar(Scalar::I32), Arity::One),
        ("gears", scalar(Scalar::I32), Arity::Array(2)),
        ("w", Element::WideString, Arity::One),
        ("names", Element::String, Arity::Sequence),
        ("other", Element::Struct(1), Arity::One),
        ("x", scalar(Scalar::I64), Arity::Array(4)),
    ];
    assert_eq!(fields(&schema), expected);
    assert_eq!((schema.types.len(), schema.types[1].name.as_str()), (2, "a/Other"));
}

#[test]
fn the_innermost_scope_that_knows_a_name_decides() {
    let text =
        "typedef long T; module a { typedef double T; module msg { struct B { T x; ::T y; }; }; };";
    let schema = idl::parse("a/msg/B", text).unwrap();
    let elements: Vec<Element> = fields(&schema).iter().map(|field| field.1).collect();
    assert_eq!(elements, [Element::Scalar(Scalar::F64), Element::Scalar(Scalar::I32)]);
}

#[test]
fn idl_that_cannot_be_read_is_an_error_with_its_line() {
    let members =
        |text: &str| error(&format!("module a {{ module msg {{\nstruct B {{\n{text}\n}};}};}};"));
    let begin = "message definition of a/msg/B, line ";
    let cases = [
        ("long x; Other y;", "3: type `Other` is not defined in the log"),
        ("long\n\nx y;", "5: `y` behind `x`"),
        ("long x[N];", "3: `x` has no array size"),
        ("long x[-1];", "3: `x` has no array size"),
        ("sequence<sequence<long>> x;", "3: lists of lists are not read"),
        ("sequence<long> x[2];", "3: lists of lists are not read"),
        ("long x[4294967296][4294967296];", "3: an array longer than the memory"),
        ("long double x;", "3: `long double` is not read"),
        ("unsigned double x;", "3: `unsigned double` is no type"),
        ("@optional long x;", "3: optional members are not read"),
        ("map<long, long> x;", "3: `<` where a name should be"),
        ("B x;", "1: type `a/B` contains itself"),
    ];
    for (text, what) in cases {
        assert_eq!(members(text), format!("{begin}{what}"), "{text}");
    }
    let cases = [
        ("", "1: no struct `a/B` is defined in the log"),
        ("module a {", "1: module `a` is not closed"),
        ("module a {\n===\nIDL: a/msg/C\n};", "2: module `a` is not closed"),
        ("union U switch (long) {", "1: `union` where a definition should begin"),
        ("struct A : B {};", "1: `A` inherits, which is not read"),
        ("@bit_bound(8) enum E { A };", "1: enums of other sizes than 4 bytes are not read"),
        ("\n@verbatim (text=\")", "2: `@verbatim(` has no end"),
        ("}", "1: `}` where a definition should begin"),
    ];
    for (text, what) in cases {
        assert_eq!(error(text), format!("{begin}{what}"), "{text}");
    }
    let text = "module a { module msg { typedef U T; typedef T U; struct B {\nT x; }; }; };";
    assert_eq!(error(text), format!("{begin}2: the typedefs behind `x` do not end"));
}

#[test]
fn idl_of_a_hostile_shape_is_read_as_fast_as_its_text() {
    assert!(
        error(&"module a {".repeat(100_000)).contains("the names of these modules are too long")
    );
    assert!(error(&"@a(".repeat(100_000)).contains("`@a(` has no end"));
    assert!(error(&"((((((".repeat(100_000)).contains("where a definition should begin"));
    assert!(
        error(&("const long A = ".to_string() + &"===".repeat(100_000) + "x")).contains("the end")
    );
    let mut text = "module a { module msg { struct B { T1 x; };".to_string();
    for i in 1..100_000 {
        text += &format!("struct T{i} {{ T{} x; }};", i + 1);
    }
    assert!(
        error(&(text + "struct T100000 { octet x; }; }; };")).ends_with("nests more than 64 deep")
    );
}
