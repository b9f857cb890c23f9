//! Rows in, one number with its interval out, whatever way the rows become a number.

use crate::eval::{
    offline::{
        definitions::Measure,
        errors::Row,
        measures::{BINS, bin},
        report::Estimate,
    },
    statistics::{Bootstrap, mean},
};

/// Ranks and histograms are resampled this many times less often than means: each resample costs
/// as much as the number itself.
const DEARER: usize = 20;

/// Which unit each row belongs to, and how they are resampled.
#[derive(Clone, Copy, Debug)]
pub struct Resampling<'a> {
    pub bootstrap: &'a Bootstrap,
    pub unit_of: &'a [u32],
}

/// The number over these rows, with its interval if they are resampled.
pub fn estimate(measure: &Measure, rows: &[Row], resampling: Option<Resampling>) -> Estimate {
    match *measure {
        Measure::Mean(of) => {
            of_means(&rows.iter().map(of).collect::<Vec<_>>(), |mean| mean, resampling)
        }
        Measure::RootMeanSquare(of) => {
            let square = |row: &Row| of(row).map(|error| error * error);
            // The root keeps the order, so the ends of an interval may pass through it too.
            of_means(&rows.iter().map(square).collect::<Vec<_>>(), f64::sqrt, resampling)
        }
        Measure::Ratio(of) => {
            let sums: Vec<_> = rows.iter().map(of).collect();
            of_sums(&sums, |[part, whole]| (*whole > 0.0).then(|| part / whole), resampling)
        }
        Measure::Histogram(of, value) => {
            let counts = |row: &Row| {
                let mut counts = [0.0; BINS];
                let numbers = of(row.errors.mixture.as_ref()?);
                numbers.iter().for_each(|number| counts[bin(*number)] += 1.0);
                Some(counts)
            };
            let counts: Vec<_> = rows.iter().map(counts).collect();
            let fewer = resampling.map(Fewer::of);
            of_sums(&counts, |counts| Some(value(counts)), fewer.as_ref().map(Fewer::resampling))
        }
        Measure::Pairs(of, value) => {
            let pairs: Vec<_> = rows.iter().map(of).collect();
            let fewer = resampling.map(Fewer::of);
            of_pairs(&pairs, value, fewer.as_ref().map(Fewer::resampling))
        }
    }
}

/// The mean over what is there, after `finished`.
pub fn of_means(
    values: &[Option<f64>],
    finished: fn(f64) -> f64,
    resampling: Option<Resampling>,
) -> Estimate {
    let (mean, frames) = mean(values);
    let interval = resampling.and_then(|r| r.bootstrap.interval(values, r.unit_of));
    Estimate {
        value: mean.map(finished),
        interval: interval.map(|ends| ends.map(finished)),
        frames,
    }
}

/// Settings with fewer resamples.
struct Fewer<'a> {
    bootstrap: Bootstrap,
    unit_of: &'a [u32],
}

impl<'a> Fewer<'a> {
    fn of(resampling: Resampling<'a>) -> Self {
        let resamples = resampling.bootstrap.resamples.div_ceil(DEARER);
        let bootstrap = Bootstrap { resamples, ..*resampling.bootstrap };
        Fewer { bootstrap, unit_of: resampling.unit_of }
    }

    fn resampling(&self) -> Resampling<'_> {
        Resampling { bootstrap: &self.bootstrap, unit_of: self.unit_of }
    }
}

/// What follows from sums over rows.
fn of_sums<const N: usize>(
    rows: &[Option<[f64; N]>],
    value: impl Fn(&[f64; N]) -> Option<f64>,
    resampling: Option<Resampling>,
) -> Estimate {
    let add = |sums: &mut [f64; N], row: &[f64; N]| {
        sums.iter_mut().zip(row).for_each(|(sum, number)| *sum += number);
    };
    let mut all = [0.0; N];
    rows.iter().flatten().for_each(|row| add(&mut all, row));
    let frames = rows.iter().flatten().count() as u64;
    let interval = resampling.and_then(|r| {
        let sums: Vec<[f64; N]> = by_unit(rows, r.unit_of)
            .into_iter()
            .map(|rows| {
                let mut sums = [0.0; N];
                rows.iter().for_each(|row| add(&mut sums, row));
                sums
            })
            .collect();
        r.bootstrap.interval_of(sums.len(), |drawn| {
            let mut all = [0.0; N];
            drawn.iter().for_each(|&unit| add(&mut all, &sums[unit]));
            value(&all)
        })
    });
    Estimate { value: if frames > 0 { value(&all) } else { None }, interval, frames }
}

/// What needs all pairs at once.
fn of_pairs(
    rows: &[Option<[f64; 2]>],
    value: fn(&[[f64; 2]]) -> Option<f64>,
    resampling: Option<Resampling>,
) -> Estimate {
    let pairs: Vec<[f64; 2]> = rows.iter().flatten().copied().collect();
    let interval = resampling.and_then(|r| {
        let units = by_unit(rows, r.unit_of);
        r.bootstrap.interval_of(units.len(), |drawn| {
            value(&drawn.iter().flat_map(|&unit| units[unit].iter().copied()).collect::<Vec<_>>())
        })
    });
    Estimate { value: value(&pairs), interval, frames: pairs.len() as u64 }
}

/// What is there, of every unit that has something.
fn by_unit<T: Copy>(rows: &[Option<T>], unit_of: &[u32]) -> Vec<Vec<T>> {
    let units = unit_of.iter().max().map_or(0, |&last| last as usize + 1);
    let mut groups = vec![Vec::new(); units];
    for (row, &unit) in rows.iter().zip(unit_of) {
        groups[unit as usize].extend(*row);
    }
    groups.retain(|group| !group.is_empty());
    groups
}
