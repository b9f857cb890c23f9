//! The Huffman codes of a baseline JPEG, and the bits that are written in them (ITU-T T.81, annex F).
//!
//! Reading is a chain: where a code begins is known when the one before it has been read, and this
//! is what decoding a JPEG spends most of its time on. So the chain is kept short: one look into a
//! table for two codes and the numbers behind them, free of branches that depend on the data.

/// Bits that are looked at together. With one more, two tables would not fit the nearest 48 KB.
const LOOK_BITS: u32 = 11;

/// Bits that are looked at for the size of a mean's change; a small table, since the large ones need
/// the room near the processor.
const MEAN_BITS: u32 = 9;

/// Looks that the bits of one [`Bits::fill`] are enough for.
pub const LOOKS_A_FILL: usize = 4;

/// Zero bytes that [`Bits`] wants behind the data, so that it can read ahead.
pub const PADDING: usize = 16;

/// Added to the place in a block by the code that ends it.
pub const END: usize = 128;

/// What the next bits say: up to two coefficients.
#[derive(Clone, Copy, Debug, Default)]
pub struct Look {
    /// How far the first code leads in the block: the zeros before its number and the number, or
    /// [`END`]; 0 where the look does not see all of it, or it is none.
    pub first: u8,
    /// The same for the second one; 0 where it was not seen.
    pub second: u8,
    /// The numbers behind them; 0 where there is none.
    pub numbers: [i16; 2],
    /// Bits of all that is seen.
    bits: u8,
    /// Bits of the first code and its number; of the code alone where `first` is 0, and then its
    /// symbol is the first number.
    first_bits: u8,
}

impl Look {
    /// A code whose number, if any, is not seen, or not meant.
    fn symbol(symbol: u8, code_bits: u32) -> Look {
        Look { first_bits: code_bits as u8, numbers: [i16::from(symbol), 0], ..Look::default() }
    }

    /// A code with its number.
    fn one(zeros: u8, number: i16, bits: u32) -> Look {
        let (first, bits) = (zeros + 1, bits as u8);
        Look { first, numbers: [number, 0], bits, first_bits: bits, ..Look::default() }
    }

    /// With what is seen behind it.
    fn and(self, next: Look) -> Look {
        let bits = self.bits + next.bits;
        let is_end = self.first == 0 || usize::from(self.first) == END;
        if is_end || next.first == 0 || u32::from(bits) > LOOK_BITS {
            return self;
        }
        Look { second: next.first, numbers: [self.numbers[0], next.numbers[0]], bits, ..self }
    }
}

/// A table of codes.
#[derive(Clone, Debug)]
pub struct Codes {
    looks: Box<[Look; 1 << LOOK_BITS]>,
    /// Symbols of short codes, each with the bits of its code; 0 bits for others.
    short: Box<[(u8, u8); 1 << MEAN_BITS]>,
    /// By length of the code: codes of up to this length lie below this, left-aligned in 16 bits.
    ends: [u32; 17],
    /// By length: what to add to a code for its place among the symbols.
    places: [i32; 17],
    symbols: [u8; 256],
}

impl Codes {
    /// A table as a `DHT` segment has it: how many codes there are of 1 ... 16 bits, and the
    /// symbols that they stand for; `in_pairs` where a look may see two of them with their numbers.
    ///
    /// `None` if there are more codes than so many bits can tell apart.
    pub fn new(counts: &[u8; 16], listed: &[u8], in_pairs: bool) -> Option<Codes> {
        let mut symbols = [0; 256];
        symbols.get_mut(..listed.len())?.copy_from_slice(listed);
        let mut looks = Box::new([Look::default(); 1 << LOOK_BITS]);
        let mut short = Box::new([(0, 0); 1 << MEAN_BITS]);
        let (mut ends, mut places) = ([0; 17], [0; 17]);
        let (mut code, mut place) = (0_u32, 0);
        for length in 1..=16 {
            places[length as usize] = place as i32 - code as i32;
            for _ in 0..counts[length as usize - 1] {
                let symbol = *listed.get(place)?;
                if code >= 1 << length {
                    return None;
                }
                if let Some(rest_bits) = MEAN_BITS.checked_sub(length) {
                    let from = (code << rest_bits) as usize;
                    short[from..from + (1 << rest_bits)].fill((symbol, length as u8));
                }
                if let Some(rest_bits) = LOOK_BITS.checked_sub(length) {
                    let from = (code << rest_bits) as usize;
                    let seen = &mut looks[from..from + (1 << rest_bits)];
                    match in_pairs {
                        true => fill_in(seen, symbol, length, rest_bits),
                        false => seen.fill(Look::symbol(symbol, length)),
                    }
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
                *look = look.and(alone[(at << look.bits) % alone.len()]);
            }
        }
        Some(Codes { looks, short, ends, places, symbols })
    }
}

/// What is seen where a code of so many bits stands first, by the rest of the look.
fn fill_in(seen: &mut [Look], symbol: u8, code_bits: u32, rest_bits: u32) {
    let (zeros, number_bits) = (symbol >> 4, u32::from(symbol & 15));
    match (zeros, number_bits) {
        (0, 0) => seen.fill(Look::one(END as u8 - 1, 0, code_bits)),
        (15, 0) => seen.fill(Look::one(zeros, 0, code_bits)),
        (_, 1..11) if number_bits <= rest_bits => {
            for (at, same) in seen.chunks_exact_mut(1 << (rest_bits - number_bits)).enumerate() {
                let number = number((at as u64) << (64 - number_bits), number_bits);
                same.fill(Look::one(zeros, number as i16, code_bits + number_bits));
            }
        }
        _ => seen.fill(Look::symbol(symbol, code_bits)),
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

    /// Go on behind all that a look has seen.
    #[inline(always)]
    pub fn skip_both(&mut self, look: Look) {
        self.skip(u32::from(look.bits) & 63);
    }

    /// Go on behind the first.
    #[inline(always)]
    pub fn skip_first(&mut self, look: Look) {
        self.skip(u32::from(look.first_bits) & 63);
    }

    /// The symbol of the next code, of which a look has seen no number; `None` if there is no such
    /// code.
    #[inline(always)]
    pub fn symbol(&mut self, codes: &Codes, look: Look) -> Option<u8> {
        if look.first_bits > 0 {
            self.skip_first(look);
            return Some(look.numbers[0] as u8);
        }
        let next = (self.window >> 48) as u32;
        let length = (LOOK_BITS as usize + 1..=16).find(|length| next < codes.ends[*length])?;
        self.skip(length as u32);
        let place = (next >> (16 - length)) as i32 + codes.places[length];
        codes.symbols.get(place as usize).copied()
    }

    /// The size of a mean's change; `None` if there is no such code.
    #[inline(always)]
    pub fn mean_size(&mut self, codes: &Codes) -> Option<u8> {
        let (size, length) = codes.short[(self.window >> (64 - MEAN_BITS)) as usize];
        if length > 0 {
            self.skip(u32::from(length));
            return Some(size);
        }
        self.symbol(codes, self.look(codes))
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
