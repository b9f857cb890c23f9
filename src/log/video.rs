//! Compressed video: packets in their order, and from where each can be decoded.
//!
//! `foxglove.CompressedVideo` (<https://docs.foxglove.dev/docs/sdk/schemas/compressed-video>) has one
//! picture a message, Annex B, without B-frames; ROS 2's `ffmpeg_image_transport_msgs/FFMPEGPacket`
//! is the same with other names. A picture can be decoded if nothing between it and its key frame is
//! missing, and that is read from the packets themselves: reference pictures are counted in them.

use std::ops::Range;

use crate::{
    error::{Error, Result},
    log::{
        h264::{Access, Parser, Sequence},
        reader::Place,
        value::Struct,
    },
};

/// Most sets of parameters in one video: encoders have one, or a few.
const MAX_PARAMETER_SETS: usize = 64;

/// One packet with a picture.
#[derive(Clone, Copy, Debug)]
pub struct Packet {
    pub stamp_ns: i64,
    pub place: Place,
    pub access: Access,
    /// Of a key frame: index of its parameters.
    pub parameters: Option<usize>,
}

/// Parameters of some packets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameters {
    /// As a packet of their own.
    pub units: Vec<u8>,
    pub sequence: Sequence,
}

/// All pictures of one topic.
#[derive(Clone, Debug, Default)]
pub struct Video {
    /// In the order of their stamps, once [finished](Video::finish).
    pub packets: Vec<Packet>,
    pub parameters: Vec<Parameters>,
    /// What the first message that is no H.264 says that it is.
    pub other_codec: Option<String>,
    parser: Parser,
}

/// Why a picture cannot be decoded although its packet is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Broken {
    /// The log begins within a group of pictures.
    NoKeyFrame,
    /// A packet between it and its key frame is missing.
    Lost,
}

impl Video {
    /// Note a message; whether it holds a picture.
    ///
    /// # Errors
    ///
    /// [`Error::Decode`] if it is no packet of a video.
    pub fn add(&mut self, stamp_ns: i64, place: Place, message: &Struct) -> Result<bool> {
        let codec = message.text("format").or_else(|_| message.text("encoding"))?;
        if !is_h264(codec) {
            self.other_codec.get_or_insert_with(|| codec.to_string());
            return Ok(true);
        }
        let fail =
            |what: String| Error::Decode { schema: message.name.to_string(), offset: 0, what };
        let Some((access, sequence)) = self.parser.read(message.bytes("data")?).map_err(fail)?
        else {
            return Ok(false);
        };
        if let Some(sequence) = sequence {
            let parameters = Parameters { units: self.parser.parameters(), sequence };
            if self.parameters.last() != Some(&parameters) {
                if self.parameters.len() == MAX_PARAMETER_SETS {
                    return Err(fail("more changes of parameters than a video may have".into()));
                }
                self.parameters.push(parameters);
            }
        }
        let parameters = sequence.map(|_| self.parameters.len() - 1);
        self.packets.push(Packet { stamp_ns, place, access, parameters });
        Ok(true)
    }

    /// Cut off what comes from a packet on, in the order in which they were added.
    pub fn split_off(&mut self, at: usize) -> Video {
        let packets = self.packets.split_off(at.min(self.packets.len()));
        Video { packets, ..self.clone() }
    }

    /// Bring the packets into the order of their stamps.
    pub fn finish(&mut self) {
        self.packets.sort_by_key(|packet| packet.stamp_ns);
    }

    /// Of every packet, the packets that have to be decoded to see its picture: from its key frame
    /// to itself.
    pub fn chains(&self) -> Vec<Result<Range<usize>, Broken>> {
        let period_ns = self.median_period_ns().max(1);
        let mut chains = Vec::with_capacity(self.packets.len());
        let mut key = Err(Broken::NoKeyFrame);
        let mut references = 0;
        for (at, packet) in self.packets.iter().enumerate() {
            let access = packet.access;
            if access.is_key {
                key = Ok(at);
                references = 0;
            } else if key.is_ok() {
                // A count that fits may still be another group's, or have gone round: where so many
                // packets could have been in between, it proves nothing.
                let since_ns = packet.stamp_ns - self.packets[at - 1].stamp_ns;
                let room = (since_ns + period_ns / 2) / period_ns - 1;
                let may_be_another = room > 0 && i64::from(access.reference_count) <= room;
                let follows = access.reference_count == (references + 1) % access.count_period;
                if may_be_another || !follows {
                    key = Err(Broken::Lost);
                }
            }
            if access.is_reference {
                references = access.reference_count;
            }
            chains.push(key.map(|key| key..at + 1));
        }
        chains
    }

    /// When a picture first depends on a later one.
    pub fn first_bidirectional_ns(&self) -> Option<i64> {
        self.packets.iter().find(|p| p.access.is_bidirectional).map(|packet| packet.stamp_ns)
    }

    fn median_period_ns(&self) -> i64 {
        let steps = self.packets.windows(2).map(|pair| pair[1].stamp_ns - pair[0].stamp_ns);
        let mut steps: Vec<i64> = steps.collect();
        steps.sort_unstable();
        steps.get(steps.len() / 2).copied().unwrap_or_default()
    }
}

/// The codec by Foxglove's name, or an encoder of FFmpeg's by its own: `h264`, `libx264`,
/// `h264_nvenc`, `h264;yuv420p;...`.
fn is_h264(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    name.contains("264") || name.contains("avc")
}
