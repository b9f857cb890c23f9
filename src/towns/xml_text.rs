//! Writing XML: indented elements, one a line.

use std::fmt::Write as _;

/// A document that grows.
pub struct Xml {
    pub text: String,
    depth: usize,
}

impl Default for Xml {
    fn default() -> Self {
        Xml { text: "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n".to_string(), depth: 0 }
    }
}

impl Xml {
    /// Begin an element that has others in it.
    pub fn open(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.tag(name, attributes, ">");
        self.depth += 1;
    }

    /// An element without content.
    pub fn empty(&mut self, name: &str, attributes: &[(&str, &str)]) {
        self.tag(name, attributes, "/>");
    }

    /// End the element that was begun last.
    pub fn close(&mut self, name: &str) {
        self.depth -= 1;
        self.line(&format!("</{name}>"));
    }

    fn tag(&mut self, name: &str, attributes: &[(&str, &str)], end: &str) {
        let mut line = format!("<{name}");
        for (key, value) in attributes {
            line.push_str(&format!(" {key}=\"{value}\""));
        }
        line.push_str(end);
        self.line(&line);
    }

    /// A line as it is.
    pub fn line(&mut self, line: &str) {
        let indent = 2 * self.depth;
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{:indent$}{line}", "");
    }
}

/// What is smaller is rounding.
const ZERO: f64 = 1e-12;

/// A number with twelve digits that count: what lies beyond is rounding, which may differ between
/// platforms.
pub fn number(value: f64) -> String {
    let rounded = format!("{value:.11e}").parse().unwrap_or(value);
    if rounded.abs() < ZERO { "0".to_string() } else { rounded.to_string() }
}
