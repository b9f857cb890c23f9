//! Baseline JPEG, the kind that cameras write, decoded down to its coefficients (ITU-T T.81).
//!
//! Everything that is stored of a block is read, and each run of blocks has to end where its bits
//! end. So data that lacks within is noticed although the file ends as it should, which libraries
//! that fill up what is missing do not tell.

use std::sync::{Arc, LazyLock};

use crate::dataset::picture::{
    jpeg_codes::{Bits, Codes, END, LOOKS_A_FILL, Look, PADDING},
    jpeg_header::Header,
    jpeg_segments::{START_OF_SCAN, segments},
    jpeg_tables::{self, COEFFICIENTS, Listed},
};

/// Luma, or a colour difference.
#[derive(Clone, Debug)]
pub struct Component {
    /// Blocks beside and above each other in each unit of the scan: 1 or 2.
    pub across: usize,
    pub down: usize,
    /// What the coefficients are to be multiplied by, in the order in which they are stored.
    pub quantiser: [u16; COEFFICIENTS],
    dc: Arc<Codes>,
    ac: Arc<Codes>,
}

/// Tables of codes by class, of means and of what differs from them, and by slot.
type Tables = [[Option<Arc<Codes>>; 4]; 2];

/// A file of one scan, ready to be decoded.
#[derive(Clone, Debug)]
pub struct Baseline<'a> {
    pub width: usize,
    pub height: usize,
    /// Luma alone, or luma, Cb, Cr; only luma has more than one block a unit.
    pub components: Vec<Component>,
    /// Units of the scan between two restarts.
    restart_interval: Option<usize>,
    /// Data of the scan, and what comes after it.
    data: &'a [u8],
}

/// Takes the coefficients of one block.
pub trait Block {
    /// Coefficient `at` in the order in which they are stored, less than [`COEFFICIENTS`].
    fn set(&mut self, at: usize, value: i32);
}

/// Takes a picture block by block.
pub trait Blocks {
    type Block: Block;

    /// What takes the next block of this component.
    fn block(&mut self, component: usize) -> &mut Self::Block;

    /// That block is whole: the one in this column and row of the component's.
    fn done(&mut self, component: usize, column: usize, row: usize);
}

/// For who only wants to know whether a picture is whole.
struct Unseen;

impl Block for Unseen {
    #[inline(always)]
    fn set(&mut self, _at: usize, _value: i32) {}
}

impl Blocks for Unseen {
    type Block = Unseen;

    #[inline(always)]
    fn block(&mut self, _component: usize) -> &mut Unseen {
        self
    }

    #[inline(always)]
    fn done(&mut self, _component: usize, _column: usize, _row: usize) {}
}

impl<'a> Baseline<'a> {
    /// Read the tables; `None` for other kinds of JPEG, and where the tables are not usable.
    pub fn read(jpeg: &'a [u8], header: &Header) -> Option<Baseline<'a>> {
        let mut quantisers: [Option<[u16; COEFFICIENTS]>; 4] = [None; 4];
        let mut codes: Tables = Default::default();
        let mut restart_interval = None;
        let mut frame = None;
        for segment in segments(jpeg) {
            let segment = segment.ok()?;
            match segment.marker {
                0xdb => read_quantisers(segment.body, &mut quantisers)?,
                0xc4 => read_codes(segment.body, &mut codes)?,
                0xdd => {
                    let units = u16::from_be_bytes(*segment.body.first_chunk()?);
                    restart_interval = Some(usize::from(units)).filter(|units| *units > 0);
                }
                0xc0 if frame.is_none() => frame = Some(segment.body),
                START_OF_SCAN => {
                    let components = components(frame?, segment.body, &quantisers, &codes)?;
                    let is_colour = components.len() == 3;
                    return (!is_colour || !header.is_rgb).then_some(Baseline {
                        width: header.width,
                        height: header.height,
                        components,
                        restart_interval,
                        data: &jpeg[segment.end..],
                    });
                }
                // Frames of other kinds, arithmetic coding, a height that comes later.
                0xc1..=0xcf | 0xdc => return None,
                _ => {}
            }
        }
        None
    }

    /// Whether the picture is whole.
    ///
    /// # Errors
    ///
    /// A sentence: what is wrong with it.
    pub fn check(&self) -> Result<(), String> {
        self.decode(&mut Unseen)
    }

    /// Units of the scan in a row, and rows of them.
    pub fn units(&self) -> (usize, usize) {
        let luma = &self.components[0];
        (self.width.div_ceil(8 * luma.across), self.height.div_ceil(8 * luma.down))
    }

    /// Decode block by block.
    ///
    /// # Errors
    ///
    /// A sentence: what is wrong with the picture.
    // A trait rather than closures, which cannot be made to be compiled for the caller's vector
    // unit.
    #[inline(always)]
    pub fn decode(&self, blocks: &mut impl Blocks) -> Result<(), String> {
        let (units_across, units_down) = self.units();
        let all = units_across * units_down;
        let mut runs = Runs { data: self.data, at: 0, bytes: Vec::new() };
        let mut unit = 0;
        for run in 0.. {
            let end = self.restart_interval.map_or(all, |units| all.min(unit + units));
            let mut bits = Bits::new(runs.next(run)?);
            let mut previous = [0; 3];
            while unit < end {
                let (column, row) = (unit % units_across, unit / units_across);
                for (index, component) in self.components.iter().enumerate() {
                    for y in 0..component.down {
                        for x in 0..component.across {
                            let dc = &mut previous[index];
                            read_block(&mut bits, component, dc, blocks.block(index))
                                .ok_or("damaged data of a JPEG")?;
                            let at = (column * component.across + x, row * component.down + y);
                            blocks.done(index, at.0, at.1);
                        }
                    }
                }
                if bits.left() < 0 {
                    return Err("a JPEG that lacks some of its data".to_string());
                }
                unit += 1;
            }
            if bits.left() >= 8 {
                return Err("a JPEG with data beyond its picture".to_string());
            }
            if unit == all {
                break;
            }
        }
        Ok(())
    }
}

/// Read one block; `None` if a code is none, or there are more coefficients than a block has.
#[inline(always)]
fn read_block(
    bits: &mut Bits,
    component: &Component,
    previous: &mut i32,
    block: &mut impl Block,
) -> Option<()> {
    bits.fill();
    let size = bits.mean_size(&component.dc)?;
    if size > 11 {
        return None;
    }
    // A hostile file may sum up to anything.
    *previous = previous.wrapping_add(bits.number(u32::from(size)));
    block.set(0, *previous);
    let mut at = 1;
    'block: while at < COEFFICIENTS {
        bits.fill();
        for _ in 0..LOOKS_A_FILL {
            let look = bits.look(&component.ac);
            if look.first == 0 {
                bits.fill();
                at += rare(bits, component, look, at, block)?;
                continue 'block;
            }
            at += usize::from(look.first);
            block.set((at - 1) % COEFFICIENTS, i32::from(look.numbers[0]));
            if at >= COEFFICIENTS {
                // What is seen behind it is of the next block.
                bits.skip_first(look);
                break 'block;
            }
            at += usize::from(look.second);
            block.set((at - 1) % COEFFICIENTS, i32::from(look.numbers[1]));
            bits.skip_both(look);
            if at >= COEFFICIENTS {
                break 'block;
            }
        }
    }
    let is_whole = at == COEFFICIENTS || (END..END + COEFFICIENTS).contains(&at);
    is_whole.then_some(())
}

/// Codes that are long, or have long numbers: how far they lead; `None` for what is no code.
// Within its caller, whose bits would otherwise lie in memory all the time.
#[inline(always)]
fn rare(
    bits: &mut Bits,
    component: &Component,
    look: Look,
    at: usize,
    block: &mut impl Block,
) -> Option<usize> {
    let symbol = bits.symbol(&component.ac, look)?;
    match (usize::from(symbol >> 4), symbol & 15) {
        (0, 0) => Some(END),
        (15, 0) => Some(16),
        (_, 0 | 11..) => None,
        (zeros, size) => {
            block.set((at + zeros) % COEFFICIENTS, bits.number(u32::from(size)));
            Some(zeros + 1)
        }
    }
}

/// The runs of a scan's data between its restarts.
struct Runs<'a> {
    data: &'a [u8],
    at: usize,
    bytes: Vec<u8>,
}

impl Runs<'_> {
    /// The bytes of the next run, number `run` from 0, as they were before bytes of 0xff got a
    /// zero behind them; with padding.
    fn next(&mut self, run: usize) -> Result<&[u8], String> {
        let cut = || "a JPEG that is cut off: it has no end".to_string();
        if run > 0 {
            let restart = 0xd0 + ((run - 1) % 8) as u8;
            if self.data.get(self.at..self.at + 2) != Some(&[0xff, restart]) {
                return Err("a JPEG that lacks some of its data".to_string());
            }
            self.at += 2;
        }
        self.bytes.clear();
        loop {
            let rest = self.data.get(self.at..).ok_or_else(cut)?;
            let plain = until_ff(rest).ok_or_else(cut)?;
            self.bytes.extend_from_slice(&rest[..plain]);
            self.at += plain;
            match rest.get(plain + 1).ok_or_else(cut)? {
                0 => {
                    self.bytes.push(0xff);
                    self.at += 2;
                }
                // Fill bytes before a marker.
                0xff => self.at += 1,
                _ => break,
            }
        }
        self.bytes.extend_from_slice(&[0; PADDING]);
        Ok(&self.bytes)
    }
}

/// Where the first byte of 0xff is.
pub fn until_ff(bytes: &[u8]) -> Option<usize> {
    // Many at once, where there is none.
    let has_ff = |some: &[u8; 32]| some.iter().fold(false, |found, byte| found | (*byte == 0xff));
    let (pieces, _) = bytes.as_chunks();
    let from = 32 * pieces.iter().take_while(|piece| !has_ff(piece)).count();
    Some(from + bytes[from..].iter().position(|byte| *byte == 0xff)?)
}

fn read_quantisers(mut body: &[u8], into: &mut [Option<[u16; COEFFICIENTS]>; 4]) -> Option<()> {
    while let [about, rest @ ..] = body {
        let (wide, slot) = (usize::from(about >> 4), usize::from(about & 15));
        let len = COEFFICIENTS * (1 + wide);
        let table = rest.get(..len).filter(|_| wide <= 1)?;
        let entry = |at: usize| match wide {
            0 => u16::from(table[at]),
            _ => u16::from_be_bytes([table[2 * at], table[2 * at + 1]]),
        };
        *into.get_mut(slot)? = Some(std::array::from_fn(entry));
        body = &rest[len..];
    }
    Some(())
}

/// A table as it is listed, and made ready.
type Known = (Listed, Arc<Codes>);

/// The tables of codes that most cameras write with, made once: of means, and of what differs from
/// them.
static STANDARD: LazyLock<[Vec<Known>; 2]> = LazyLock::new(|| {
    let made = |listed: &[Listed; 2], in_pairs: bool| {
        let codes = |one: &Listed| Codes::new(&one.counts, one.symbols, in_pairs);
        listed.iter().filter_map(|one| Some((*one, Arc::new(codes(one)?)))).collect()
    };
    [made(&jpeg_tables::DC, false), made(&jpeg_tables::AC, true)]
});

fn read_codes(mut body: &[u8], into: &mut Tables) -> Option<()> {
    while let [about, rest @ ..] = body {
        let (class, slot) = (usize::from(about >> 4), usize::from(about & 15));
        let (counts, rest) = rest.split_first_chunk()?;
        let len = counts.iter().map(|count| usize::from(*count)).sum();
        let symbols = rest.get(..len)?;
        let is_same = |(listed, _): &&Known| listed.counts == *counts && listed.symbols == symbols;
        let codes = match STANDARD.get(class)?.iter().find(is_same) {
            Some((_, codes)) => codes.clone(),
            None => Arc::new(Codes::new(counts, symbols, class == 1)?),
        };
        *into.get_mut(class)?.get_mut(slot)? = Some(codes);
        body = &rest[len..];
    }
    Some(())
}

/// The components of a frame in the order of the scan, which has to be the same.
fn components(
    frame: &[u8],
    scan: &[u8],
    quantisers: &[Option<[u16; COEFFICIENTS]>; 4],
    codes: &Tables,
) -> Option<Vec<Component>> {
    let [8, _, _, _, _, count, in_frame @ ..] = frame else { return None };
    let [in_scan_count, in_scan @ ..] = scan else { return None };
    let count = usize::from(*count);
    if ![1, 3].contains(&count)
        || usize::from(*in_scan_count) != count
        || in_frame.len() != 3 * count
        || in_scan.len() != 2 * count + 3
    {
        return None;
    }
    let pairs = in_frame.chunks_exact(3).zip(in_scan.chunks_exact(2));
    let component = |(index, (frame, scan)): (usize, (&[u8], &[u8]))| {
        let (across, down) = (usize::from(frame[1] >> 4), usize::from(frame[1] & 15));
        let table = |class: usize, slot: u8| codes[class].get(usize::from(slot))?.clone();
        let most = if index == 0 { 2 } else { 1 };
        if frame[0] != scan[0] || !(1..=most).contains(&across) || !(1..=most).contains(&down) {
            return None;
        }
        Some(Component {
            // One component alone has one block a unit, whatever it says (T.81, A.2.2).
            across: if count == 1 { 1 } else { across },
            down: if count == 1 { 1 } else { down },
            quantiser: (*quantisers.get(usize::from(frame[2]))?)?,
            dc: table(0, scan[1] >> 4)?,
            ac: table(1, scan[1] & 15)?,
        })
    };
    pairs.enumerate().map(component).collect()
}
