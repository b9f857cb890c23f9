//! A file that is hashed while it is read, so that its checksum costs no second reading.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    os::unix::fs::FileExt,
};

use sha2::{Digest, Sha256};

use crate::atomic::hex;

/// Reads forward, and hashes every byte once, those that are skipped as well.
pub struct HashedFile {
    file: File,
    position: u64,
    /// All bytes before this one are in the hash.
    hashed: u64,
    sha256: Sha256,
}

impl HashedFile {
    /// Read a file from its beginning.
    pub fn new(file: File) -> HashedFile {
        HashedFile { file, position: 0, hashed: 0, sha256: Sha256::new() }
    }

    /// SHA-256 of the whole file, lower-case hexadecimal; reads what is left of it.
    ///
    /// # Errors
    ///
    /// If the file cannot be read.
    pub fn finish(mut self) -> io::Result<String> {
        self.hash_up_to(u64::MAX)?;
        Ok(hex(&self.sha256.finalize()))
    }

    /// Hash what was skipped before `end`, or before the end of the file.
    fn hash_up_to(&mut self, end: u64) -> io::Result<()> {
        let mut buffer = vec![0; 1 << 16];
        while self.hashed < end {
            let most = usize::try_from(end - self.hashed).unwrap_or(usize::MAX).min(buffer.len());
            let read = self.file.read_at(&mut buffer[..most], self.hashed)?;
            if read == 0 {
                break;
            }
            self.sha256.update(&buffer[..read]);
            self.hashed += read as u64;
        }
        Ok(())
    }
}

impl Read for HashedFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.position > self.hashed {
            self.hash_up_to(self.position)?;
        }
        let read = self.file.read_at(buffer, self.position)?;
        self.position += read as u64;
        if self.position > self.hashed {
            let fresh = (self.position - self.hashed) as usize;
            self.sha256.update(&buffer[read - fresh.min(read)..read]);
            self.hashed = self.position;
        }
        Ok(read)
    }
}

impl Seek for HashedFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = match to {
            SeekFrom::Start(position) => position,
            SeekFrom::Current(by) => self.position.saturating_add_signed(by),
            SeekFrom::End(by) => self.file.metadata()?.len().saturating_add_signed(by),
        };
        Ok(self.position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn every_byte_is_hashed_once_whatever_is_read_twice_or_skipped() {
        let bytes: Vec<u8> = (0..300_000_u32).map(|i| ((i * 7919) >> 5) as u8).collect();
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(&bytes).unwrap();
        let expected = hex(&Sha256::digest(&bytes));
        // Steps of (seek to, then read so many).
        for steps in [vec![], vec![(0, 300_000)], vec![(0, 10), (200_000, 5), (199_000, 2_000)]] {
            let mut hashed = HashedFile::new(file.reopen().unwrap());
            for (at, len) in steps {
                hashed.seek(SeekFrom::Start(at)).unwrap();
                let mut read = vec![0; len];
                hashed.read_exact(&mut read).unwrap();
                assert_eq!(read, bytes[at as usize..at as usize + len]);
            }
            assert_eq!(hashed.finish().unwrap(), expected);
        }
    }
}
