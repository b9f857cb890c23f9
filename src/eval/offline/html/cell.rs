//! How a number stands in a table.

use crate::{eval::offline::report::Estimate, page::tags::MISSING};

/// A number with its interval beneath.
pub fn cell(estimate: &Estimate) -> String {
    let Some(value) = estimate.value else { return MISSING.to_string() };
    let interval = estimate
        .interval
        .map_or(String::new(), |[low, high]| format!("<br><small>{low:.3} … {high:.3}</small>"));
    format!("{value:.3}{interval}")
}
