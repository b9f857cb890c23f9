//! Records one drive: an episode in, an MCAP file out.

use std::{collections::BTreeMap, path::Path};

use crate::{
    error::{Error, Result},
    log::{
        APPLIED_CONTROL, CONDITIONS_RECORD,
        writer::{LogOptions, LogWriter},
    },
    noise::{Noise, Purpose},
    scene::shapes::Shapes,
    sim::{
        clocks::{CLOCKS, STEPS_PER_S},
        drive::{Demonstration, Drive},
        foxglove_messages,
        message::{Encoding, Sent},
        plan::Episode,
        reading::Reading,
        rig::Rig,
        ros2_messages,
        senses::Senses,
        stage::Stage,
    },
    world::ego::STEP_S,
};

/// Name of the metadata record that says how a drive ended.
pub const OUTCOME_RECORD: &str = "pmp.outcome";

const STEP_NS: i64 = 1_000_000_000 / STEPS_PER_S as i64;

/// Drives may be cut off after this long, s.
pub const SHORTEST_S: f64 = STEP_S;
pub const LONGEST_S: f64 = 3600.0;

/// How drives are recorded.
#[derive(Clone, Debug, Default)]
pub struct Recipe {
    pub rig: Rig,
    pub encoding: Encoding,
    /// The drive is cut off after this long, s; else it ends at the goal, or with a contact.
    pub seconds: Option<f64>,
    /// Probability of a steering burst in each decision of the driver.
    pub burst_chance: f64,
}

impl Recipe {
    /// Refuse what cannot be recorded.
    ///
    /// # Errors
    ///
    /// [`Error::Config`] if the length or the probability makes no sense.
    pub fn check(&self) -> Result<()> {
        if let Some(seconds) = self.seconds.filter(|s| !(SHORTEST_S..=LONGEST_S).contains(s)) {
            return Err(Error::Config {
                key: "--seconds".into(),
                what: format!("a drive of {seconds} s cannot be recorded"),
                hint: Some(format!("give {SHORTEST_S} to {LONGEST_S} s, or nothing")),
            });
        }
        if !(0.0..=1.0).contains(&self.burst_chance) {
            return Err(Error::Config {
                key: "--perturb".into(),
                what: format!("{} is no probability", self.burst_chance),
                hint: Some("0.01 is a burst in about 10 s".into()),
            });
        }
        Ok(())
    }

    fn applied_control(&self) -> &'static str {
        match self.encoding {
            Encoding::Foxglove => foxglove_messages::APPLIED_CONTROL,
            Encoding::Ros2 => ros2_messages::APPLIED_CONTROL,
        }
    }

    fn log_options(&self) -> LogOptions {
        let profile = match self.encoding {
            Encoding::Foxglove => "",
            Encoding::Ros2 => "ros2",
        };
        LogOptions { profile, ..LogOptions::default() }
    }

    fn messages(&self, stamp_ns: i64, reading: &Reading) -> Vec<Sent> {
        match self.encoding {
            Encoding::Foxglove => foxglove_messages::messages(stamp_ns, reading, &self.rig),
            Encoding::Ros2 => ros2_messages::messages(stamp_ns, reading, &self.rig),
        }
    }
}

/// Record one drive into a new log, which has its name when it is whole. `identity` is a metadata
/// record that the file begins with, to know it by.
///
/// `on_second` is called after each simulated second.
///
/// # Errors
///
/// [`Error::Exists`] if the log is there already; [`Error::Config`] if the recipe makes no sense or the
/// town has no route; [`Error::Io`] if the file cannot be written.
pub fn record(
    stage: &Stage,
    shapes: &Shapes,
    episode: &Episode,
    recipe: &Recipe,
    path: &Path,
    identity: (&str, &BTreeMap<String, String>),
    on_second: &dyn Fn(),
) -> Result<()> {
    recipe.check()?;
    let mut log = LogWriter::create(path, recipe.log_options())?;
    log.write_metadata(identity.0, identity.1)?;
    log.write_metadata(CONDITIONS_RECORD, &words(episode, recipe))?;
    let mut demonstration = Demonstration::new(&stage.town, episode, recipe.burst_chance)?;
    let mut recorder = Recorder::new(stage, shapes, episode, recipe, &demonstration.drive);
    let limit = recipe.seconds.map_or(u64::MAX, |s| (s * STEPS_PER_S as f64).round() as u64);
    loop {
        let drive = &demonstration.drive;
        recorder.sample(drive);
        for (log_time_ns, sent) in recorder.arrived() {
            log.write(sent.topic, sent.message.as_ref(), log_time_ns)?;
        }
        if drive.steps() > 0 && drive.steps().is_multiple_of(STEPS_PER_S) {
            on_second();
        }
        if drive.steps() >= limit || drive.is_over() {
            break;
        }
        recorder.step(&mut demonstration);
    }
    log.write_metadata(OUTCOME_RECORD, &outcome(&demonstration.drive))?;
    log.finish()
}

/// What a log tells of its drive, as key and value.
fn words(episode: &Episode, recipe: &Recipe) -> BTreeMap<String, String> {
    let conditions = episode.conditions();
    let applied = Some(recipe.applied_control().to_string());
    let words = [
        ("town", conditions.town),
        ("weather", conditions.weather),
        ("illumination", conditions.illumination),
        ("traffic", conditions.traffic),
        (APPLIED_CONTROL, applied),
    ];
    words.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect()
}

/// How the drive ended, and how far it came, as key and value.
pub fn outcome(drive: &Drive) -> BTreeMap<String, String> {
    let world = &drive.world;
    let end = drive.end().map_or("cut-off", |end| end.name());
    let words = [
        ("end", end.to_string()),
        ("duration_s", format!("{:.2}", world.time_s())),
        ("progress_m", format!("{:.1}", world.progress_m())),
        ("route_m", format!("{:.1}", world.route.length_m())),
        ("vehicles", world.counts().vehicles.to_string()),
        ("pedestrians", world.counts().walkers.to_string()),
    ];
    words.map(|(key, value)| (key.to_string(), value)).into()
}

/// The senses of a drive, and the messages that are on their way.
struct Recorder<'t> {
    recipe: &'t Recipe,
    senses: Senses<'t>,
    stamp_ns: i64,
    latency: Noise,
    /// By log time; messages of one instant in the order they were sent.
    under_way: BTreeMap<(i64, u64), Sent>,
    sent: u64,
}

impl<'t> Recorder<'t> {
    fn new(
        stage: &'t Stage,
        shapes: &'t Shapes,
        episode: &Episode,
        recipe: &'t Recipe,
        drive: &Drive,
    ) -> Recorder<'t> {
        let stamp_ns = episode.start_ns();
        let mut recorder = Recorder {
            recipe,
            senses: Senses::new(&recipe.rig, stage, shapes, episode, drive),
            stamp_ns,
            latency: Noise::new(episode.seed, episode.number, Purpose::Latency),
            under_way: BTreeMap::new(),
            sent: 0,
        };
        recorder.send(
            match recipe.encoding {
                Encoding::Foxglove => foxglove_messages::at_start(stamp_ns, &recipe.rig),
                Encoding::Ros2 => ros2_messages::at_start(stamp_ns, &recipe.rig, episode),
            },
            0,
        );
        recorder
    }

    fn step(&mut self, demonstration: &mut Demonstration) {
        self.senses.before_step(&demonstration.drive);
        demonstration.step();
        self.stamp_ns += STEP_NS;
    }

    /// Take what every clock that ticks now asks for.
    fn sample(&mut self, drive: &Drive) {
        for clock in CLOCKS.iter().filter(|clock| clock.ticks_at(drive.steps())) {
            let wait_ns = clock.wait_ns(&mut self.latency);
            let reading = self.senses.read(clock.source, drive);
            self.send(self.recipe.messages(self.stamp_ns, &reading), wait_ns);
        }
    }

    fn send(&mut self, messages: Vec<Sent>, wait_ns: i64) {
        for message in messages {
            self.under_way.insert((self.stamp_ns + wait_ns, self.sent), message);
            self.sent += 1;
        }
    }

    /// Messages that have reached the recorder, with their log times, in the order they did.
    fn arrived(&mut self) -> impl Iterator<Item = (i64, Sent)> + use<> {
        let later = self.under_way.split_off(&(self.stamp_ns + 1, 0));
        let arrived = std::mem::replace(&mut self.under_way, later);
        arrived.into_iter().map(|((log_time_ns, _), sent)| (log_time_ns, sent))
    }
}
