//! Colours, and text that is safe in SVG and HTML.

/// The colour of text: black in a file, that of the text around it in a page.
pub const INK: &str = "currentColor";

/// Okabe and Ito's colours but black, which colour-blind readers can tell apart.
pub const COLOURS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#b3a500"];

/// The colour of the n-th thing; they repeat.
pub fn colour(n: usize) -> &'static str {
    COLOURS[n % COLOURS.len()]
}

/// Text as it may stand between tags and in attributes.
pub fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;")
}
