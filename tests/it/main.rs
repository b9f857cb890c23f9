//! All integration tests, as one binary: linking it once is what takes the time.

mod architecture;
mod schemas;
mod evaluation;
mod evaluation_report;
