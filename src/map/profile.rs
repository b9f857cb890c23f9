//! Values along a road: cubic polynomials, each valid from its start to the next one's.

/// A record begins at most this far before where it says, m: exporters round.
const ROUNDING_M: f64 = 1e-6;

/// `a + b ds + c ds^2 + d ds^3` with `ds = s - start_m`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cubic {
    pub start_m: f64,
    pub a: f64,
    pub b: f64,
    pub c: f64,
    pub d: f64,
}

impl Cubic {
    pub fn at(&self, s_m: f64) -> f64 {
        let ds = s_m - self.start_m;
        self.a + ds * (self.b + ds * (self.c + ds * self.d))
    }

    pub fn slope_at(&self, s_m: f64) -> f64 {
        let ds = s_m - self.start_m;
        self.b + ds * (2.0 * self.c + ds * 3.0 * self.d)
    }

    /// The same polynomial, counted from another start.
    pub fn starting_at(&self, start_m: f64) -> Cubic {
        let ds = start_m - self.start_m;
        Cubic {
            start_m,
            a: self.at(start_m),
            b: self.slope_at(start_m),
            c: self.c + 3.0 * self.d * ds,
            d: self.d,
        }
    }
}

/// Records by start, ascending; of several with one start, the last in the file counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Profile(Vec<Cubic>);

impl Profile {
    pub fn new(mut records: Vec<Cubic>) -> Self {
        records.sort_by(|a, b| a.start_m.total_cmp(&b.start_m));
        Profile(records)
    }

    pub fn records(&self) -> &[Cubic] {
        &self.0
    }

    /// The record that holds at `s_m`; none before the first.
    pub fn record(&self, s_m: f64) -> Option<&Cubic> {
        let after = self.0.partition_point(|record| record.start_m <= s_m + ROUNDING_M);
        self.0[..after].last()
    }

    /// The value at `s_m`, 0 where no record holds.
    pub fn at(&self, s_m: f64) -> f64 {
        self.record(s_m).map_or(0.0, |record| record.at(s_m))
    }

    /// The derivative at `s_m`, 0 where no record holds.
    pub fn slope_at(&self, s_m: f64) -> f64 {
        self.record(s_m).map_or(0.0, |record| record.slope_at(s_m))
    }
}
