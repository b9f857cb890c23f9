//! What a pilot had in mind, as a message of a log.

use serde::Serialize;

use crate::{
    closed_loop::pilot::Act,
    log::encode::{Definition, Endian, Message},
    policy::Action,
};

/// Name of the message and its JSON schema, for readers such as Foxglove.
const SCHEMA: (&str, &str) = (
    "pmp.Decision",
    r#"{
  "title": "pmp.Decision",
  "type": "object",
  "properties": {
    "a1": {"type": ["object", "null"], "description": "direct action: steer [-1, 1] right, throttle, brake [0, 1]"},
    "a2": {"type": ["object", "null"], "description": "action that follows the planned motion"},
    "lambda": {"type": ["number", "null"], "description": "share of a2 in what was done"},
    "variance": {"type": ["number", "null"], "description": "sum of variances up to the target; speed in 10 m/s, yaw in rad"},
    "target": {"type": ["object", "null"], "description": "where a2 steers to: step, bearing_rad (left), speed_mps"},
    "attention": {"type": "object", "description": "share of each branch"},
    "modes": {"type": "array", "description": "weight; speed_mps and yaw_rad of 30 steps of 0.1 s; standard deviations"}
  }
}"#,
);

/// A decision of a policy: both actions, how they were weighed, and the planned distribution.
#[derive(Clone, Debug, Serialize)]
pub struct Thought {
    a1: Option<Pedals>,
    a2: Option<Pedals>,
    lambda: Option<f64>,
    variance: Option<f64>,
    target: Option<Aim>,
    attention: std::collections::BTreeMap<&'static str, f32>,
    modes: Vec<Manoeuvre>,
}

#[derive(Clone, Debug, Serialize)]
struct Pedals {
    steer: f32,
    throttle: f32,
    brake: f32,
}

#[derive(Clone, Debug, Serialize)]
struct Aim {
    step: usize,
    bearing_rad: f64,
    speed_mps: f64,
}

#[derive(Clone, Debug, Serialize)]
struct Manoeuvre {
    weight: f32,
    speed_mps: Vec<f32>,
    yaw_rad: Vec<f32>,
    speed_std_mps: Option<Vec<f32>>,
    yaw_std_rad: Option<Vec<f32>>,
}

impl Thought {
    pub fn of(act: &Act) -> Thought {
        let decision = act.decision.as_ref();
        let pedals = |Action { steer, throttle, brake }| Pedals { steer, throttle, brake };
        let modes = act.plan.motion.iter().map(|mode| Manoeuvre {
            weight: mode.weight,
            speed_mps: mode.speed_mps.to_vec(),
            yaw_rad: mode.yaw_rad.to_vec(),
            speed_std_mps: mode.std.as_ref().map(|std| std.speed_mps.to_vec()),
            yaw_std_rad: mode.std.as_ref().map(|std| std.yaw_rad.to_vec()),
        });
        Thought {
            a1: decision.and_then(|d| d.a1).map(pedals),
            a2: decision.and_then(|d| d.a2).map(pedals),
            lambda: decision.map(|d| d.lambda),
            variance: decision.and_then(|d| d.variance),
            target: decision.and_then(|d| d.target).map(|target| Aim {
                step: target.step,
                bearing_rad: target.bearing_rad,
                speed_mps: target.speed_mps,
            }),
            attention: act.plan.attention.iter().copied().collect(),
            modes: modes.collect(),
        }
    }
}

impl Message for Thought {
    fn schema(&self) -> &'static str {
        SCHEMA.0
    }

    fn definition(&self) -> Option<Definition> {
        let data = SCHEMA.1.as_bytes().to_vec();
        Some(Definition { schema_encoding: "jsonschema", message_encoding: "json", data })
    }

    fn encode(&self, _: Endian) -> Vec<u8> {
        // A struct of numbers and lists is always JSON.
        serde_json::to_vec(self).unwrap_or_default()
    }
}
