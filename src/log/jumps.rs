//! Where a clock jumps back: a simulator that starts again, a recording that is played in a loop.
//!
//! A topic's clock jumps back where a message, in the order of the file, is stamped more than
//! [`JUMP_NS`] before the one in front of it, and the topic goes on from there: the ten messages
//! from there on (three, where the log ends) each lie within [`JUMP_NS`] of the one before. So
//! neither a stray stamp nor a message that came late is a jump; both are sorted to their place.
//! Nor is a stretch that was merely written late, as recorders write chunks: its log times went
//! back with its stamps, and it joins up with what is there and lies beside it.
//!
//! The first topic that jumps begins a new episode. The others follow, each at its own jump where
//! it has one within 5 s of its own stamps, else at the same place of the file.

use std::collections::BTreeMap;

/// A step back of more than this is a jump; a smaller one is a message out of order.
pub const JUMP_NS: i64 = 1_000_000_000;

/// How long a topic may go on with its old clock after the first topic has jumped.
const LINGER_NS: i64 = 5_000_000_000;

/// Messages that show that a topic goes on.
const GOES_ON: u64 = 10;

/// The same, where the log ends.
const GOES_ON_AT_END: u64 = 3;

/// A stretch of a topic's messages that begins with a step back, in the order of the file.
#[derive(Clone, Debug)]
struct Run {
    /// Number of the mark that was made before its first message; `None` for the first run.
    mark: Option<usize>,
    /// Earliest and latest stamp, up to the first step forward by more than [`JUMP_NS`].
    span_ns: (i64, i64),
    messages: u64,
    /// A step forward by more than [`JUMP_NS`] has come.
    has_leapt: bool,
    /// And it came among the first [`GOES_ON`] messages.
    is_broken: bool,
    /// Log times went back as far as the stamps.
    log_went_back: bool,
}

/// The stamps of one topic in the order of the file, as far as jumps are concerned.
#[derive(Clone, Debug, Default)]
pub struct Course {
    runs: Vec<Run>,
    /// Stamp and log time of the last message.
    last: Option<(i64, i64)>,
    /// Stamp before the last step forward, and messages since.
    leap: Option<(i64, u64)>,
}

impl Course {
    /// Whether a message with this stamp, coming next, would step back far enough for a jump.
    pub fn steps_back(&self, stamp_ns: i64) -> bool {
        let Some((last_ns, _)) = self.last else { return false };
        // The way back from a stray stamp is none.
        let returns = self.leap.is_some_and(|(before_ns, messages)| {
            messages < GOES_ON && stamp_ns >= before_ns - JUMP_NS
        });
        stamp_ns < last_ns - JUMP_NS && !returns
    }

    /// Take the next message; `mark` is the number of the mark where it steps back.
    pub fn take(&mut self, stamp_ns: i64, log_time_ns: i64, mark: Option<usize>) {
        let (last_ns, last_log_ns) = self.last.unwrap_or((stamp_ns, log_time_ns));
        self.last = Some((stamp_ns, log_time_ns));
        if self.runs.is_empty() || mark.is_some() {
            let apart_ns = (last_ns - stamp_ns).abs_diff(last_log_ns - log_time_ns);
            self.leap = None;
            self.runs.push(Run {
                mark,
                span_ns: (stamp_ns, stamp_ns),
                messages: 1,
                has_leapt: false,
                is_broken: false,
                log_went_back: apart_ns <= JUMP_NS as u64,
            });
            return;
        }
        let step_ns = stamp_ns - last_ns;
        if step_ns > JUMP_NS {
            self.leap = Some((last_ns, 0));
        } else if let Some((_, messages)) = &mut self.leap {
            *messages += 1;
        }
        let Some(run) = self.runs.last_mut() else { return };
        run.has_leapt |= step_ns > JUMP_NS;
        run.is_broken |= run.messages < GOES_ON && step_ns.abs() > JUMP_NS;
        run.messages += 1;
        if !run.has_leapt {
            run.span_ns = (run.span_ns.0.min(stamp_ns), run.span_ns.1.max(stamp_ns));
        }
    }

    /// Stamp of the last message.
    pub fn last_ns(&self) -> Option<i64> {
        self.last.map(|(stamp_ns, _)| stamp_ns)
    }

    /// The marks at which the clock jumped back, ascending.
    pub fn jumps(&self) -> Vec<usize> {
        let mut jumps = Vec::new();
        let mut episode: Vec<(i64, i64)> = Vec::new();
        for (index, run) in self.runs.iter().enumerate() {
            let is_last = index + 1 == self.runs.len();
            let enough = if is_last { GOES_ON_AT_END } else { GOES_ON };
            let goes_on = run.messages >= enough && !run.is_broken;
            match run.mark {
                Some(mark) if goes_on && !run.was_written_late(&episode) => {
                    jumps.push(mark);
                    episode = vec![run.span_ns];
                }
                _ => episode.push(run.span_ns),
            }
        }
        jumps
    }
}

impl Run {
    fn was_written_late(&self, episode: &[(i64, i64)]) -> bool {
        let (first, last) = self.span_ns;
        let overlaps = episode.iter().any(|(from, to)| first < *to && last > *from);
        let joins = episode.iter().any(|(from, to)| {
            from.abs_diff(last) <= JUMP_NS as u64 || to.abs_diff(first) <= JUMP_NS as u64
        });
        self.log_went_back && joins && !overlaps
    }
}

/// Where an episode begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Beginning {
    /// The mark of the first topic that jumped.
    pub mark: usize,
    /// Marks of the topics that jumped themselves, by topic.
    pub jumped: BTreeMap<String, usize>,
}

/// Put the jumps of all topics together; `last_ns` is the stamp of a topic's last message before
/// a mark, `None` if it had none yet.
pub fn beginnings(
    courses: &BTreeMap<String, &Course>,
    last_ns: &dyn Fn(&str, usize) -> Option<i64>,
) -> Vec<Beginning> {
    let of_topic = |(topic, course): (&String, &&Course)| {
        let topic = topic.clone();
        course.jumps().into_iter().map(move |mark| (mark, topic.clone())).collect::<Vec<_>>()
    };
    let mut jumps: Vec<(usize, String)> = courses.iter().flat_map(of_topic).collect();
    jumps.sort();
    let mut beginnings: Vec<Beginning> = Vec::new();
    for (mark, topic) in jumps {
        let follows = |beginning: &&mut Beginning| {
            let then = last_ns(&topic, beginning.mark).zip(last_ns(&topic, mark));
            let lingered_ns = then.map_or(0, |(then_ns, now_ns)| now_ns - then_ns);
            !beginning.jumped.contains_key(&topic) && lingered_ns <= LINGER_NS
        };
        match beginnings.last_mut().filter(follows) {
            Some(beginning) => {
                beginning.jumped.insert(topic, mark);
            }
            None => beginnings.push(Beginning { mark, jumped: BTreeMap::from([(topic, mark)]) }),
        }
    }
    beginnings
}
