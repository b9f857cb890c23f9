//! What all binaries share: exit codes, how an error looks, progress on stderr.

use std::{borrow::Cow, process::ExitCode, time::Duration};

use indicatif::{ProgressBar, ProgressStyle};

use crate::error::{Error, Result};

/// How a run ended when it did not fail. Failure is `Err`, exit 1; clap exits 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Everything asked for was done. Exit 0.
    Done,
    /// Done, but something was left out, and the report says what. Exit 3.
    DoneWithLoss,
    /// Done, and what was judged does not pass; the report says why. Exit 1.
    Rejected,
}

/// Run a binary's body, print what went wrong once, and pick the exit code.
pub fn main(body: impl FnOnce() -> Result<Outcome>) -> ExitCode {
    match body() {
        Ok(Outcome::Done) => ExitCode::from(0),
        Ok(Outcome::DoneWithLoss) => ExitCode::from(3),
        Ok(Outcome::Rejected) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error}");
            if let Some(hint) = error.hint() {
                eprintln!("\nhint: {hint}");
            }
            ExitCode::from(1)
        }
    }
}

/// A progress bar on stderr with rate and time left; draws nothing where stderr is no terminal.
///
/// `unit` is the plural of what is counted: "frames", "steps".
pub fn progress(total: u64, unit: &'static str, what: impl Into<Cow<'static, str>>) -> ProgressBar {
    let template = format!(
        "{{prefix}} {{wide_bar}} {{human_pos}}/{{human_len}} {unit}, {{per_sec}}, {{eta}} left {{msg}}"
    );
    let style =
        ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(total).with_style(style).with_prefix(what);
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// The threads of a job: `jobs`, or one a core.
///
/// # Errors
///
/// [`Error::Config`] if `jobs` is 0 or the system gives no threads.
pub fn thread_pool(jobs: Option<usize>) -> Result<rayon::ThreadPool> {
    let fail = |what: String| Error::Config { key: "--jobs".into(), what, hint: None };
    if jobs == Some(0) {
        return Err(fail("at least 1 is needed".to_string()));
    }
    let builder = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0));
    builder.build().map_err(|error| fail(error.to_string()))
}

/// Print to stdout, treating a closed pipe (`pmp-stats D | head`) as success.
///
/// # Errors
///
/// [`Error::Io`] if stdout cannot be written for another reason.
pub fn print(text: &str) -> Result<()> {
    use std::io::Write as _;
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Error::io("write", "standard output")(error))
        }
        _ => Ok(()),
    }
}
