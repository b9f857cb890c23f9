//! Luma and colour differences to a baseline JPEG 4:2:0 (ITU-T T.81, annexes B and F; JFIF 1.01).
//!
//! What is stored has the samples of such a JPEG already: no pixel has to become red, green and blue
//! for an encoder that would make them again.

use pulp::{Arch, Simd, WithSimd};

use crate::dataset::picture::{
    jpeg_baseline::until_ff,
    jpeg_forward::Factors,
    jpeg_tables::{AC, COEFFICIENTS, DC, Listed, QUANTISERS},
    planes::Stored,
};

/// Samples of luma on a side of a unit of the scan, and of a block.
const UNIT: usize = 16;
const BLOCK: usize = 8;

/// Blocks in a unit, and most bytes of one: each number with its code has 27 bits at most.
const BLOCKS_A_UNIT: usize = 6;
const MOST_BYTES: usize = 27 * COEFFICIENTS / 8;

/// Most zeros before a coefficient that one code tells of.
const MOST_ZEROS: usize = 15;

/// Symbols of 16 zeros, and of zeros up to the end of a block.
const SIXTEEN_ZEROS: usize = 0xf0;
const END_OF_BLOCK: usize = 0;

/// Write a picture, quality 1 ... 100.
///
/// # Errors
///
/// A sentence, if the picture is too large for the format.
pub fn write(picture: &Stored, quality: u8) -> Result<Vec<u8>, String> {
    let sides = u16::try_from(picture.width).ok().zip(u16::try_from(picture.height).ok());
    let (width, height) = sides.ok_or("more than 65,535 pixels on a side")?;
    let quantisers = QUANTISERS.map(|table| table.map(|divisor| scaled(divisor, quality)));
    let mut scan = Scan::default();
    let parts = [0, 1].map(|kind| Part {
        factors: Factors::new(&quantisers[kind]),
        dc: codes(&DC[kind]),
        ac: codes(&AC[kind]),
    });
    Arch::new().dispatch(Writing { picture, parts: &parts, scan: &mut scan });
    Ok(scan.finish(header(width, height, &quantisers)))
}

/// A divisor of quality 50 at another one, as libjpeg scales it.
fn scaled(divisor: u8, quality: u8) -> u8 {
    let quality = u32::from(quality.clamp(1, 100));
    let percent = if quality < 50 { 5000 / quality } else { 200 - 2 * quality };
    ((u32::from(divisor) * percent + 50) / 100).clamp(1, 255) as u8
}

/// Everything before the data of the scan.
fn header(width: u16, height: u16, quantisers: &[[u8; COEFFICIENTS]; 2]) -> Vec<u8> {
    let mut jpeg = vec![0xff, 0xd8];
    let mut segment = |marker: u8, body: &[&[u8]]| {
        let len = 2 + body.iter().map(|part| part.len()).sum::<usize>();
        jpeg.extend([0xff, marker]);
        jpeg.extend((len as u16).to_be_bytes());
        body.iter().for_each(|part| jpeg.extend_from_slice(part));
    };
    segment(0xe0, &[b"JFIF\0", &[1, 1, 0, 0, 1, 0, 1, 0, 0]]);
    for (slot, quantiser) in (0..).zip(quantisers) {
        segment(0xdb, &[&[slot], quantiser]);
    }
    let ([w1, w0], [h1, h0]) = (width.to_be_bytes(), height.to_be_bytes());
    segment(0xc0, &[&[8, h1, h0, w1, w0, 3, 1, 0x22, 0, 2, 0x11, 1, 3, 0x11, 1]]);
    for (class, tables) in [(0, &DC), (1, &AC)] {
        for (slot, Listed { counts, symbols }) in (0..).zip(tables) {
            segment(0xc4, &[&[class << 4 | slot], counts, symbols]);
        }
    }
    segment(0xda, &[&[3, 1, 0, 2, 0x11, 3, 0x11, 0, 63, 0]]);
    jpeg
}

/// What luma, or the colour differences, are written with.
struct Part {
    factors: Factors,
    dc: [Code; 256],
    ac: [Code; 256],
}

/// A code, with room behind it for the number that follows.
#[derive(Clone, Copy, Default)]
struct Code {
    code: u32,
    /// Bits of both.
    bits: u32,
}

/// Codes by symbol, of which the lower half tells the bits of the number.
fn codes(table: &Listed) -> [Code; 256] {
    let mut codes = [Code::default(); 256];
    let mut symbols = table.symbols.iter();
    let mut code = 0;
    for (length, count) in (1..).zip(table.counts) {
        for symbol in symbols.by_ref().take(usize::from(count)) {
            let number_bits = u32::from(symbol & 15);
            let bits = length + number_bits;
            codes[usize::from(*symbol)] = Code { code: code << number_bits, bits };
            code += 1;
        }
        code <<= 1;
    }
    codes
}

/// Writing, to be compiled for each kind of vector unit; what it gives is the same.
struct Writing<'w> {
    picture: &'w Stored,
    parts: &'w [Part; 2],
    scan: &'w mut Scan,
}

impl WithSimd for Writing<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        write_units(self.picture, self.parts, self.scan);
    }
}

/// Unit by unit: four blocks of luma, and one of each colour difference.
#[inline(always)]
fn write_units(picture: &Stored, parts: &[Part; 2], scan: &mut Scan) {
    let Stored { width, height, ref data } = *picture;
    let (luma, colour) = picture.lens();
    let (first, rest) = data.split_at(luma);
    let (second, third) = rest.split_at(colour);
    let (across, down) = (width.div_ceil(UNIT), height.div_ceil(UNIT));
    let mut rows = [
        Rows::new(first, width, across * UNIT, UNIT),
        Rows::new(second, width / 2, across * BLOCK, BLOCK),
        Rows::new(third, width / 2, across * BLOCK, BLOCK),
    ];
    let mut means = [0; 3];
    for unit_row in 0..down {
        rows.iter_mut().for_each(|rows| rows.load(unit_row));
        scan.make_room(across * BLOCKS_A_UNIT);
        for unit in 0..across {
            for (index, rows) in rows.iter().enumerate() {
                let side = rows.height / BLOCK;
                let part = &parts[index.min(1)];
                for (y, x) in (0..side * side).map(|block| (block / side, block % side)) {
                    let from = y * BLOCK * rows.row_len + (unit * side + x) * BLOCK;
                    let coefficients =
                        part.factors.coefficients(&rows.samples[from..], rows.row_len);
                    scan.block(&coefficients, &mut means[index], part);
                }
            }
        }
    }
}

/// The rows of a plane that a row of units takes, its border repeated to their ends.
struct Rows<'p> {
    plane: &'p [u8],
    width: usize,
    row_len: usize,
    height: usize,
    samples: Vec<f32>,
}

impl<'p> Rows<'p> {
    fn new(plane: &'p [u8], width: usize, row_len: usize, height: usize) -> Rows<'p> {
        Rows { plane, width, row_len, height, samples: vec![0.0; row_len * height] }
    }

    fn load(&mut self, unit_row: usize) {
        let last = self.plane.len() / self.width - 1;
        for (y, row) in self.samples.chunks_exact_mut(self.row_len).enumerate() {
            let from = (unit_row * self.height + y).min(last) * self.width;
            let (inside, beyond) = row.split_at_mut(self.width);
            for (sample, byte) in inside.iter_mut().zip(&self.plane[from..][..self.width]) {
                *sample = f32::from(*byte);
            }
            beyond.fill(inside[self.width - 1]);
        }
    }
}

/// The data of a scan, without the zeros that keep a byte of 0xff from being read as a marker.
#[derive(Default)]
struct Scan {
    /// All that is written, with room behind it.
    data: Vec<u8>,
    bits: Bits,
}

/// Where writing has come to.
#[derive(Clone, Copy, Default)]
struct Bits {
    /// Bytes that are whole.
    bytes: usize,
    /// Bits behind them, fewer than 8, left-aligned in what has zeros behind them.
    count: u32,
    started: u64,
}

impl Scan {
    /// Make room for so many blocks.
    fn make_room(&mut self, blocks: usize) {
        self.data.resize(self.bits.bytes + blocks * MOST_BYTES + size_of::<u64>(), 0);
    }

    /// Write a block; `mean` is that of the block before it.
    #[inline(always)]
    fn block(&mut self, coefficients: &[i16; COEFFICIENTS], mean: &mut i16, part: &Part) {
        let change = coefficients[0].wrapping_sub(*mean);
        *mean = coefficients[0];
        let mut bits = self.number(self.bits, change, 0, &part.dc);
        let mut rest = nonzero(coefficients) & !1;
        let mut next = 1;
        while rest != 0 {
            let at = rest.trailing_zeros() as usize;
            let mut zeros = at - next;
            while zeros > MOST_ZEROS {
                bits = self.put(bits, part.ac[SIXTEEN_ZEROS], 0);
                zeros -= MOST_ZEROS + 1;
            }
            bits = self.number(bits, coefficients[at % COEFFICIENTS], zeros, &part.ac);
            rest &= rest - 1;
            next = at + 1;
        }
        if next < COEFFICIENTS {
            bits = self.put(bits, part.ac[END_OF_BLOCK], 0);
        }
        self.bits = bits;
    }

    /// Write a number with the zeros before it. Of a negative one, the number below it is written,
    /// without its sign (T.81, F.1.2.1).
    #[inline(always)]
    fn number(&mut self, bits: Bits, number: i16, zeros: usize, codes: &[Code; 256]) -> Bits {
        let number = i32::from(number);
        let size = (2 * number.unsigned_abs() + 1).ilog2();
        let number = (number + (number >> 31)) as u32 & ((1 << size) - 1);
        self.put(bits, codes[(zeros << 4 | size as usize) & 0xff], number)
    }

    /// Eight bytes are written each time, however many are whole by then: that is sooner done than
    /// asked.
    #[inline(always)]
    fn put(&mut self, before: Bits, Code { code, bits }: Code, number: u32) -> Bits {
        let count = before.count + bits;
        let started = before.started | u64::from(code | number) << ((64 - count) & 63);
        self.data[before.bytes..][..size_of::<u64>()].copy_from_slice(&started.to_be_bytes());
        Bits {
            bytes: before.bytes + (count / 8) as usize,
            count: count % 8,
            started: started << (count & !7 & 63),
        }
    }

    /// Behind what is in the file already, the last byte filled up with ones.
    fn finish(mut self, mut jpeg: Vec<u8>) -> Vec<u8> {
        self.make_room(1);
        let Bits { bytes, .. } = self.put(self.bits, Code { code: 0x7f, bits: 7 }, 0);
        self.data.truncate(bytes);
        let mut rest = &self.data[..];
        while let Some(at) = until_ff(rest) {
            jpeg.extend_from_slice(&rest[..=at]);
            jpeg.push(0);
            rest = &rest[at + 1..];
        }
        jpeg.extend_from_slice(rest);
        jpeg.extend([0xff, 0xd9]);
        jpeg
    }
}

/// Which coefficients are not zero, the first one in the lowest bit.
#[inline(always)]
fn nonzero(coefficients: &[i16; COEFFICIENTS]) -> u64 {
    let flags = coefficients.map(|coefficient| u8::from(coefficient != 0));
    // Of eight bytes of 0 or 1, the product has them side by side in its highest byte.
    let eight =
        |bytes: &[u8; 8]| u64::from_le_bytes(*bytes).wrapping_mul(0x0102_0408_1020_4080) >> 56;
    let (pieces, _) = flags.as_chunks();
    pieces.iter().rev().fold(0, |all, bytes| all << 8 | eight(bytes))
}
