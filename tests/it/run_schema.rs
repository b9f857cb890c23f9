//! `schemas/run.v1.json` against what a training writes.

use std::{collections::BTreeSet, fs, path::Path};

use serde_json::Value;

use crate::training::{run, small};

/// Paths of all values: `.` between keys, `[]` for the items of a list.
fn paths(value: &Value, at: &str, into: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let key = if at == "sha256" { "*" } else { key };
                let dot = if at.is_empty() { "" } else { "." };
                paths(value, &format!("{at}{dot}{key}"), into);
            }
        }
        Value::Array(items) => items.iter().for_each(|item| paths(item, &format!("{at}[]"), into)),
        _ => {
            into.insert(at.to_string());
        }
    }
}

#[test]
fn run_schema_lists_exactly_the_fields_that_a_training_writes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    run(&small(), &out, false).unwrap();

    let schema = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/run.v1.json");
    let schema: Value = serde_json::from_str(&fs::read_to_string(schema).unwrap()).unwrap();
    for file in ["run.json", "config.json", "metrics.jsonl"] {
        let mut written = BTreeSet::new();
        let text = fs::read_to_string(out.join(file)).unwrap();
        for value in serde_json::Deserializer::from_str(&text).into_iter::<Value>() {
            paths(&value.unwrap(), "", &mut written);
        }
        let listed = schema[file].as_array().unwrap().iter();
        let listed: BTreeSet<_> = listed.map(|f| f["path"].as_str().unwrap().to_string()).collect();
        assert_eq!(written, listed, "{file}");
    }
}
