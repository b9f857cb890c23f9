//! The Huffman codes of a baseline JPEG, and the bits that are written in them (ITU-T T.81, annex F).
//!
//! Reading is a chain: where a code begins is known when the one before it has been read, and this
//! is what decoding a JPEG spends most of its time on. So the chain is kept short: one look into a
//! table for two codes and the numbers behind them, free of branches that depend on the data.

/// Bits that are looked at together.
const LOOK_BITS: u32 = 11;

/// Zero bytes that [`Bits`] wants behind the data, so that it can read ahead.
pub const PADDING: usize = 16;

/// Added to the place in a block by the code that ends it.
pub const END: usize = 128;

/// What the next bits say: up to two coefficients.
#[derive(Clone, Copy, Debug, Default)]
pub struct Look {
    /// How far the first one leads in the block: the zeros before it and itself, or [`END`]; 0
    /// where the code is longer than the look, tells of zeros alone, or is none.
    pub first: u8,
    /// The same for the second one; 0 where it was not seen.
    pub second: u8,
    /// Bits of the first code, and of the number behind it.
    first_code: u8,
    first_number: u8,
    /// Bits up to the second number, and of it.
    to_second: u8,
    second_number: u8,
    /// Bits of both.
    bits: u8,
    /// The symbol of the first code; of use where its code has bits.
    symbol: u8,
}

impl Look {
    /// What a code says alone.
    fn one(symbol: u8, code_bits: u8) -> Look {
        let (zeros, number_bits) = (symbol >> 4, symbol & 15);
        let first = match (zeros, number_bits) {
            (0, 0) => END as u8,
            (_, 0 | 11..) => 0,
            _ => zeros + 1,
        };
        let bits = code_bits + number_bits;
        Look {
            first,
            first_code: code_bits,
            first_number: number_bits,
            bits,
            symbol,
            ..Look::default()
        }
    }

    /// With what is seen behind it.
    fn and(self, next: Look) -> Look {
        let to_second = self.bits + next.first_code;
        if self.first_number == 0 || next.first == 0 || u32::from(to_second) > LOOK_BITS {
            return self;
        }
        let bits = self.bits + next.bits;
        Look { second: next.first, to_second, second_number: next.first_number, bits, ..self }
    }
}

/// A table of codes.
#[derive(Clone, Debug)]
pub struct Codes {
    looks: Box<[Look; 1 << LOOK_BITS]>,
    /// By length of the code: codes of up to this length lie below this, left-aligned in 16 bits.
    ends: [u32; 17],
    /// By length: what to add to a code for its place among the symbols.
    places: [i32; 17],
    symbols: [u8; 256],
}

impl Codes {
    /// A table as a `DHT` segment has it: how many codes there are of 1 ... 16 bits, and the
    /// symbols that they stand for; `in_pairs` where a look may see two of them.
    ///
    /// `None` if there are more codes than so many bits can tell apart.
    pub fn new(counts: &[u8; 16], listed: &[u8], in_pairs: bool) -> Option<Codes> {
        let mut symbols = [0; 256];
        symbols.get_mut(..listed.len())?.copy_from_slice(listed);
        let mut looks = Box::new([Look::default(); 1 << LOOK_BITS]);
        let (mut ends, mut places) = ([0; 17], [0; 17]);
        let (mut code, mut place) = (0_u32, 0);
        for length in 1..=16 {
            places[length as usize] = place as i32 - code as i32;
            for _ in 0..counts[length as usize - 1] {
                let symbol = *listed.get(place)?;
                if code >= 1 << length {
                    return None;
                }
                if let Some(rest_bits) = LOOK_BITS.checked_sub(length) {
                    let from = (code << rest_bits) as usize;
                    let look = Look::one(symbol, length as u8);
                    looks[from..from + (1 << rest_bits)].fill(look);
                }
                code += 1;
                place += 1;
            }
            ends[length as usize] = code << (16 - length);
            code <<= 1;
        }
        if in_pairs {
            let alone = looks.clone();
            for (at, look) in looks.iter_mut().enumerate() {
                // What is not known of the bits behind the look is not asked for.
                *look = look.and(alone[(at << look.bits.min(16)) % alone.len()]);
            }
        }
        Some(Codes { looks, ends, places, symbols })
    }
}

/// Reads codes and numbers from a run of bits.
#[derive(Debug)]
pub struct Bits<'d> {
    /// With [`PADDING`] zeros at its end.
    data: &'d [u8],
    /// Of the next byte that is not in the window.
    at: usize,
    /// The next bits, left-aligned; what lies behind the first `count` may be there or not.
    window: u64,
    count: u32,
}

impl<'d> Bits<'d> {
    /// Read data that has [`PADDING`] zeros at its end.
    pub fn new(data: &'d [u8]) -> Bits<'d> {
        Bits { data, at: 0, window: 0, count: 0 }
    }

    /// Bits that are left; negative where more were read than there are.
    pub fn left(&self) -> i64 {
        let end = self.data.len() as i64 - PADDING as i64;
        8 * (end - self.at as i64) + i64::from(self.count)
    }

    /// Make sure of 56 bits in the window.
    #[inline(always)]
    pub fn fill(&mut self) {
        if let Some(eight) = self.data.get(self.at..).and_then(|rest| rest.first_chunk()) {
            self.window |= u64::from_be_bytes(*eight) >> (self.count & 63);
        }
        self.at += ((63 - (self.count & 63)) >> 3) as usize;
        self.count |= 56;
    }

    #[inline(always)]
    pub fn skip(&mut self, bits: u32) {
        self.window <<= bits;
        self.count = self.count.wrapping_sub(bits);
    }

    #[inline(always)]
    pub fn look(&self, codes: &Codes) -> Look {
        codes.looks[(self.window >> (64 - LOOK_BITS)) as usize]
    }

    /// The first number that a look has seen a code for, and the second, 0 where there is none.
    #[inline(always)]
    pub fn numbers(&self, look: Look) -> [i32; 2] {
        let at = |from: u8, bits: u8| number(self.window << (from & 63), u32::from(bits & 15));
        [at(look.first_code, look.first_number), at(look.to_second, look.second_number)]
    }

    /// Go on behind both.
    #[inline(always)]
    pub fn skip_both(&mut self, look: Look) {
        self.skip(u32::from(look.bits) & 63);
    }

    /// Go on behind the first.
    #[inline(always)]
    pub fn skip_first(&mut self, look: Look) {
        self.skip(u32::from(look.first_code + look.first_number) & 63);
    }

    /// The symbol of the next code, which a look has seen; `None` if there is no such code.
    #[inline(always)]
    pub fn symbol(&mut self, codes: &Codes, look: Look) -> Option<u8> {
        if look.first_code > 0 {
            self.skip(u32::from(look.first_code) & 63);
            return Some(look.symbol);
        }
        let next = (self.window >> 48) as u32;
        let length = (LOOK_BITS as usize + 1..=16).find(|length| next < codes.ends[*length])?;
        self.skip(length as u32);
        let place = (next >> (16 - length)) as i32 + codes.places[length];
        codes.symbols.get(place as usize).copied()
    }

    /// The next number of `bits` bits, 0 ... 15.
    #[inline(always)]
    pub fn number(&mut self, bits: u32) -> i32 {
        let number = number(self.window, bits);
        self.skip(bits);
        number
    }
}

/// The number in the first 0 ... 15 bits; those whose first bit is 0 are negative (T.81, F.2.2.1).
#[inline(always)]
fn number(window: u64, bits: u32) -> i32 {
    let is_positive = (window as i64 >> 63) as i32;
    (window >> 1 >> (63 - bits)) as i32 - (!is_positive & ((1 << bits) - 1))
}
