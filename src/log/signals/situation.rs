//! What a map and a route tell of the place where the car is.

use crate::{
    error::{Error, Result},
    frame::Command,
    log::value::Struct,
};

/// `pmp.Situation`: told by who has a map, as pmp's recorder has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    pub in_junction: bool,
    pub speed_limit_mps: f64,
    pub command: Command,
}

/// `pmp.Situation` or `pmp_msgs/Situation`.
pub fn situation(message: &Struct) -> Result<Situation> {
    let command = message.text("command")?;
    Ok(Situation {
        in_junction: message.int("in_junction")? != 0,
        speed_limit_mps: message.number("speed_limit_mps")?,
        command: Command::from_name(command).ok_or_else(|| Error::Decode {
            schema: message.name.to_string(),
            offset: 0,
            what: format!("`{command}` is no command"),
        })?,
    })
}
