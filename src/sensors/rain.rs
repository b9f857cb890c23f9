//! What falling rain does to laser light and to radar waves.

use std::f64::consts::LN_10;

use crate::scene::conditions::Weather;

/// A storm's rain, mm/h: where the Met Office's scale of showers turns from heavy to violent.
const STORM_MMPH: f64 = 50.0;

/// Share of laser pulses that a storm sends back from a drop near the lens. Of the order that
/// automotive lidars show below rain machines; rates differ by an order of magnitude between models.
const STORM_SCATTERED: f64 = 0.02;

/// Rain on its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rain {
    /// Of the light that is left, lost on each metre of way, 1/m.
    pub laser_per_m: f64,
    /// Radar lost on each metre of way, dB.
    pub radar_db_per_m: f64,
    /// Share of laser pulses that come back from a drop near the lens.
    pub scattered: f64,
}

impl Rain {
    /// How much falls grows with the square of how hard it seems: drizzle 3, rainy 18 mm/h.
    pub fn of(weather: Weather) -> Rain {
        let rate_mmph = STORM_MMPH * weather.rain() * weather.rain();
        Rain {
            // dB/km for light: Carbonneau and Wisely, Proc. SPIE 3232 (1998).
            laser_per_m: 1.076 * rate_mmph.powf(0.67) / 1000.0 * LN_10 / 10.0,
            // dB/km at 77 GHz, polarised horizontally, on a level way: the formula of Recommendation
            // ITU-R P.838-3 gives 1.132 and 0.7177.
            radar_db_per_m: 1.13 * rate_mmph.powf(0.72) / 1000.0,
            scattered: STORM_SCATTERED * rate_mmph / STORM_MMPH,
        }
    }
}
