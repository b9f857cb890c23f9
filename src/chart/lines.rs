//! Lines through points, with bands where the points are not certain.

use crate::chart::{
    plot::{Plot, Size},
    scale::Axis,
};

/// One line.
#[derive(Clone, Debug, PartialEq)]
pub struct Line<'a> {
    pub colour: &'a str,
    pub points: Vec<Point>,
}

/// A point of a [`Line`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub interval: Option<[f64; 2]>,
}

/// Lines over the same axes. What lies above the y-axis is left out: the line ends there.
pub fn lines(title: &str, size: Size, x: Axis, y: Axis, lines: &[Line]) -> String {
    let mut plot = Plot::new(title, size, x, y);
    for line in lines {
        let inside: Vec<&Point> = line.points.iter().take_while(|p| plot.holds_y(p.y)).collect();
        let band: Vec<[f64; 3]> = inside
            .iter()
            .filter_map(|point| point.interval.map(|[low, high]| [point.x, low, high]))
            .collect();
        plot.band(&band, line.colour);
        let points: Vec<[f64; 2]> = inside.iter().map(|point| [point.x, point.y]).collect();
        plot.line(&points, line.colour, false);
        for point in points {
            plot.dot(point, None, 0.0, line.colour);
        }
    }
    plot.finish()
}
