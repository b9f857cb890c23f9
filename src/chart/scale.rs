//! From numbers to a line with marks on it.

/// What lies along one side of a plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    pub label: String,
    pub low: f64,
    pub high: f64,
    /// Where a mark is, and what it says.
    pub ticks: Vec<(f64, String)>,
}

impl Axis {
    /// From 0 to the first mark that is not below `high`, or to 1 if that is not above 0.
    pub fn from_zero(label: &str, high: f64, lines: u32) -> Self {
        let lines = lines.max(1);
        let step =
            round_step(if high > 0.0 { high / f64::from(lines) } else { 1.0 / f64::from(lines) });
        let marks = (high / step).ceil().max(1.0) as u32;
        Self::of_ticks(label, (0..=marks).map(|i| step * f64::from(i)), step)
    }

    /// From the mark below `low` to the one above `high`; around them if they are the same.
    pub fn around(label: &str, low: f64, high: f64, lines: u32) -> Self {
        let (low, high) = if high > low { (low, high) } else { (low - 0.5, low + 0.5) };
        let step = round_step((high - low) / f64::from(lines.max(1)));
        let (first, last) = ((low / step).floor() as i64, (high / step).ceil() as i64);
        Self::of_ticks(label, (first..=last).map(|i| step * i as f64), step)
    }

    /// Shares from 0 to 1.
    pub fn shares(label: &str) -> Self {
        Self::of_ticks(label, (0..=4).map(|i| f64::from(i) * 0.25), 0.25)
    }

    /// Of logarithms to base 10, between exactly these, with a mark at every power of ten.
    pub fn log10(label: &str, low: f64, high: f64) -> Self {
        let powers = low.ceil() as i64..=high.floor() as i64;
        let said = |power: i64| match power {
            -3..=3 => number(10f64.powi(power as i32), 10f64.powi(power as i32)),
            _ => format!("1e{power}"),
        };
        let ticks = powers.map(|power| (power as f64, said(power))).collect();
        Self { label: label.to_string(), low, high, ticks }
    }

    /// Things side by side, the i-th at i.
    pub fn things<'a>(names: impl IntoIterator<Item = &'a str>) -> Self {
        let ticks: Vec<_> =
            names.into_iter().enumerate().map(|(i, name)| (i as f64, name.to_string())).collect();
        Self { label: String::new(), low: -0.5, high: ticks.len() as f64 - 0.5, ticks }
    }

    fn of_ticks(label: &str, ticks: impl Iterator<Item = f64>, step: f64) -> Self {
        let ticks: Vec<_> = ticks.map(|at| (at, number(at, step))).collect();
        let end = |tick: Option<&(f64, String)>| tick.map_or(0.0, |(at, _)| *at);
        let (low, high) = (end(ticks.first()), end(ticks.last()));
        Self { label: label.to_string(), low, high, ticks }
    }

    /// Where a number lies between both ends, 0 to 1 inside.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// Whether a number lies between the ends.
    pub fn holds(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// A number with as many places as steps of that size need.
pub fn number(value: f64, step: f64) -> String {
    let mut places = (-step.log10().floor()).max(0.0) as usize;
    // 0.25 needs a place more than 0.2.
    let shifted = step * 10f64.powi(places as i32);
    places += usize::from((shifted - shifted.round()).abs() > 1e-6);
    let text = format!("{value:.places$}");
    if text.trim_start_matches(['-', '0', '.']).is_empty() { text.replace('-', "") } else { text }
}

/// The least of 1, 2, 2.5 and 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let power = 10_f64.powf(step.log10().floor());
    let factor =
        [1.0, 2.0, 2.5, 5.0].into_iter().find(|factor| factor * power >= step * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}
