//! A grid of runs: a configuration, keys with several values, and every combination of them.

use std::fmt::Write as _;

use crate::{
    error::{Error, Result},
    model::{
        config::TrainConfig,
        metrics::ValidationLine,
        net_config::{Model, Preset},
    },
};

/// Runs of a sweep, at most.
const MAX_RUNS: usize = 1000;

/// A run of the grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridRun {
    /// Its key-value pairs, `lr=0.001,seed=2`: the name of its directory.
    pub name: String,
    pub config: TrainConfig,
}

/// The runs of a TOML text: a configuration as [`TrainConfig::from_toml`] takes it, with a table
/// `[grid]` of keys (`lr`, `"net.modes"`) and the lists of their values. The last key varies
/// fastest.
///
/// # Errors
///
/// [`Error::Config`] if there is no grid, one of its entries is no list, or a configuration of it
/// is refused.
pub fn expand(text: &str, model: Option<Model>, preset: Option<Preset>) -> Result<Vec<GridRun>> {
    let wrong = |key: &str, what: String| Error::Config {
        key: key.into(),
        what,
        hint: Some("[grid]\nlr = [1e-3, 3e-4]\n\"net.modes\" = [1, 3]".into()),
    };
    let mut file: toml::Table =
        toml::from_str(text).map_err(|e| wrong("grid", e.to_string().trim_end().into()))?;
    let Some(toml::Value::Table(grid)) = file.remove("grid") else {
        return Err(wrong("grid", "there is no table of that name".into()));
    };
    let mut runs = vec![(String::new(), file)];
    for (key, values) in &grid {
        let toml::Value::Array(values) = values else {
            return Err(wrong(key, "must be a list of values".into()));
        };
        if values.is_empty() || runs.len() * values.len() > MAX_RUNS {
            let what = format!("must have values, and not make more than {MAX_RUNS} runs");
            return Err(wrong(key, what));
        }
        let mut more = vec![];
        for (name, file) in &runs {
            for value in values {
                let comma = if name.is_empty() { "" } else { "," };
                let mut file = file.clone();
                set(&mut file, key, value.clone())?;
                more.push((format!("{name}{comma}{key}={}", plain(value)), file));
            }
        }
        runs = more;
    }
    let config = |(name, file): (String, toml::Table)| {
        let config = TrainConfig::from_table(file, model, preset)?;
        Ok(GridRun { name, config })
    };
    runs.into_iter().map(config).collect()
}

/// Set `a.b` in a table of tables.
fn set(table: &mut toml::Table, key: &str, value: toml::Value) -> Result<()> {
    match key.split_once('.') {
        None => {
            table.insert(key.to_string(), value);
        }
        Some((first, rest)) => {
            let inner = table.entry(first).or_insert_with(|| toml::Table::new().into());
            let toml::Value::Table(inner) = inner else {
                return Err(Error::Config {
                    key: first.into(),
                    what: "must be a table".into(),
                    hint: None,
                });
            };
            set(inner, rest, value)?;
        }
    }
    Ok(())
}

/// A value as part of the name of a directory.
fn plain(value: &toml::Value) -> String {
    let text = value.to_string();
    let keep = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '+' | '_');
    text.chars().map(|c| if keep(c) { c } else { '_' }).collect::<String>().trim_matches('_').into()
}

/// Each run with its last validation, the smallest loss first, as Markdown.
pub fn table(results: &[(String, Option<ValidationLine>)]) -> String {
    let total = |line: &Option<ValidationLine>| {
        line.as_ref().map_or(f64::INFINITY, |line| line.terms.total)
    };
    let mut sorted: Vec<_> = results.iter().collect();
    sorted.sort_by(|a, b| total(&a.1).total_cmp(&total(&b.1)).then(a.0.cmp(&b.0)));
    let number = |x: Option<f64>| x.map_or("-".to_string(), |x| format!("{x:.4}"));
    let mut text =
        "| run | step | loss | action | motion |\n|---|---:|---:|---:|---:|\n".to_string();
    for (name, line) in sorted {
        let terms = line.as_ref().map(|line| line.terms);
        let [loss, action, motion] = [
            number(terms.map(|t| t.total)),
            number(terms.and_then(|t| t.action)),
            number(terms.and_then(|t| t.motion)),
        ];
        let step = line.as_ref().map_or("-".to_string(), |line| line.step.to_string());
        let _ = writeln!(text, "| {name} | {step} | {loss} | {action} | {motion} |");
    }
    text
}
