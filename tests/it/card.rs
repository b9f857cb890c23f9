//! The card of a dataset: what it says, and that a person's words stay.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use pmp::dataset::{
    card::{CARD, card},
    manifest::Manifest,
};

use crate::ingest::{into, same_trees, three_logs};

#[test]
fn an_ingest_writes_a_card_and_leaves_a_persons_words_alone() {
    let (folder, logs) = three_logs(1.0);
    let logs: Vec<&Path> = logs.iter().map(AsRef::as_ref).collect();
    let [whole, resumed] = ["whole", "resumed"].map(|name| folder.path().join(name));
    for dataset in [&whole, &resumed] {
        assert_eq!(into(dataset, &logs).code, 0);
    }
    let manifest = Manifest::read(&whole).unwrap();
    let text = fs::read_to_string(whole.join(CARD)).unwrap();
    assert_eq!(text, card(&manifest).unwrap());
    assert!(text.starts_with("---\nlicense: unknown\n"), "{text}");
    assert!(text.contains("size_categories:\n- n<1K\n"), "{text}");
    assert!(text.contains(&format!("`{}`", manifest.identity())), "{text}");
    assert!(text.contains("| `steer` | f32 |"), "every column is listed");

    // Before the manifest, as after a kill: a card of pmp's is written anew, though it is of fewer
    // logs.
    let fewer = folder.path().join("fewer");
    assert_eq!(into(&fewer, &logs[..1]).code, 0);
    fs::remove_file(Manifest::path(&resumed)).unwrap();
    fs::copy(fewer.join(CARD), resumed.join(CARD)).unwrap();
    assert_eq!(into(&resumed, &logs).code, 0);
    same_trees(&whole, &resumed);
    // One that a person has changed stays.
    let changed = text.replace("license: unknown", "license: mit");
    fs::write(resumed.join(CARD), &changed).unwrap();
    for is_finished in [true, false] {
        if !is_finished {
            fs::remove_file(Manifest::path(&resumed)).unwrap();
        }
        assert_eq!(into(&resumed, &logs).code, 0);
        assert_eq!(fs::read_to_string(resumed.join(CARD)).unwrap(), changed);
    }
}
