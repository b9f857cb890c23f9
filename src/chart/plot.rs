//! One plot: a title, two axes, and marks in between.

use std::fmt::Write as _;

use crate::chart::{
    palette::{INK, escaped},
    scale::Axis,
};

/// Size in pixels of the picture, of which the right `aside` is for notes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    pub width: f64,
    pub height: f64,
    pub aside: f64,
}

/// Of a plot that stands in a row with others.
pub const SMALL: Size = Size { width: 320.0, height: 230.0, aside: 0.0 };

/// Margins around the area of the marks.
const LEFT: f64 = 54.0;
const RIGHT: f64 = 14.0;
const TOP: f64 = 30.0;
const BOTTOM: f64 = 44.0;

/// An SVG in the making.
#[derive(Clone, Debug)]
pub struct Plot {
    svg: String,
    size: Size,
    x: Axis,
    y: Axis,
}

impl Plot {
    /// A title, axes with their marks, and lines across at the marks of the y-axis.
    pub fn new(title: &str, size: Size, x: Axis, y: Axis) -> Self {
        let Size { width, height, .. } = size;
        let title = escaped(title);
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" role=\"img\" aria-label=\"{title}\" \
             font-family=\"sans-serif\" font-size=\"11\" fill=\"{INK}\">\n\
             <rect class=\"paper\" width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n\
             <text x=\"{LEFT}\" y=\"17\" font-size=\"12\" font-weight=\"bold\">{title}</text>\n"
        );
        let mut plot = Self { svg, size, x, y };
        plot.axes();
        plot
    }

    fn axes(&mut self) {
        let [left, right, top, bottom] = self.area();
        for (at, said) in self.y.ticks.clone() {
            let y = self.y_px(at);
            let _ = writeln!(
                self.svg,
                "<path class=\"grid\" d=\"M{left:.1} {y:.1}H{right:.1}\" stroke=\"#dddddd\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 6.0,
                y + 4.0,
                escaped(&said)
            );
        }
        for (at, said) in self.x.ticks.clone() {
            let x = self.x_px(at);
            let _ = writeln!(
                self.svg,
                "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 15.0,
                escaped(&said)
            );
        }
        let (across, along) = ((left + right) / 2.0, (top + bottom) / 2.0);
        let (x_label, y_label) = (escaped(&self.x.label), escaped(&self.y.label));
        let _ = writeln!(
            self.svg,
            "<text x=\"{across:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x_label}</text>\n\
             <text transform=\"translate(12 {along:.1}) rotate(-90)\" text-anchor=\"middle\">\
             {y_label}</text>",
            bottom + 32.0
        );
    }

    /// Left, right, top and bottom of the marks, px.
    fn area(&self) -> [f64; 4] {
        let Size { width, height, aside } = self.size;
        [LEFT, width - RIGHT - aside, TOP, height - BOTTOM]
    }

    fn x_px(&self, x: f64) -> f64 {
        let [left, right, ..] = self.area();
        left + self.x.share(x) * (right - left)
    }

    fn y_px(&self, y: f64) -> f64 {
        let [_, _, top, bottom] = self.area();
        bottom - self.y.share(y).clamp(0.0, 1.0) * (bottom - top)
    }

    /// Whether a mark at that height can be seen.
    pub fn holds_y(&self, y: f64) -> bool {
        self.y.holds(y)
    }

    /// A line through points; dashed if it is there to compare with.
    pub fn line(&mut self, points: &[[f64; 2]], colour: &str, dashed: bool) {
        if points.len() < 2 {
            return;
        }
        let path: Vec<String> = points
            .iter()
            .map(|[x, y]| format!("{:.1} {:.1}", self.x_px(*x), self.y_px(*y)))
            .collect();
        let dashes = if dashed { " stroke-dasharray=\"4 4\"" } else { "" };
        let _ = writeln!(
            self.svg,
            "<path d=\"M{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{}\"{dashes}/>",
            path.join("L"),
            if dashed { 1 } else { 2 }
        );
    }

    /// The area between two lines over the same x: (x, low, high).
    pub fn band(&mut self, points: &[[f64; 3]], colour: &str) {
        let there = points.iter().map(|[x, low, _]| [self.x_px(*x), self.y_px(*low)]);
        let back = points.iter().rev().map(|[x, _, high]| [self.x_px(*x), self.y_px(*high)]);
        let path: Vec<String> = there.chain(back).map(|[x, y]| format!("{x:.1} {y:.1}")).collect();
        if points.len() > 1 {
            let _ = writeln!(
                self.svg,
                "<path d=\"M{}Z\" fill=\"{colour}\" fill-opacity=\"0.18\"/>",
                path.join("L")
            );
        }
    }

    /// A dot, `aside_px` to the right of its place, with its interval if it has one.
    pub fn dot(
        &mut self,
        [x, y]: [f64; 2],
        interval: Option<[f64; 2]>,
        aside_px: f64,
        colour: &str,
    ) {
        let at = self.x_px(x) + aside_px;
        if let Some([low, high]) = interval {
            let (low, high) = (self.y_px(low), self.y_px(high));
            let _ = writeln!(
                self.svg,
                "<path d=\"M{at:.1} {low:.1}V{high:.1}\" stroke=\"{colour}\" stroke-width=\"2\"/>"
            );
        }
        let _ = writeln!(
            self.svg,
            "<circle cx=\"{at:.1}\" cy=\"{:.1}\" r=\"3.5\" fill=\"{colour}\"/>",
            self.y_px(y)
        );
    }

    /// A box between two corners.
    pub fn area_of(&mut self, [x0, x1]: [f64; 2], [y0, y1]: [f64; 2], colour: &str, opacity: f64) {
        let (left, right) = (self.x_px(x0), self.x_px(x1));
        let (bottom, top) = (self.y_px(y0), self.y_px(y1));
        let _ = writeln!(
            self.svg,
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" \
             fill=\"{colour}\" fill-opacity=\"{opacity:.2}\"/>",
            (right - left).max(0.0),
            (bottom - top).max(0.0)
        );
    }

    /// A line of text in the room for notes, counted from the top.
    pub fn note(&mut self, row: usize, text: &str, colour: &str) {
        let x = self.size.width - self.size.aside + 6.0;
        let y = TOP + 14.0 + 18.0 * row as f64;
        let text = escaped(text);
        let _ =
            writeln!(self.svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" fill=\"{colour}\">{text}</text>");
    }

    /// The picture.
    pub fn finish(self) -> String {
        self.svg + "</svg>\n"
    }
}
