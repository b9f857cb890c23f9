//! The Huffman codes of a baseline JPEG, and the bits that are written in them (ITU-T T.81, annex F).
//!
//! Reading is a chain: where a code begins is known when the one before it has been read, and this
//! is what decoding a JPEG spends most of its time on. So the chain is kept short, one look into a
//! table for a code and the number behind it, and free of branches that depend on the data.

/// Bits that are looked at together.
const LOOK_BITS: u32 = 11;

/// Zero bytes that [`Bits`] wants behind the data, so that it can read ahead.
pub const PADDING: usize = 16;

/// What the next bits say, in the bytes of a number, lowest first: how many bits the code and the
/// number behind it have, how many the code has alone (0: more than are looked at), how many the
/// number has (0 for such a code, too), and the symbol, which says that as well, and 16 x the
/// zeros before it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Look(u32);

impl Look {
    fn new(symbol: u8, code_bits: u8) -> Look {
        let number_bits = symbol & 15;
        Look(u32::from_le_bytes([code_bits + number_bits, code_bits, number_bits, symbol]))
    }

    /// Zeros before a number of one bit or more; `None` where no such code was seen.
    #[inline(always)]
    pub fn zeros(self) -> Option<usize> {
        (self.0 & 0xff_0000 != 0).then_some((self.0 >> 28) as usize)
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
    /// symbols that they stand for.
    ///
    /// `None` if there are more codes than so many bits can tell apart.
    pub fn new(counts: &[u8; 16], listed: &[u8]) -> Option<Codes> {
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
                    let look = Look::new(symbol, length as u8);
                    looks[from..from + (1 << rest_bits)].fill(look);
                }
                code += 1;
                place += 1;
            }
            ends[length as usize] = code << (16 - length);
            code <<= 1;
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
            self.window |= u64::from_be_bytes(*eight) >> self.count;
        }
        self.at += ((63 - self.count) >> 3) as usize;
        self.count |= 56;
    }

    #[inline(always)]
    pub fn skip(&mut self, bits: u32) {
        self.window <<= bits;
        self.count -= bits;
    }

    #[inline(always)]
    pub fn look(&self, codes: &Codes) -> Look {
        codes.looks[(self.window >> (64 - LOOK_BITS)) as usize]
    }

    /// The number that a look has seen a code for, with one bit or more; code and number are taken.
    #[inline(always)]
    pub fn take(&mut self, look: Look) -> i32 {
        let [_, code_bits, number_bits, _] = look.0.to_le_bytes();
        let number = number(self.window << (code_bits & 63), u32::from(number_bits));
        self.window <<= look.0 & 63;
        self.count = self.count.wrapping_sub(look.0 & 63);
        number
    }

    /// The symbol of the next code, which a look has seen; `None` if there is no such code.
    #[inline(always)]
    pub fn symbol(&mut self, codes: &Codes, look: Look) -> Option<u8> {
        let [_, code_bits, _, symbol] = look.0.to_le_bytes();
        if code_bits > 0 {
            self.skip(u32::from(code_bits));
            return Some(symbol);
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
        if bits == 0 {
            return 0;
        }
        let number = number(self.window, bits);
        self.skip(bits);
        number
    }
}

/// The number in the first 1 ... 15 bits; those whose first bit is 0 are negative (T.81, F.2.2.1).
#[inline(always)]
fn number(window: u64, bits: u32) -> i32 {
    let is_positive = (window as i64 >> 63) as i32;
    (window >> (64 - bits)) as i32 - (!is_positive & ((1 << bits) - 1))
}
