//! Bars side by side in groups.

use crate::chart::{
    plot::{Plot, Size},
    scale::Axis,
};

/// The bars of one colour: one in each group, `None` where there is nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Bars<'a> {
    pub colour: &'a str,
    pub values: Vec<Option<f64>>,
}

/// Share of a group's width that its bars take.
const FILLED: f64 = 0.8;

/// Groups along the x-axis. What is higher than the y-axis is cut off there.
pub fn bars(title: &str, size: Size, groups: &[&str], y: Axis, bars: &[Bars]) -> String {
    let low = y.low.max(0.0).min(y.high);
    let mut plot = Plot::new(title, size, Axis::things(groups.iter().copied()), y);
    let width = FILLED / bars.len().max(1) as f64;
    for (i, series) in bars.iter().enumerate() {
        for (group, value) in series.values.iter().enumerate() {
            let Some(value) = value else { continue };
            let left = group as f64 - FILLED / 2.0 + width * i as f64;
            plot.area_of([left, left + width * 0.92], [low, *value], series.colour, 1.0);
        }
    }
    plot.finish()
}
