//! `README.md` of a dataset: for people, and with a head for Hugging Face's hub and `datasets`.
//!
//! Made of the manifest alone, so the same dataset has the same card. Its last line has a hash of
//! what stands above: while that fits, the card is pmp's and written anew with the manifest; once
//! a person has changed it, it is left alone.

use std::{collections::BTreeMap, fmt::Write as _, fs, io, path::Path};

use serde::Deserialize;

use crate::{
    atomic,
    dataset::{
        manifest::{Change, LogRecord, Manifest},
        split::Split,
    },
    digits::grouped,
    error::{Error, Result},
};

/// Name of the card.
pub const CARD: &str = "README.md";

const COLUMNS: &str = include_str!("../../schemas/frame.v1.json");

/// Begins the last line of a card.
const SEAL: &str = "<!-- pmp card ";

/// Upper bounds of Hugging Face's size categories.
const SIZES: [(u64, &str); 6] = [
    (1_000, "n<1K"),
    (10_000, "1K<n<10K"),
    (100_000, "10K<n<100K"),
    (1_000_000, "100K<n<1M"),
    (10_000_000, "1M<n<10M"),
    (u64::MAX, "n>10M"),
];

#[derive(Deserialize)]
struct Listing {
    columns: Vec<Column>,
}

#[derive(Deserialize)]
struct Column {
    name: String,
    #[serde(rename = "type")]
    type_name: String,
    unit: Option<String>,
    meaning: String,
}

/// Write the card of a dataset, unless there is one that a person has changed.
///
/// # Errors
///
/// [`Error::Io`] if the disk refuses.
pub fn write_card(dataset: &Path, manifest: &Manifest) -> Result<()> {
    let path = dataset.join(CARD);
    match fs::read_to_string(&path) {
        Ok(found) if !is_sealed(&found) => return Ok(()),
        Err(error) if error.kind() == io::ErrorKind::InvalidData => return Ok(()),
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            return Err(Error::io("read", &path)(error));
        }
        _ => {}
    }
    atomic::write(&path, card(manifest)?.as_bytes())?;
    Ok(())
}

/// Whether a card is as pmp wrote it.
fn is_sealed(card: &str) -> bool {
    card.rfind(SEAL).is_some_and(|at| card[at..] == seal(&card[..at]))
}

fn seal(text: &str) -> String {
    let hash = &atomic::sha256(text.as_bytes())[..16];
    format!("{SEAL}{hash}: once this page is changed, pmp leaves it alone -->\n")
}

/// The card of a dataset.
///
/// # Errors
///
/// [`Error::Json`] if the listing of columns that is compiled in is no such listing: a bug.
pub fn card(manifest: &Manifest) -> Result<String> {
    let mut card = head(manifest);
    card.push_str(&amounts(manifest));
    card.push_str(&conditions(manifest));
    card.push_str(READING);
    card.push_str(&columns()?);
    card.push_str(&provenance(manifest));
    let seal = seal(&card);
    card.push_str(&seal);
    Ok(card)
}

fn of_side(manifest: &Manifest, side: Split) -> Vec<&LogRecord> {
    manifest.logs.iter().filter(|log| log.split == side).collect()
}

fn head(manifest: &Manifest) -> String {
    let size = SIZES.iter().find(|(bound, _)| manifest.frames < *bound);
    let size = size.map_or(SIZES[0].1, |(_, name)| name);
    let mut head = format!(
        "---\nlicense: unknown\ntask_categories:\n- robotics\ntags:\n- autonomous-driving\n- pmp\n\
         size_categories:\n- {size}\nconfigs:\n- config_name: default\n  data_files:\n"
    );
    for side in Split::ALL {
        if !of_side(manifest, side).is_empty() {
            let name = side.name();
            let _ = writeln!(head, "  - split: {name}\n    path: frames/split={name}/*.parquet");
        }
    }
    let rate_hz = manifest.config.rate_hz;
    let camera = &manifest.config.profile.camera;
    let _ = write!(
        head,
        "---\n\n# Recorded drives, frame by frame\n\nWhat a car sensed, its state, and what it did \
         in the next 3 s, {rate_hz} times a second: a picture of {} x {} pixels, lidar and radar \
         projected onto it, the way ahead, the driver's action and the future motion. Units are SI, \
         angles radians; the ego frame has x forward, y left, z up. Identity: `{}`.\n\n",
        camera.width,
        camera.height,
        manifest.identity()
    );
    head
}

fn amounts(manifest: &Manifest) -> String {
    let mut text =
        "| side | episodes | frames | hours | km |\n|---|---:|---:|---:|---:|\n".to_string();
    for side in Split::ALL {
        let logs = of_side(manifest, side);
        let episodes: usize = logs.iter().map(|log| log.episodes.len()).sum();
        let frames: u64 = logs.iter().map(|log| log.frames).sum();
        let hours = frames as f64 / manifest.config.rate_hz / 3600.0;
        let km = logs.iter().map(|log| log.distance_m).sum::<f64>() / 1000.0;
        let (name, frames) = (side.name(), grouped(frames));
        let _ = writeln!(text, "| {name} | {episodes} | {frames} | {hours:.2} | {km:.1} |");
    }
    text.push_str("\nAll episodes of a log are on one side.\n\n");
    text
}

fn conditions(manifest: &Manifest) -> String {
    type Pick = fn(&LogRecord) -> &Option<String>;
    let kinds: [(&str, Pick); 4] = [
        ("town", |log| &log.conditions.town),
        ("weather", |log| &log.conditions.weather),
        ("illumination", |log| &log.conditions.illumination),
        ("traffic", |log| &log.conditions.traffic),
    ];
    let mut text = "## Conditions\n\nFrames by what is known of the surroundings.\n\n".to_string();
    for (kind, pick) in kinds {
        let mut frames: BTreeMap<&str, u64> = BTreeMap::new();
        for log in &manifest.logs {
            *frames.entry(pick(log).as_deref().unwrap_or("unknown")).or_default() += log.frames;
        }
        let listed = frames.iter().map(|(name, count)| format!("{name} {}", grouped(*count)));
        let _ = writeln!(text, "- {kind}: {}", listed.collect::<Vec<_>>().join(", "));
    }
    text.push('\n');
    text
}

const READING: &str = r#"## Reading

In Python with polars, in SQL with DuckDB, with Hugging Face's `datasets`:

```python
import polars as pl
frames = pl.scan_parquet("frames/*/*.parquet", hive_partitioning=True)
frames.group_by("command").agg(pl.len(), pl.col("steer").abs().mean()).collect()
```

```sql
SELECT split, count(*), avg(velocity[1]) FROM read_parquet('frames/*/*.parquet', hive_partitioning = true) GROUP BY split;
```

```python
from datasets import load_dataset
frames = load_dataset(".", split="train")
```

`episodes.parquet` has one row an episode, with what was left out of it and why; `manifest.json` names
every log and every file with its checksum.

"#;

fn columns() -> Result<String> {
    let listing: Listing =
        serde_json::from_str(COLUMNS).map_err(Error::json("schemas/frame.v1.json"))?;
    let mut text =
        "## Columns\n\n| column | type | unit | meaning |\n|---|---|---|---|\n".to_string();
    for Column { name, type_name, unit, meaning } in listing.columns {
        let meaning = meaning.replace('|', "\\|");
        let unit = unit.unwrap_or_default();
        let _ = writeln!(text, "| `{name}` | {type_name} | {unit} | {meaning} |");
    }
    text.push('\n');
    Ok(text)
}

fn provenance(manifest: &Manifest) -> String {
    let logs = manifest.logs.len();
    let mut text = format!("## Provenance\n\nWritten by {}", manifest.written_by);
    let of = |edit: &crate::dataset::manifest::Edit| {
        let names = edit.of.iter().map(|origin| format!("`{}`", origin.identity));
        names.collect::<Vec<_>>().join(", ")
    };
    let _ = match &manifest.edit {
        None => write!(text, " from {} recorded logs (MCAP)", grouped(logs as u64)),
        Some(edit) => match &edit.change {
            Change::Merge => write!(text, ": the datasets {} put together", of(edit)),
            Change::Drop { episodes } => {
                write!(text, ": {} without {} of its episodes", of(edit), episodes.len())
            }
            Change::Resplit { rule, .. } => {
                write!(text, ": {} with its sides dealt out anew by `{rule}`", of(edit))
            }
        },
    };
    text.push_str(
        ". `manifest.json` has the configuration, and of every log its name, its SHA-256, and what \
         became of its messages.\n\n",
    );
    text
}
