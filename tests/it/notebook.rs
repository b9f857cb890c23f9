//! The committed notebook: run, and with what it gave. `scripts/check.sh` runs it again.
#![allow(clippy::unwrap_used)]

use std::{fs, path::Path};

use serde_json::Value as Json;

#[test]
fn the_notebook_shows_what_it_gave_and_no_error() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/analysis.ipynb");
    let notebook: Json = serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let cells = notebook["cells"].as_array().unwrap();
    let of_kind = |kind: &str| cells.iter().filter(|cell| cell["cell_type"] == kind).count();
    assert!(of_kind("markdown") > 6, "every question is explained");
    let mut pictures = 0;
    for cell in cells.iter().filter(|cell| cell["cell_type"] == "code") {
        assert!(cell["execution_count"].is_u64(), "a cell was not run: {}", cell["source"]);
        for output in cell["outputs"].as_array().unwrap() {
            assert_ne!(output["output_type"], "error");
            assert_ne!(output["name"], "stderr", "{}", output["text"]);
            pictures += usize::from(output["data"]["image/png"].is_string());
            let said = output.to_string();
            assert!(!said.contains("/home/") && !said.contains("/tmp/"), "{said}");
        }
    }
    assert!(pictures >= 4, "{pictures} pictures");
}
