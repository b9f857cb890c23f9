//! Several datasets put together.

use crate::{
    dataset::{
        edit::{
            conflicts::common_config,
            place::Plan,
            source::{Source, edit_of},
        },
        manifest::{Change, FailedLog},
    },
    error::Result,
};

/// All logs of all of them, each on the side where it was; the same for any order.
///
/// # Errors
///
/// As [`common_config`]: where they do not go together.
pub fn merge(sources: &[Source], mixed: bool) -> Result<Plan<'_>> {
    let config = common_config(sources, mixed)?;
    let mut failed: Vec<FailedLog> =
        sources.iter().flat_map(|source| source.manifest.failed.iter().cloned()).collect();
    failed.sort_by(|a, b| (&a.source_log, &a.error).cmp(&(&b.source_log, &b.error)));
    failed.dedup();
    Ok(Plan {
        edit: edit_of(Change::Merge, &sources.iter().collect::<Vec<_>>()),
        config,
        logs: sources.iter().flat_map(|source| source.choose(|log| log.split)).collect(),
        failed,
    })
}
