//! Stands in for the H.264 decoder in builds without it: there is none.

use crate::{dataset::picture::rgb::Rgb, log::video::Parameters};

/// Whether pmp was built with a decoder.
pub const IS_BUILT_IN: bool = false;

/// A decoder that cannot be.
#[derive(Debug)]
pub enum Decoder {}

impl Decoder {
    /// # Errors
    ///
    /// Always.
    pub fn new(_parameters: &Parameters) -> Result<Decoder, String> {
        Err("pmp was built without the feature `h264`".to_string())
    }

    /// # Errors
    ///
    /// Never called.
    pub fn decode(&mut self, _packet: &[u8], _is_wanted: bool) -> Result<Option<Rgb>, String> {
        match *self {}
    }
}
