//! What the driver did, as far as the log recorded it.

use crate::{
    dataset::ego::{EgoTrack, wrap_angle},
    frame::RecordedAction,
    log::{
        profile::{DEFAULT_STEERING_LOCK_RAD, Profile},
        recording::{Series, Stamped, Topic, nearest},
        signals::Control,
    },
};

/// Mean acceleration over [`EVIDENCE_NS`] that only a pedal explains, m/s2. Lifting off at
/// motorway speed slows a car by about 0.5 m/s2.
const PEDAL_MPS2: f64 = 0.8;

/// Mean yaw rate over [`EVIDENCE_NS`] that only steering explains, rad/s.
const STEERED_RADPS: f64 = 0.05;

/// A difference between wanted and applied control beyond this is a disturbance: more than the
/// rounding of messages, less than what anybody would disturb by.
const DISTURBED: f64 = 0.02;

const EVIDENCE_NS: i64 = 2_000_000_000;

/// The controls of a drive.
#[derive(Clone, Debug, Default)]
pub struct Controls {
    /// Ascending by stamp.
    pub samples: Vec<Stamped<Control>>,
    /// What moved the car, where the log says that it may differ; ascending by stamp.
    applied: Vec<Stamped<Control>>,
    /// Front-wheel angle at full steering, rad; used where only wheel angles are known.
    steering_lock_rad: f64,
    recorded: Recorded,
    /// What was assumed or found, for people.
    pub notes: Vec<String>,
}

/// Which channels the log really has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Recorded {
    steer: bool,
    throttle: bool,
    brake: bool,
}

impl Default for Recorded {
    fn default() -> Self {
        Recorded { steer: true, throttle: true, brake: true }
    }
}

impl Controls {
    /// Read the controls of a topic; `pedals` is the topic of throttle and brake, where the first
    /// has none, and `applied` that of what moved the car instead, where the driving was disturbed
    /// on purpose.
    ///
    /// A channel that stays at exactly zero while the car does what only that channel can cause
    /// was not recorded: it becomes unknown, so that nobody learns never to brake from a log
    /// without a brake signal.
    pub fn new(
        topic: Option<&Topic>,
        pedals: Option<&Topic>,
        applied: Option<&Topic>,
        profile: &Profile,
        track: &EgoTrack,
    ) -> Controls {
        let Some(topic) = topic.or(pedals) else { return Controls::default() };
        let mut samples = samples_of(topic);
        let mut notes = Vec::new();
        let lacks_pedals =
            samples.iter().all(|c| c.value.throttle.is_none() && c.value.brake.is_none());
        if let Some(pedals) = pedals.filter(|_| lacks_pedals) {
            notes.push(format!("control: throttle and brake from {}", pedals.name));
            add_pedals(
                &mut samples,
                &samples_of(pedals),
                (profile.tolerance_ms.control * 1e6) as i64,
            );
        }
        let steering_lock_rad = profile.control.steering_lock_rad.unwrap_or_else(|| {
            if samples.iter().any(|c| c.value.steer.is_none() && c.value.wheel_angle_rad.is_some())
            {
                notes.push(format!(
                    "control: {} has wheel angles; full steering is assumed to be \
                     {DEFAULT_STEERING_LOCK_RAD} rad (profile key control.steering_lock_rad)",
                    topic.name
                ));
            }
            DEFAULT_STEERING_LOCK_RAD
        });
        let frozen = |channel: fn(&Control) -> Option<f64>| {
            samples.iter().all(|sample| channel(&sample.value) == Some(0.0))
        };
        let evidence = Evidence::of(track);
        let mut unrecorded = |name: &str, frozen: bool, evidence: bool, what: &str| {
            if frozen && evidence {
                notes.push(format!(
                    "{name}: zero in all of {} although the car {what}, so it counts as not recorded",
                    topic.name
                ));
            }
            !(frozen && evidence)
        };
        let recorded = Recorded {
            steer: unrecorded("steer", frozen(|c| c.steer), evidence.turns, "turns"),
            throttle: unrecorded(
                "throttle",
                frozen(|c| c.throttle),
                evidence.speeds_up,
                "speeds up",
            ),
            brake: unrecorded("brake", frozen(|c| c.brake), evidence.slows_down, "slows down"),
        };
        let applied = applied.map(samples_of).unwrap_or_default();
        Controls { samples, applied, steering_lock_rad, recorded, notes }
    }

    /// Whether what moved the car at this control's time is not what the driver wanted.
    pub fn is_perturbed(&self, wanted: Option<&Stamped<Control>>) -> bool {
        let Some(wanted) = wanted else { return false };
        let Some(applied) = nearest(&self.applied, wanted.stamp_ns) else { return false };
        let channels: [fn(&Control) -> Option<f64>; 3] = [|c| c.steer, |c| c.throttle, |c| c.brake];
        channels.iter().any(|channel| match (channel(&wanted.value), channel(&applied.value)) {
            (Some(wanted), Some(applied)) => (wanted - applied).abs() > DISTURBED,
            _ => false,
        })
    }

    /// A control as the frame stores it.
    pub fn action(&self, control: Option<&Control>) -> RecordedAction {
        let Some(control) = control else { return RecordedAction::default() };
        let wheel = control.wheel_angle_rad.map(|angle| -angle / self.steering_lock_rad);
        let channel = |value: Option<f64>, recorded: bool, least: f64| {
            let value = value.filter(|value| recorded && value.is_finite())?;
            Some(value.clamp(least, 1.0) as f32)
        };
        RecordedAction {
            steer: channel(control.steer.or(wheel), self.recorded.steer, -1.0),
            throttle: channel(control.throttle, self.recorded.throttle, 0.0),
            brake: channel(control.brake, self.recorded.brake, 0.0),
        }
    }
}

/// Throttle and brake of the nearest of other samples, where one is near enough.
fn add_pedals(samples: &mut [Stamped<Control>], pedals: &[Stamped<Control>], tolerance_ns: i64) {
    for sample in samples {
        let near = nearest(pedals, sample.stamp_ns)
            .filter(|near| near.stamp_ns.abs_diff(sample.stamp_ns) <= tolerance_ns as u64);
        if let Some(near) = near {
            sample.value.throttle = near.value.throttle;
            sample.value.brake = near.value.brake;
        }
    }
}

fn samples_of(topic: &Topic) -> Vec<Stamped<Control>> {
    match &topic.series {
        Series::Control(samples) => samples.clone(),
        Series::Status(samples) => samples
            .iter()
            .map(|sample| Stamped { stamp_ns: sample.stamp_ns, value: sample.value.control })
            .collect(),
        _ => Vec::new(),
    }
}

/// What the car did at least once in the log.
struct Evidence {
    turns: bool,
    speeds_up: bool,
    slows_down: bool,
}

impl Evidence {
    fn of(track: &EgoTrack) -> Evidence {
        let mut evidence = Evidence { turns: false, speeds_up: false, slows_down: false };
        let seconds = EVIDENCE_NS as f64 * 1e-9;
        for sample in track.samples() {
            let later_ns = sample.stamp_ns + EVIDENCE_NS;
            let Some(later) = track.at(later_ns) else { continue };
            if !track.is_continuous(sample.stamp_ns, later_ns) {
                continue;
            }
            let acceleration = (later.speed_mps() - sample.value.speed_mps()) / seconds;
            let yaw_rate = wrap_angle(later.yaw_rad - sample.value.yaw_rad) / seconds;
            evidence.speeds_up |= acceleration > PEDAL_MPS2;
            evidence.slows_down |= acceleration < -PEDAL_MPS2;
            evidence.turns |= yaw_rate.abs() > STEERED_RADPS;
        }
        evidence
    }
}
