//! The segments of a JPEG before its picture data (ITU-T T.81, annex B).

/// Marker of the segment that a scan begins with.
pub const START_OF_SCAN: u8 = 0xda;

/// A marker with what belongs to it.
#[derive(Clone, Copy, Debug)]
pub struct Segment<'a> {
    pub marker: u8,
    pub body: &'a [u8],
    /// Where the next one begins in the file, or the data of the scan.
    pub end: usize,
}

/// The segments up to the first scan's, in their order; an error ends them.
pub fn segments(jpeg: &[u8]) -> impl Iterator<Item = Result<Segment<'_>, String>> {
    let mut next = Some(2);
    std::iter::from_fn(move || {
        let segment = segment(jpeg, next?);
        next = segment.as_ref().filter(|s| s.marker != START_OF_SCAN).map(|segment| segment.end);
        let damaged = || "a JPEG whose header is cut off or damaged".to_string();
        Some(segment.ok_or_else(damaged))
    })
}

fn segment(jpeg: &[u8], mut at: usize) -> Option<Segment<'_>> {
    // Any number of fill bytes may stand before a marker.
    while jpeg.get(at..at + 2)? == [0xff, 0xff] {
        at += 1;
    }
    let &[0xff, marker, high, low] = jpeg.get(at..at + 4)? else { return None };
    let end = at + 2 + usize::from(u16::from_be_bytes([high, low]));
    Some(Segment { marker, body: jpeg.get(at + 4..end)?, end })
}
