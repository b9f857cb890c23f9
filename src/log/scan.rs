//! One pass over a log, message by message, into recordings.
//!
//! Wherever the clock of a topic steps back, a mark says how much there was of everything. When
//! all is read, [`jumps`] tells which marks begin an episode, and the recording is cut there.

use std::{collections::BTreeMap, path::Path, sync::Arc};

use crate::{
    error::Result,
    log::{
        clock::{ClockRule, instant_text},
        decoder::Decoder,
        jumps::{self, Beginning},
        reader::{Channel, Log, Message, Visitor},
        recording::{Recording, Topic, TopicMark, Unused},
        signals::{self, Header, Kind},
        transforms::TransformTree,
    },
};

/// Hears of a chunk when it has been scanned: what is known by then, its number among the segments
/// of the log, and its data.
pub type OnChunk<'f> = dyn FnMut(&Scanned, u32, &[u8]) -> Result<()> + 'f;

impl Recording {
    /// Scan a log: one recording, and another one from each place on where its clocks jump back
    /// (see [`jumps`]).
    ///
    /// # Errors
    ///
    /// As [`Log::scan`]. A message that cannot be decoded is counted in its topic, not an error.
    pub fn scan(path: &Path, clock: &ClockRule) -> Result<Vec<Recording>> {
        Recording::scan_followed(path, clock, &|_| (), &mut |_, _, _| Ok(()))
    }

    /// The same; `on_bytes` hears how many bytes it has gone through so far, and `on_chunk` of every
    /// chunk.
    ///
    /// # Errors
    ///
    /// As [`Recording::scan`], and what `on_chunk` says.
    pub fn scan_followed(
        path: &Path,
        clock: &ClockRule,
        on_bytes: &dyn Fn(u64),
        on_chunk: &mut OnChunk,
    ) -> Result<Vec<Recording>> {
        let mut following = Following { builder: Builder::new(clock), on_chunk };
        let log = Log::visit(path, on_bytes, &mut following)?;
        Ok(following.builder.finish(log))
    }
}

/// A log as far as it has been scanned.
pub struct Scanned<'s> {
    log: &'s Log,
    builder: &'s Builder<'s>,
}

impl Scanned<'_> {
    /// What is known of a topic: its samples in the order of the file.
    pub fn topic(&self, name: &str) -> Option<&Topic> {
        self.builder.topics.get(name)
    }

    /// What the recording would be that is being scanned, if the log ended here.
    ///
    /// # Errors
    ///
    /// As [`Log::so_far`].
    pub fn recording(&self) -> Result<Option<Recording>> {
        Ok(self.builder.clone().finish(self.log.so_far()?).pop())
    }
}

struct Following<'c> {
    builder: Builder<'c>,
    on_chunk: &'c mut OnChunk<'c>,
}

impl Visitor for Following<'_> {
    fn message(&mut self, message: &Message) -> Result<()> {
        self.builder.add(message);
        Ok(())
    }

    fn chunk(&mut self, log: &Log, chunk: u32, data: &[u8]) -> Result<()> {
        (self.on_chunk)(&Scanned { log, builder: &self.builder }, chunk, data)
    }
}

/// What a channel turned out to be at its first message.
#[derive(Clone, Copy)]
enum Entry {
    /// A topic in [`Builder::topics`].
    Used,
    /// Index in [`Builder::unused`].
    Unused(usize),
}

/// How much there was of everything when a clock stepped back.
#[derive(Clone, Debug, Default)]
struct Mark {
    topics: BTreeMap<String, TopicMark>,
    links: BTreeMap<String, usize>,
    /// Messages, by index in [`Builder::unused`].
    unused: Vec<u64>,
}

/// Entries of all marks together. A log that needs more is in no order that could be kept: its
/// messages are sorted, and no jump is looked for.
const MOST_MARKED: usize = 1 << 20;

#[derive(Clone)]
struct Builder<'c> {
    clock: &'c ClockRule,
    channels: BTreeMap<u16, Entry>,
    topics: BTreeMap<String, Topic>,
    unused: Vec<Unused>,
    transforms: TransformTree,
    marks: Vec<Mark>,
    marked: usize,
}

impl<'c> Builder<'c> {
    fn new(clock: &'c ClockRule) -> Builder<'c> {
        Builder {
            clock,
            channels: BTreeMap::new(),
            topics: BTreeMap::new(),
            unused: Vec::new(),
            transforms: TransformTree::default(),
            marks: Vec::new(),
            marked: 0,
        }
    }

    fn add(&mut self, message: &Message) {
        let id = message.channel.id;
        let entry = match self.channels.get(&id) {
            Some(entry) => *entry,
            None => {
                let entry = self.open(message.channel);
                self.channels.insert(id, entry);
                entry
            }
        };
        if let Entry::Unused(index) = entry {
            self.unused[index].messages += 1;
            return;
        }
        let outcome = self.add_sample(message);
        let Some(topic) = self.topics.get_mut(&message.channel.topic) else { return };
        topic.messages += 1;
        if let Err(error) = outcome {
            topic.undecodable.0 += 1;
            topic.first_undecodable.get_or_insert(message.place);
            topic.undecodable.1.get_or_insert_with(|| {
                let at = instant_text(message.log_time_ns);
                format!(
                    "the first, message {} of the topic, logged at {at}: {error}",
                    topic.messages
                )
            });
        }
    }

    fn add_sample(&mut self, message: &Message) -> Result<()> {
        let Some(topic) = self.topics.get_mut(&message.channel.topic) else { return Ok(()) };
        let decoder = topic.decoder.clone();
        if topic.kind == Kind::Transforms {
            let is_static = topic.name.ends_with("static");
            let links = signals::transforms(&decoder.decode(message.data)?)?;
            let stamps: Vec<i64> =
                links.iter().map(|link| topic.stamp_of_link(&link.0, message)).collect();
            if let Some(stamp_ns) = stamps.first().filter(|_| !is_static) {
                self.follow(message, *stamp_ns);
            }
            for ((header, child, pose), stamp_ns) in links.into_iter().zip(stamps) {
                self.transforms.insert(&Header { stamp_ns, ..header }, &child, pose, is_static);
            }
            return Ok(());
        }
        let header = match topic.kind.has_header() {
            true => decoder.header(message.data)?,
            false => Header { stamp_ns: 0, frame_id: String::new() },
        };
        if topic.series.is_empty() {
            topic.describe(message, &header)?;
        }
        let stamp_ns = topic.stamp(&header, message);
        self.follow(message, stamp_ns);
        let marks = self.marks.len();
        let Some(topic) = self.topics.get_mut(&message.channel.topic) else { return Ok(()) };
        topic.add(message, stamp_ns, marks)
    }

    /// Watch a topic's clock, and mark the place where it steps back.
    fn follow(&mut self, message: &Message, stamp_ns: i64) {
        let Some(topic) = self.topics.get(&message.channel.topic) else { return };
        let mark = topic.course.steps_back(stamp_ns).then(|| self.mark()).flatten();
        if let Some(topic) = self.topics.get_mut(&message.channel.topic) {
            topic.course.take(stamp_ns, message.log_time_ns, mark);
        }
    }

    /// Number of a new mark; `None` where there were too many.
    fn mark(&mut self) -> Option<usize> {
        let links = self.transforms.lengths();
        self.marked += self.topics.len() + links.len() + self.unused.len();
        if self.marked > MOST_MARKED {
            self.marks.clear();
            return None;
        }
        let topics = self.topics.iter().map(|(name, topic)| (name.clone(), topic.mark())).collect();
        let unused = self.unused.iter().map(|unused| unused.messages).collect();
        self.marks.push(Mark { topics, links, unused });
        Some(self.marks.len() - 1)
    }

    fn open(&mut self, channel: &Arc<Channel>) -> Entry {
        match usable(channel) {
            Ok((kind, decoder)) => {
                let topic = || Topic::new(kind, channel.clone(), Arc::new(decoder), self.clock);
                self.topics.entry(channel.topic.clone()).or_insert_with(topic);
                Entry::Used
            }
            Err((kind, why)) => {
                let type_name = channel.schema.as_ref().map(|schema| schema.name.clone());
                let (topic, type_name) = (channel.topic.clone(), type_name.unwrap_or_default());
                self.unused.push(Unused { topic, type_name, why, kind, messages: 0 });
                Entry::Unused(self.unused.len() - 1)
            }
        }
    }

    fn finish(mut self, log: Log) -> Vec<Recording> {
        let log = Arc::new(log);
        let mut recordings = Vec::new();
        for beginning in self.beginnings().into_iter().rev() {
            recordings.push(self.split_off(&beginning, &log));
        }
        let Builder { topics, unused, transforms, .. } = self;
        recordings.push(Recording { log, topics, unused, transforms, jumped: Vec::new() });
        recordings.reverse();
        for index in 1..recordings.len() {
            let (before, after) = recordings.split_at_mut(index);
            after[0].inherit(&before[index - 1]);
        }
        recordings.iter_mut().for_each(Recording::settle);
        recordings
    }

    fn beginnings(&self) -> Vec<Beginning> {
        if self.marked > MOST_MARKED {
            return Vec::new();
        }
        let courses = self.topics.iter().map(|(name, topic)| (name.clone(), &topic.course));
        let last_ns = |topic: &str, mark: usize| self.marks[mark].topics.get(topic)?.last_ns;
        jumps::beginnings(&courses.collect(), &last_ns)
    }

    /// Cut off what comes after a jump.
    fn split_off(&mut self, beginning: &Beginning, log: &Arc<Log>) -> Recording {
        let first = &self.marks[beginning.mark];
        let own = |topic: &str| beginning.jumped.get(topic).map_or(first, |at| &self.marks[*at]);
        let mut topics = BTreeMap::new();
        let mut links = &first.links;
        for (name, topic) in &mut self.topics {
            let mark = own(name);
            if topic.kind == Kind::Transforms && beginning.jumped.contains_key(name) {
                links = &mark.links;
            }
            let at = mark.topics.get(name).copied().unwrap_or_default();
            topics.insert(name.clone(), topic.split_off(at));
        }
        let mut unused = self.unused.clone();
        for (index, (earlier, later)) in self.unused.iter_mut().zip(&mut unused).enumerate() {
            earlier.messages = first.unused.get(index).copied().unwrap_or_default();
            later.messages -= earlier.messages;
        }
        let transforms = self.transforms.split_off(links);
        let jumped = beginning.jumped.keys().cloned().collect();
        Recording { log: log.clone(), topics, unused, transforms, jumped }
    }
}

/// Whether and as what a channel can be read; else what it could be, and why it cannot.
fn usable(channel: &Channel) -> Result<(Kind, Decoder), (Option<Kind>, String)> {
    let record = channel.schema.as_ref();
    let record = record.ok_or((None, "the log has no definition for it".to_string()))?;
    let kind = Kind::of(&record.name);
    let kind = kind.ok_or((None, "a type that frames do not need".to_string()))?;
    let decoder = Decoder::of(channel).map_err(|why| (Some(kind), why))?;
    Ok((kind, decoder))
}
