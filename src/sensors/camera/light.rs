//! What lights a scene under a sky: sun, moon, clouds, haze, and how the camera takes it.

use glam::{Vec3, Vec3A};

use crate::scene::conditions::{Illumination, Sky, Weather};

/// Light of a sky. Radiances and irradiances are linear; a white surface in the midday sun is about 1.
#[derive(Clone, Debug)]
pub struct Light {
    /// Towards the sun or the moon, unit length, world frame.
    pub sun_direction: Vec3A,
    /// What reaches a surface that faces it.
    pub sun: Vec3A,
    /// From the whole sky on a surface that faces up, and from the ground on one that faces down.
    pub above: Vec3A,
    pub below: Vec3A,
    /// Colours of the sky overhead and above the horizon.
    pub zenith: Vec3A,
    pub horizon: Vec3A,
    /// Around the sun in a clear sky.
    pub glare: Vec3A,
    /// Share of the sky under clouds.
    pub clouds: f32,
    /// Light lost on the way, 1/m.
    pub haze_per_m: f32,
    /// Lamps of vehicles, of streets, and in windows: how bright.
    pub vehicle_lamps: f32,
    pub street_lamps: f32,
    pub windows: f32,
    /// How wet surfaces are, and how much of the road lies under puddles, in [0, 1].
    pub wetness: f32,
    pub puddles: f32,
    /// How hard it rains, in [0, 1].
    pub rain: f32,
    pub exposure: f32,
    /// Standard deviation of the sensor's noise in the dark, of 255.
    pub noise: f32,
}

impl Light {
    pub fn new(sky: Sky) -> Light {
        let clear = Light::of(sky.illumination);
        let rain = sky.weather.rain() as f32;
        // Clouds, their light against that of a clear sky, haze, water, as CARLA's presets Clear,
        // SoftRain, MidRain and HardRain: cloudiness 20, 70, 90, 90; deposits 0, 50, 50, 100.
        let (clouds, dimming, haze_per_m, wetness, puddles) = match sky.weather {
            Weather::Clear => (0.2, 1.0, 0.0009, 0.0, 0.0),
            Weather::Drizzle => (0.7, 0.92, 0.005, 0.5, 0.3),
            Weather::Rainy => (0.9, 0.75, 0.011, 0.8, 0.55),
            Weather::Storm => (0.9, 0.5, 0.028, 1.0, 1.0),
        };
        let through = match sky.weather {
            Weather::Clear => 1.0,
            Weather::Drizzle => 0.22,
            Weather::Rainy | Weather::Storm => 0.0,
        };
        // What clouds take from the sun comes back grey from the whole sky.
        let overcast = 1.0 - through;
        let spread = clear.sun * clear.sun_direction.z.max(0.25) * overcast;
        let grey = |colour: Vec3A| colour.lerp(Vec3A::splat(luminance(colour)), 0.75 * overcast);
        let above = grey(clear.above + 0.45 * spread) * dimming;
        let cover = grey(clear.horizon.lerp(above, 0.8 * overcast)) * dimming;
        Light {
            sun: clear.sun * through,
            above,
            below: grey(clear.below + 0.1 * spread) * dimming,
            zenith: clear.zenith.lerp(cover * 0.8, overcast),
            horizon: clear.horizon.lerp(cover, overcast),
            glare: clear.glare * through,
            clouds,
            haze_per_m,
            vehicle_lamps: clear.vehicle_lamps.max(if rain > 0.0 { 0.3 } else { 0.0 }),
            wetness,
            puddles,
            rain,
            noise: clear.noise + 0.4 * rain,
            ..clear
        }
    }

    fn of(illumination: Illumination) -> Light {
        let dry = Light {
            sun_direction: Vec3A::from(Vec3::new(-0.5, -0.46, 0.74).normalize()),
            sun: Vec3A::new(1.15, 1.06, 0.92),
            above: Vec3A::new(0.36, 0.43, 0.54),
            below: Vec3A::new(0.2, 0.19, 0.17),
            zenith: Vec3A::new(0.16, 0.34, 0.74),
            horizon: Vec3A::new(0.6, 0.75, 0.95),
            glare: Vec3A::new(1.0, 0.95, 0.8) * 0.5,
            clouds: 0.2,
            haze_per_m: 0.0,
            vehicle_lamps: 0.0,
            street_lamps: 0.0,
            windows: 0.0,
            wetness: 0.0,
            puddles: 0.0,
            rain: 0.0,
            exposure: 1.05,
            noise: 0.8,
        };
        match illumination {
            Illumination::Daytime => dry,
            Illumination::Sunset => Light {
                sun_direction: Vec3A::from(Vec3::new(0.84, 0.52, 0.17).normalize()),
                sun: Vec3A::new(0.85, 0.4, 0.14),
                above: Vec3A::new(0.13, 0.12, 0.16),
                below: Vec3A::new(0.07, 0.055, 0.05),
                zenith: Vec3A::new(0.09, 0.13, 0.27),
                horizon: Vec3A::new(0.62, 0.33, 0.17),
                glare: Vec3A::new(1.6, 0.7, 0.2),
                vehicle_lamps: 0.35,
                windows: 0.12,
                exposure: 1.3,
                noise: 1.2,
                ..dry
            },
            Illumination::Night => Light {
                sun_direction: Vec3A::from(Vec3::new(0.4, -0.5, 0.76).normalize()),
                sun: Vec3A::new(0.006, 0.008, 0.013),
                above: Vec3A::new(0.0065, 0.008, 0.015),
                below: Vec3A::new(0.003, 0.003, 0.005),
                zenith: Vec3A::new(0.0015, 0.0022, 0.006),
                horizon: Vec3A::new(0.0075, 0.0085, 0.016),
                glare: Vec3A::ZERO,
                vehicle_lamps: 1.0,
                street_lamps: 1.0,
                windows: 1.0,
                exposure: 5.0,
                noise: 2.0,
                ..dry
            },
            Illumination::Dark => Light {
                sun: Vec3A::ZERO,
                above: Vec3A::new(0.0004, 0.0005, 0.0007),
                below: Vec3A::splat(0.0002),
                zenith: Vec3A::new(0.0002, 0.0003, 0.0006),
                horizon: Vec3A::new(0.0004, 0.0005, 0.0008),
                glare: Vec3A::ZERO,
                vehicle_lamps: 1.0,
                exposure: 5.0,
                noise: 2.8,
                ..dry
            },
        }
    }
}

/// How bright a linear colour is (Rec. 709).
#[inline]
pub fn luminance(colour: Vec3A) -> f32 {
    colour.dot(Vec3A::new(0.2126, 0.7152, 0.0722))
}
