//! Luma and colour differences to a baseline JPEG 4:2:0 (ITU-T T.81, annexes B and F; JFIF 1.01).
//!
//! What is stored has the samples of such a JPEG already: no pixel has to become red, green and blue
//! for an encoder that would make them again.

use crate::dataset::picture::{
    jpeg_forward::Factors,
    jpeg_tables::{AC, COEFFICIENTS, DC, Listed, QUANTISERS},
    planes::Stored,
};

/// Samples of luma on a side of a unit of the scan, and of a block.
const UNIT: usize = 16;
const BLOCK: usize = 8;

/// Blocks in a unit, and most bytes of one: each number with its code has 27 bits at most, and any
/// byte may be one that a zero follows.
const BLOCKS_A_UNIT: usize = 6;
const MOST_BYTES: usize = 2 * 27 * COEFFICIENTS / 8;

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
    let mut scan = Scan::new(header(width, height, &quantisers));
    let parts = [0, 1].map(|kind| Part {
        factors: Factors::new(&quantisers[kind]),
        dc: codes(&DC[kind]),
        ac: codes(&AC[kind]),
    });
    write_units(picture, &parts, &mut scan);
    Ok(scan.finish())
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

/// Unit by unit: four blocks of luma, and one of each colour difference.
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

/// The data of a scan.
struct Scan {
    /// All that is written, with room behind it.
    jpeg: Vec<u8>,
    /// Bytes that are written.
    len: usize,
    bits: Bits,
}

/// Bits that are not written yet, the newest lowest.
#[derive(Clone, Copy, Default)]
struct Bits {
    waiting: u64,
    /// How many: fewer than 32.
    count: u32,
}

impl Scan {
    /// Begin behind a header.
    fn new(header: Vec<u8>) -> Scan {
        Scan { len: header.len(), jpeg: header, bits: Bits::default() }
    }

    /// Make room for so many blocks.
    fn make_room(&mut self, blocks: usize) {
        self.jpeg.resize(self.len + blocks * MOST_BYTES, 0);
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

    #[inline(always)]
    fn put(&mut self, before: Bits, Code { code, bits }: Code, number: u32) -> Bits {
        let waiting = before.waiting << (bits & 31) | u64::from(code | number);
        let count = before.count + bits;
        if count < 32 {
            return Bits { waiting, count };
        }
        self.write((waiting >> (count & 31)) as u32);
        Bits { waiting, count: count - 32 }
    }

    #[inline(always)]
    fn write(&mut self, four: u32) {
        let bytes = four.to_be_bytes();
        // A byte of 0xff is one of zero in what this is the complement of.
        let has_ff = (!four).wrapping_sub(0x0101_0101) & four & 0x8080_8080 != 0;
        if has_ff {
            bytes.into_iter().for_each(|byte| self.byte(byte));
        } else {
            self.jpeg[self.len..][..4].copy_from_slice(&bytes);
            self.len += 4;
        }
    }

    /// A zero keeps a byte of 0xff from being read as a marker.
    fn byte(&mut self, byte: u8) {
        self.jpeg[self.len] = byte;
        self.len += 1 + usize::from(byte == 0xff);
    }

    /// The file, its last byte filled up with ones.
    fn finish(mut self) -> Vec<u8> {
        self.make_room(1);
        let Bits { waiting, count } = self.bits;
        let missing = (8 - count % 8) % 8;
        let rest = ((waiting + 1) << missing) - 1;
        (0..(count + missing) / 8).rev().for_each(|at| self.byte((rest >> (8 * at)) as u8));
        self.jpeg.truncate(self.len);
        self.jpeg.extend([0xff, 0xd9]);
        self.jpeg
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
