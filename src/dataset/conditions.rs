//! What the surroundings of a drive were like: the log's metadata say it first, then its topics,
//! then the profile.

use crate::{
    frame::Conditions,
    log::{
        CONDITIONS_RECORD,
        mapping::Mapping,
        profile::Profile,
        recording::{Recording, Series, Stamped},
        signals::Weather,
    },
};

/// Least rain of each weather, in CARLA's percent: the middles between its presets (version 0.9.16),
/// which have 0 (Clear, Cloudy, Wet), 30 (SoftRain), 60 (MidRain) and 100 (HardRain).
const WEATHERS: [(f64, &str); 4] =
    [(80.0, "storm"), (45.0, "rainy"), (15.0, "drizzle"), (0.0, "clear")];

/// Least height of the sun of each illumination, degrees. CARLA's presets have 45 (Noon), 15
/// (Sunset) and -90 (Night): the middle of the first two, and the horizon. `dark`, a night without
/// street lights, no weather tells.
const ILLUMINATIONS: [(f64, &str); 3] = [(30.0, "daytime"), (0.0, "sunset"), (-90.0, "night")];

/// The conditions of a drive.
pub fn conditions(
    recording: &Recording,
    mapping: &Mapping,
    profile: &Profile,
    notes: &mut Vec<String>,
) -> Conditions {
    let record = recording.log.metadata.get(CONDITIONS_RECORD);
    let series = |topic: &Option<String>| Some(&recording.topics.get(topic.as_ref()?)?.series);
    let weathers = match series(&mapping.weather) {
        Some(Series::Weather(samples)) => samples.as_slice(),
        _ => &[],
    };
    let town = match series(&mapping.town) {
        Some(Series::Town(samples)) => samples.first().map(|sample| sample.value.clone()),
        _ => None,
    };
    let get = |key: &str, told: Option<String>, fallback: &Option<String>| {
        let recorded = record.and_then(|record| record.get(key)).cloned();
        recorded.or(told).or_else(|| fallback.clone())
    };
    let given = &profile.conditions;
    Conditions {
        town: get("town", town, &given.town),
        weather: get("weather", first("weather", weathers, weather, notes), &given.weather),
        illumination: get(
            "illumination",
            first("illumination", weathers, illumination, notes),
            &given.illumination,
        ),
        traffic: get("traffic", None, &given.traffic),
    }
}

/// The word for the first sample, with a note if the word changes.
fn first(
    name: &str,
    samples: &[Stamped<Weather>],
    word: fn(&Weather) -> Option<&'static str>,
    notes: &mut Vec<String>,
) -> Option<String> {
    let first = word(&samples.first()?.value);
    if samples.iter().any(|sample| word(&sample.value) != first) {
        notes.push(format!("{name}: it changes during the log; the first is told"));
    }
    first.map(str::to_string)
}

/// The weather's word; `None` where CARLA leaves it to the map (a negative rain).
pub fn weather(weather: &Weather) -> Option<&'static str> {
    WEATHERS.iter().find(|(least, _)| weather.precipitation >= *least).map(|(_, word)| *word)
}

/// The illumination's word; `None` where CARLA leaves the weather to the map.
pub fn illumination(weather: &Weather) -> Option<&'static str> {
    let mut words = ILLUMINATIONS.iter();
    let word = words.find(|(least, _)| weather.sun_altitude_deg >= *least)?;
    (weather.precipitation >= 0.0).then_some(word.1)
}
