//! `schemas/run.v2.json` and `schemas/train*.toml` against what a training writes.

use std::{collections::BTreeSet, fs, path::Path};

use pmp::model::{
    config::TrainConfig,
    net_config::{Model, Preset},
};
use serde_json::Value;

use crate::training::{run, small};

/// Paths of all values: `.` between keys, `[]` for the items of a list.
fn paths(value: &Value, at: &str, into: &mut BTreeSet<String>) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let key = if at.starts_with("checkpoints") { "*" } else { key };
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

fn schemas() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas")
}

#[test]
fn run_schema_lists_exactly_the_fields_that_a_training_writes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    run(&small(), &out, false).unwrap();

    let schema = fs::read_to_string(schemas().join("run.v2.json")).unwrap();
    let schema: Value = serde_json::from_str(&schema).unwrap();
    for file in ["run.json", "metrics.jsonl"] {
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

#[test]
fn configuration_files_explain_every_key_with_its_default() {
    for (file, model) in
        [("train.toml", Model::Pmp), ("train.cil.toml", Model::Cil), ("train.int.toml", Model::Int)]
    {
        let text = fs::read_to_string(schemas().join(file)).unwrap();
        let default = TrainConfig::preset(model, Preset::Tiny);
        assert_eq!(TrainConfig::from_toml(&text, None, None).unwrap(), default, "{file}");

        let has = toml::from_str::<toml::Table>(&text).unwrap();
        let all = toml::Table::try_from(&default).unwrap();
        let keys = |table: &toml::Table, at: &str| {
            let mut keys = BTreeSet::new();
            for (key, value) in table {
                match value {
                    toml::Value::Table(_) => keys.insert(format!("[{at}{key}]")),
                    _ => keys.insert(format!("{at}{key}")),
                };
            }
            keys
        };
        let whole = |table: &toml::Table| {
            let (net, picture) = (table["net"].as_table(), table["net"]["picture"].as_table());
            [keys(net.unwrap(), "net."), keys(picture.unwrap(), "net.picture.")]
        };
        assert_eq!(whole(&has), whole(&all), "{file}");
        if file == "train.toml" {
            assert_eq!(keys(&has, ""), keys(&all, ""));
            let loss = |table: &toml::Table| keys(table["loss"].as_table().unwrap(), "loss.");
            assert_eq!(loss(&has), loss(&all));
        }
    }
}
