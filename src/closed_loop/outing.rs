//! One episode, driven by a pilot from its start to its end.

use std::{path::Path, time::Instant};

use serde::{Deserialize, Serialize};

use crate::{
    closed_loop::{
        film::Film,
        observation::Observer,
        pilot::Pilot,
        recorder::Recorder,
        row::EpisodeRow,
        suite::{Episode, Suite},
        tally::Tally,
    },
    error::Result,
    policy::Senses,
    scene::shapes::Shapes,
    sim::{drive::Drive, rig::Rig, stage::Stage},
    world::expert::Decision,
};

/// Where and with what car an episode is driven.
#[derive(Clone, Copy)]
pub struct Setting<'t> {
    pub suite: &'t Suite,
    pub stage: &'t Stage,
    pub shapes: &'t Shapes,
    pub rig: &'t Rig,
}

/// What came of an episode.
pub struct Outing {
    pub row: EpisodeRow,
    pub clock: Clock,
    pub film: Film,
}

/// Where the wall time of an episode went. Apart from the row, which is the same on any machine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Clock {
    pub world_s: f64,
    pub senses_s: f64,
    pub policy_s: f64,
    pub recording_s: f64,
    /// Of each decision, from the frame to the action, ms.
    pub latency_ms: Vec<f32>,
}

/// Drive an episode; with `log`, into a log.
///
/// A policy that gives an error, or an action that is none, has crashed: the episode is over, and its
/// row says why.
///
/// # Errors
///
/// If there is no such route or the log cannot be written: nothing that the policy is to blame for.
pub fn drive(
    setting: &Setting,
    episode: &Episode,
    name: &str,
    pilot: &mut dyn Pilot,
    log: Option<&Path>,
) -> Result<Outing> {
    let Setting { suite, stage, shapes, rig } = *setting;
    let mut clock = Clock::default();
    let start = Instant::now();
    let mut drive = Drive::new(suite.world(&stage.town, episode)?, suite.rules);
    let planned = episode.planned();
    let wanted = if log.is_some() { Senses::ALL } else { pilot.senses() };
    let mut observer = Observer::new(rig, stage, shapes, &planned, &drive, wanted);
    let mut recorder = log.map(|path| Recorder::create(path, rig, name, episode)).transpose()?;
    let (mut tally, mut film, mut crash) = (Tally::default(), Film::default(), None);
    pilot.begin(&planned);
    clock.world_s += start.elapsed().as_secs_f64();
    while !drive.is_over() {
        if drive.is_due() {
            let before = Instant::now();
            let seen = observer.observe(&drive);
            let sensed = Instant::now();
            let act = pilot.act(&drive.world, &seen.frame).map_err(|error| error.to_string());
            let act = act.and_then(|act| match act.plan.fault().or(act.action.fault()) {
                Some(fault) => Err(fault.to_string()),
                None => Ok(act),
            });
            let decided = Instant::now();
            clock.senses_s += (sensed - before).as_secs_f64();
            clock.policy_s += (decided - sensed).as_secs_f64();
            clock.latency_ms.push((decided - sensed).as_secs_f32() * 1e3);
            let act = match act {
                Ok(act) => act,
                Err(why) => {
                    crash = Some(why);
                    break;
                }
            };
            let action = act.action;
            drive.decide(Decision { wanted: action, applied: action, is_emergency: false });
            tally.add(&drive.world, &act);
            film.add(&seen, &act);
            if let Some(recorder) = &mut recorder {
                recorder.write(&mut observer, &drive, &seen, &act)?;
            }
            clock.recording_s += decided.elapsed().as_secs_f64();
        }
        let before = Instant::now();
        drive.step();
        clock.world_s += before.elapsed().as_secs_f64();
    }
    if let Some(recorder) = recorder {
        recorder.finish(&drive)?;
    }
    let row = tally.row((name, &suite.name), episode, &drive, crash);
    Ok(Outing { row, clock, film })
}
