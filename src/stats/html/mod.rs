//! A dataset as one page to look at: no script, no network, nothing beside the file.
//!
//! ```text
//! summary ──── amounts, left_out, coverage
//! verdict ──── findings
//! survey ───── values, skews, ways, gaps                    ─ page
//! moments ──── view (a picture with its returns) ─ mosaic, channels
//! ```

pub mod amounts;
pub mod left_out;
pub mod findings;
pub mod coverage;
pub mod view;
pub mod mosaic;
pub mod channels;
pub mod values;
pub mod ways;
pub mod gaps;
pub mod page;
