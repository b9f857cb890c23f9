//! H.264 as far as seeking needs it: where a picture begins, and what it depends on.
//!
//! ITU-T H.264 (08/2021): units (annex B), parameter sets (7.3.2.1, 7.3.2.2, E.1.1), slice headers
//! (7.3.3). Pictures themselves are decoded elsewhere.

use std::collections::BTreeMap;

/// Kinds of units.
const SLICE: u8 = 1;
const KEY_SLICE: u8 = 5;
const SEQUENCE_PARAMETERS: u8 = 7;
const PICTURE_PARAMETERS: u8 = 8;

/// Longest unit of parameters that is read: a hundred times an ordinary one.
const MAX_PARAMETER_BYTES: usize = 1 << 12;

/// Bytes of a slice that hold the part of its header that is read.
const SLICE_HEAD_BYTES: usize = 32;

/// What a packet adds to a video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Access {
    /// Decoding can begin here: nothing before it is referred to after it.
    pub is_key: bool,
    /// Later pictures may refer to it.
    pub is_reference: bool,
    /// Parts of it are predicted from later pictures (B slices), which come before it in the stream.
    pub is_bidirectional: bool,
    /// Number of reference pictures since the key frame, modulo `count_period`; 0 of 1 as long as no
    /// parameters came that say how it is written.
    pub reference_count: u32,
    pub count_period: u32,
}

/// What a sequence parameter set says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sequence {
    /// Of the coded picture, whole macroblocks: at least as large as the shown one.
    pub coded_width: usize,
    pub coded_height: usize,
    pub count_bits: u32,
    pub has_separate_planes: bool,
    /// `matrix_coefficients`, table E-5; `None` if not said.
    pub matrix: Option<u8>,
    pub is_full_range: bool,
}

/// Reads the packets of one video, in the order in which they lie in the log.
#[derive(Clone, Debug, Default)]
pub struct Parser {
    sequences: BTreeMap<u32, Sequence>,
    /// Sequence of each set of picture parameters.
    pictures: BTreeMap<u32, u32>,
    /// The units of parameters as they were, by kind and id.
    parameters: BTreeMap<(u8, u32), Vec<u8>>,
}

impl Parser {
    /// Read the heads of a packet; `None` if it has parameters and no picture. A key frame comes
    /// with the sequence that begins with it.
    ///
    /// # Errors
    ///
    /// A sentence: what is wrong with the packet.
    pub fn read(&mut self, packet: &[u8]) -> Result<Option<(Access, Option<Sequence>)>, String> {
        let mut picture: Option<(Access, Option<Sequence>)> = None;
        for unit in units(packet) {
            let kind = unit[0] & 0x1f;
            match kind {
                SEQUENCE_PARAMETERS | PICTURE_PARAMETERS => {
                    if unit.len() > MAX_PARAMETER_BYTES {
                        return Err(format!("parameters of {} bytes", unit.len()));
                    }
                    let content = unescaped(&unit[1..], unit.len());
                    let bits = &mut Bits::new(&content);
                    let id = match kind {
                        SEQUENCE_PARAMETERS => {
                            let (id, sequence) =
                                sequence(bits).ok_or("unreadable sequence parameters")?;
                            self.sequences.insert(id, sequence);
                            id
                        }
                        _ => {
                            let ids = bits.unsigned().zip(bits.unsigned());
                            let (id, of) = ids
                                .filter(|(id, of)| *id < 256 && *of < 32)
                                .ok_or("unreadable picture parameters")?;
                            self.pictures.insert(id, of);
                            id
                        }
                    };
                    self.parameters.insert((kind, id), unit.to_vec());
                }
                SLICE | KEY_SLICE => {
                    let (first_macroblock, access, sequence) = self.slice(unit, kind)?;
                    match &mut picture {
                        Some(_) if first_macroblock == 0 => {
                            return Err("several pictures in one packet".to_string());
                        }
                        Some((picture, _)) => picture.is_bidirectional |= access.is_bidirectional,
                        None => picture = Some((access, sequence)),
                    }
                }
                _ => {}
            }
        }
        match units(packet).next() {
            None => Err("no H.264 of annex B: it has no start code".to_string()),
            Some(_) => Ok(picture),
        }
    }

    /// All parameters so far, as a packet: a decoder that begins at a key frame needs them first.
    pub fn parameters(&self) -> Vec<u8> {
        let units = self.parameters.values();
        units.flat_map(|unit| [&[0, 0, 0, 1], unit.as_slice()].concat()).collect()
    }

    fn slice(&self, unit: &[u8], kind: u8) -> Result<(u32, Access, Option<Sequence>), String> {
        let content = unescaped(&unit[1..], SLICE_HEAD_BYTES);
        let bits = &mut Bits::new(&content);
        let head = |bits: &mut Bits| Some([bits.unsigned()?, bits.unsigned()?, bits.unsigned()?]);
        let [first_macroblock, slice_type, parameters] = head(bits).ok_or("unreadable slice")?;
        let mut access = Access {
            is_key: kind == KEY_SLICE,
            is_reference: unit[0] & 0x60 != 0,
            // Table 7-6: 1 is B, and 6 says that all slices of the picture are.
            is_bidirectional: slice_type % 5 == 1,
            reference_count: 0,
            count_period: 1,
        };
        if self.parameters.is_empty() && !access.is_key {
            return Ok((first_macroblock, access, None));
        }
        let sequence = self.pictures.get(&parameters).and_then(|id| self.sequences.get(id));
        let sequence = sequence.ok_or("a picture whose parameters did not come before it")?;
        if sequence.has_separate_planes {
            bits.take(2);
        }
        access.reference_count = bits.take(sequence.count_bits).ok_or("unreadable slice")?;
        access.count_period = 1 << sequence.count_bits;
        Ok((first_macroblock, access, Some(*sequence).filter(|_| access.is_key)))
    }
}

/// The units of a packet, without their start codes.
fn units(packet: &[u8]) -> impl Iterator<Item = &[u8]> {
    let mut rest = start_code(packet).map(|at| &packet[at + 3..]);
    std::iter::from_fn(move || {
        let unit = rest?;
        let end = start_code(unit);
        rest = end.map(|at| &unit[at + 3..]);
        Some(&unit[..end.unwrap_or(unit.len())])
    })
    // A start code may have four bytes, whose first then ends the unit before it.
    .map(|unit| unit.strip_suffix(&[0]).unwrap_or(unit))
    .filter(|unit| !unit.is_empty())
}

fn start_code(bytes: &[u8]) -> Option<usize> {
    bytes.windows(3).position(|three| three == [0, 0, 1])
}

/// The first bytes of a unit's content: a 3 behind two zeros only keeps start codes apart.
fn unescaped(unit: &[u8], most: usize) -> Vec<u8> {
    let mut zeros = 0;
    let content = unit.iter().take(most).copied().filter(|byte| {
        let is_escape = zeros >= 2 && *byte == 3;
        zeros = if *byte == 0 { zeros + 1 } else { 0 };
        !is_escape
    });
    content.collect()
}

/// A sequence parameter set and its id; `None` if it is not readable or makes no sense.
fn sequence(bits: &mut Bits) -> Option<(u32, Sequence)> {
    let profile = bits.take(8)?;
    bits.take(16)?;
    let id = bits.unsigned().filter(|id| *id < 32)?;
    let mut has_separate_planes = false;
    if [100, 110, 122, 244, 44, 83, 86, 118, 128, 138, 139, 134, 135].contains(&profile) {
        let chroma_format = bits.unsigned()?;
        if chroma_format == 3 {
            has_separate_planes = bits.flag()?;
        }
        bits.unsigned()?;
        bits.unsigned()?;
        bits.flag()?;
        if bits.flag()? {
            let lists = if chroma_format == 3 { 12 } else { 8 };
            for list in 0..lists {
                if bits.flag()? {
                    skip_scaling_list(bits, if list < 6 { 16 } else { 64 })?;
                }
            }
        }
    }
    let count_bits = bits.unsigned().filter(|more| *more <= 12)? + 4;
    match bits.unsigned()? {
        0 => {
            bits.unsigned()?;
        }
        1 => {
            bits.flag()?;
            bits.signed()?;
            bits.signed()?;
            for _ in 0..bits.unsigned().filter(|count| *count < 256)? {
                bits.signed()?;
            }
        }
        _ => {}
    }
    bits.unsigned()?;
    bits.flag()?;
    let side = |macroblocks: u32| macroblocks.checked_add(1)?.checked_mul(16).map(|n| n as usize);
    let coded_width = side(bits.unsigned()?)?;
    let map_height = side(bits.unsigned()?)?;
    let is_progressive = bits.flag()?;
    if !is_progressive {
        bits.flag()?;
    }
    bits.flag()?;
    if bits.flag()? {
        for _edge in 0..4 {
            bits.unsigned()?;
        }
    }
    let (matrix, is_full_range) = if bits.flag()? { colour(bits)? } else { (None, false) };
    let coded_height = map_height.checked_mul(if is_progressive { 1 } else { 2 })?;
    let sequence = Sequence {
        coded_width,
        coded_height,
        count_bits,
        has_separate_planes,
        matrix,
        is_full_range,
    };
    Some((id, sequence))
}

/// Matrix and range of the beginning of the usability information (E.1.1).
fn colour(bits: &mut Bits) -> Option<(Option<u8>, bool)> {
    if bits.flag()? && bits.take(8)? == 255 {
        bits.take(32)?;
    }
    if bits.flag()? {
        bits.flag()?;
    }
    if !bits.flag()? {
        return Some((None, false));
    }
    bits.take(3)?;
    let is_full_range = bits.flag()?;
    let matrix = if bits.flag()? {
        bits.take(16)?;
        // 2 is "unspecified".
        Some(bits.take(8)? as u8).filter(|matrix| *matrix != 2)
    } else {
        None
    };
    Some((matrix, is_full_range))
}

fn skip_scaling_list(bits: &mut Bits, len: usize) -> Option<()> {
    let (mut last, mut next) = (8, 8);
    for _ in 0..len {
        if next != 0 {
            next = (last + bits.signed()?).rem_euclid(256);
        }
        last = if next == 0 { last } else { next };
    }
    Some(())
}

/// Bits from the highest of the first byte on.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bits<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Bits { bytes, at: 0 }
    }

    fn flag(&mut self) -> Option<bool> {
        let byte = self.bytes.get(self.at / 8)?;
        let bit = byte >> (7 - self.at % 8) & 1;
        self.at += 1;
        Some(bit == 1)
    }

    /// An unsigned number of up to 32 bits.
    fn take(&mut self, bits: u32) -> Option<u32> {
        (0..bits).try_fold(0u32, |number, _| Some(number << 1 | u32::from(self.flag()?)))
    }

    /// Exp-Golomb code (9.1): as many zeros as bits follow the first one.
    fn unsigned(&mut self) -> Option<u32> {
        let mut zeros = 0;
        while !self.flag()? {
            zeros += 1;
            if zeros > 31 {
                return None;
            }
        }
        Some((1u32 << zeros) - 1 + self.take(zeros)?)
    }

    fn signed(&mut self) -> Option<i32> {
        let code = i64::from(self.unsigned()?);
        i32::try_from(if code % 2 == 1 { (code + 1) / 2 } else { -code / 2 }).ok()
    }
}
