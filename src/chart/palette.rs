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

/// Anchors of viridis (Smith and van der Walt, 2015): dark is little, and grey prints keep the order.
const VIRIDIS: [[u8; 3]; 5] = [
    [0x44, 0x01, 0x54],
    [0x3b, 0x52, 0x8b],
    [0x21, 0x91, 0x8c],
    [0x5e, 0xc9, 0x62],
    [0xfd, 0xe7, 0x25],
];

/// From red over pale grey to blue: below, at and above a middle.
const DIVERGING: [[u8; 3]; 5] = [
    [0xd5, 0x5e, 0x00],
    [0xf0, 0xb4, 0x8a],
    [0xe8, 0xe8, 0xe8],
    [0x8c, 0xbd, 0xdd],
    [0x00, 0x72, 0xb2],
];

/// The colour of a share in 0 ... 1 of a range.
pub fn sequential(share: f64) -> String {
    between(&VIRIDIS, share)
}

/// The same of a range whose middle means nothing.
pub fn diverging(share: f64) -> String {
    between(&DIVERGING, share)
}

fn between(anchors: &[[u8; 3]; 5], share: f64) -> String {
    let at = share.clamp(0.0, 1.0) * 4.0;
    let from = (at as usize).min(3);
    let mix = |i: usize| {
        let [low, high] = [anchors[from][i], anchors[from + 1][i]].map(f64::from);
        (low + (high - low) * (at - from as f64)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// Text as it may stand between tags and in attributes.
pub fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;")
}
