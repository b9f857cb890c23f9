//! What the fuzzer was started from and what it once found, run again: `fuzz/corpus/TARGET/`.

use std::{fs, path::Path};

#[path = "../../fuzz/inputs.rs"]
mod inputs;

/// Runs an input; whether it was understood.
type Run = fn(&[u8]) -> bool;

#[test]
fn no_input_of_the_corpus_panics_and_every_seed_is_understood() {
    let targets: [(&str, Run); 7] = [
        ("mcap", inputs::mcap),
        ("cdr", inputs::cdr),
        ("ros1", inputs::ros1),
        ("protobuf", inputs::protobuf),
        ("json", inputs::json),
        ("cloud", inputs::cloud),
        ("jpeg", inputs::jpeg),
    ];
    for (target, run) in targets {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
        let mut seeds = 0;
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let is_understood = run(&fs::read(&path).unwrap());
            if path.file_name().unwrap().to_string_lossy().starts_with("seed-") {
                assert!(is_understood, "{}", path.display());
                seeds += 1;
            }
        }
        assert!(seeds > 2, "{target} has {seeds} seeds");
    }
}
