//! The pictures of a video, each decoded from its key frame on.
//!
//! A picture depends on all packets since its key frame, so these are decoded as well and thrown
//! away. What is decoded for a block of ticks depends on that block alone, so that blocks can be
//! made on any thread.

use std::{collections::BTreeMap, ops::Range};

#[cfg(feature = "h264")]
use crate::dataset::picture::h264::{self, Decoder};
#[cfg(not(feature = "h264"))]
use crate::dataset::picture::h264_absent::{self as h264, Decoder};
use crate::{
    dataset::picture::rgb::Rgb,
    drops::Reason,
    error::Result,
    log::{
        reader::{Log, Place, SegmentReader},
        recording::Topic,
        video::{Broken, Video},
    },
};

/// Why a picture is left out.
pub type LeftOut = (Reason, String);

/// A video that can be decoded.
#[derive(Debug, PartialEq)]
pub struct Footage {
    /// Of every packet by its place, what has to be decoded for it.
    chains: BTreeMap<Place, Result<Range<usize>, Broken>>,
}

impl Footage {
    /// The pictures of a video.
    ///
    /// # Errors
    ///
    /// A sentence and what to do: a codec that is not built in, or pictures that depend on later
    /// ones.
    pub fn new(video: &Video) -> Result<Footage, (String, &'static str)> {
        let again = "encode it again as H.264 without B-frames \
                     (ffmpeg ... -c:v libx264 -bf 0), or as JPEG pictures";
        if let Some(codec) = &video.other_codec {
            let what =
                format!("its video is `{codec}`, and H.264 is the only codec that pmp reads");
            return Err((what, again));
        }
        if !h264::IS_BUILT_IN {
            let hint = "build pmp with the feature `h264` (on by default; needs a C++ compiler), \
                        or record JPEG pictures";
            return Err(("its video is H.264, and pmp was built without it".to_string(), hint));
        }
        if let Some(at_ns) = video.first_bidirectional_ns() {
            let what = format!(
                "its video has B-frames, pictures that depend on later ones (the first at \
                 {at_ns} ns)"
            );
            return Err((what, again));
        }
        let places = video.packets.iter().map(|packet| packet.place);
        Ok(Footage { chains: places.zip(video.chains()).collect() })
    }

    /// Hand on the pictures of some packets, in the order of the video. Of pictures that cannot be
    /// had, the reason.
    ///
    /// # Errors
    ///
    /// If the log cannot be read any more.
    pub fn decode(
        &self,
        log: &Log,
        topic: &Topic,
        wanted: &[Place],
        on_picture: &mut dyn FnMut(Place, Result<Rgb, LeftOut>),
    ) -> Result<()> {
        let Some(video) = &topic.video else { return Ok(()) };
        // By key frame: the packets to see.
        let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for place in wanted {
            match self.chains.get(place) {
                Some(Ok(chain)) => groups.entry(chain.start).or_default().push(chain.end - 1),
                Some(Err(Broken::Lost)) => {
                    let what = "a packet between it and its key frame is missing";
                    on_picture(*place, Err((Reason::ImageDamaged, what.to_string())));
                }
                Some(Err(Broken::NoKeyFrame)) | None => {
                    let what = "the log has no key frame of the video before it";
                    on_picture(*place, Err((Reason::ImageBeforeKeyFrame, what.to_string())));
                }
            }
        }
        let mut reader = SegmentReader::new(log);
        for (start, mut group) in groups {
            group.sort_unstable();
            let parameters = video.packets[start].parameters.map(|at| &video.parameters[at]);
            let mut decoder = parameters.ok_or("no parameters".to_string()).and_then(Decoder::new);
            let last = group.last().copied().unwrap_or(start);
            for (at, packet) in video.packets[start..=last].iter().enumerate() {
                let is_wanted = group.binary_search(&(start + at)).is_ok();
                let picture = match &mut decoder {
                    Ok(decoder) => {
                        let message = topic.decode(reader.message(&packet.place)?);
                        message
                            .and_then(|message| {
                                Ok(decoder.decode(message.bytes("data")?, is_wanted))
                            })
                            .unwrap_or_else(|error| Err(error.to_string()))
                    }
                    Err(why) => Err(why.clone()),
                };
                match picture {
                    Ok(Some(rgb)) => on_picture(packet.place, Ok(rgb)),
                    Ok(None) => {}
                    Err(why) => {
                        if is_wanted {
                            let left_out = (Reason::ImageDamaged, why.clone());
                            on_picture(packet.place, Err(left_out));
                        }
                        decoder = Err(why);
                    }
                }
            }
        }
        Ok(())
    }
}
