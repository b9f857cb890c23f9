//! Numbers in, SVG out: pictures that need no script and stand in a page, a paper or a README.
//!
//! ```text
//! numbers -> scale -> plot (axes, marks) -> lines, bars, histogram, density, reliability -> SVG
//! ```
//!
//! What is black on white in a file takes the colours of a page that it is put into: ink is
//! `currentColor`, and the classes `paper` and `grid` can be styled.

pub mod palette;
pub mod scale;
pub mod plot;
pub mod lines;
pub mod bars;
pub mod histogram;
pub mod density;
pub mod reliability;
