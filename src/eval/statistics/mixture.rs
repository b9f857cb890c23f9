//! Mixtures of normals in one number: distribution function, quantiles, and how good a forecast
//! they are.

use std::f64::consts::{FRAC_1_SQRT_2, PI, SQRT_2};

/// One normal of a mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    /// Its share in the mixture.
    pub weight: f64,
    pub mean: f64,
    /// Standard deviation, above 0.
    pub std: f64,
}

/// Bisections after which a quantile is known to 1e-9 of the width it was sought in.
const BISECTIONS: usize = 30;

/// Share of the mixture at or below `x`.
pub fn cdf(mixture: &[Normal], x: f64) -> f64 {
    mixture.iter().map(|normal| normal.weight * phi((x - normal.mean) / normal.std)).sum()
}

/// Where [`cdf`] is `share`, by bisection; `share` is in (0, 1), and the weights sum to 1.
///
/// It lies between the least and the greatest quantile of the normals.
pub fn quantile(mixture: &[Normal], share: f64) -> f64 {
    let z = z_of(share);
    let of_each = || mixture.iter().map(|normal| normal.mean + z * normal.std);
    let mut low = of_each().fold(f64::INFINITY, f64::min);
    let mut high = of_each().fold(f64::NEG_INFINITY, f64::max);
    let exact = 1e-9 * (high - low);
    for _ in 0..BISECTIONS {
        if high - low <= exact {
            break;
        }
        let middle = (low + high) / 2.0;
        match cdf(mixture, middle) < share {
            true => low = middle,
            false => high = middle,
        }
    }
    (low + high) / 2.0
}

/// Length of the interval that holds the central `share` of the mixture.
pub fn central_width(mixture: &[Normal], share: f64) -> f64 {
    quantile(mixture, 0.5 + share / 2.0) - quantile(mixture, 0.5 - share / 2.0)
}

/// Continuous ranked probability score of the mixture as a forecast of `x`, in the unit of `x`: the
/// integral of the squared difference between [`cdf`] and the step at `x`. Of a point forecast it
/// is the absolute error.
///
/// Source of the closed form: Grimit, Gneiting, Berrocal and Johnson, 2006, eq. (5).
pub fn crps(mixture: &[Normal], x: f64) -> f64 {
    let mut score = 0.0;
    for (i, a) in mixture.iter().enumerate() {
        score += a.weight * expected_distance(x - a.mean, a.std);
        for (j, b) in mixture[..=i].iter().enumerate() {
            // Every pair stands twice in the double sum but a normal with itself.
            let times = if i == j { 0.5 } else { 1.0 };
            let apart = expected_distance(a.mean - b.mean, a.std.hypot(b.std));
            score -= times * a.weight * b.weight * apart;
        }
    }
    score
}

/// Mean of the absolute value of a normal.
fn expected_distance(mean: f64, std: f64) -> f64 {
    let z = mean / std;
    let density = (-z * z / 2.0).exp() / (2.0 * PI).sqrt();
    2.0 * std * density + mean * libm::erf(z * FRAC_1_SQRT_2)
}

/// Distribution function of the standard normal.
fn phi(z: f64) -> f64 {
    libm::erfc(-z / SQRT_2) / 2.0
}

/// Quantile of the standard normal, by bisection within 9 standard deviations.
fn z_of(share: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..56 {
        let middle = (low + high) / 2.0;
        match phi(middle) < share {
            true => low = middle,
            false => high = middle,
        }
    }
    (low + high) / 2.0
}
