//! Memory that is used again.
//!
//! A training step asks for the same large buffers as the one before. Given back to the system
//! they cost page faults, 12 % of a step's time, so they are kept here.

use std::{
    collections::BTreeMap,
    ops::{Deref, DerefMut},
    sync::Mutex,
};

/// Most memory that lies here unused, bytes; what comes back beyond that goes to the system.
pub const KEPT_BYTES: usize = 1 << 28;

/// Buffers in use by nobody, by their length.
struct Free {
    by_len: BTreeMap<usize, Vec<Vec<f32>>>,
    bytes: usize,
}

static FREE: Mutex<Free> = Mutex::new(Free { by_len: BTreeMap::new(), bytes: 0 });

/// Numbers that go back to where they came from when dropped.
#[derive(Debug)]
pub struct Buffer {
    numbers: Vec<f32>,
    len: usize,
    /// Whether it is kept here when dropped.
    kept: bool,
}

impl Buffer {
    /// `len` numbers of any value.
    pub fn any(len: usize) -> Self {
        // Lengths in few sizes, so that a layer finds what another left behind.
        let size = (len.max(1)).next_multiple_of((len.next_power_of_two() / 16).max(64));
        let mut free = lock();
        let found =
            free.by_len.range_mut(size..=size + size / 2).find(|(_, kept)| !kept.is_empty());
        let numbers = found.and_then(|(_, kept)| kept.pop());
        free.bytes -= numbers.as_ref().map_or(0, |numbers| 4 * numbers.len());
        drop(free);
        Self { numbers: numbers.unwrap_or_else(|| vec![0.0; size]), len, kept: true }
    }

    /// `len` zeros that go back to the allocator: for what lives from the forward pass to the way
    /// back, and makes room there for gradients of other sizes.
    pub fn passing(len: usize) -> Self {
        Self { numbers: vec![0.0; len], len, kept: false }
    }

    /// `len` zeros.
    pub fn zeros(len: usize) -> Self {
        let mut buffer = Self::any(len);
        buffer.fill(0.0);
        buffer
    }
}

impl Deref for Buffer {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.numbers[..self.len]
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        &mut self.numbers[..self.len]
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        let numbers = std::mem::take(&mut self.numbers);
        if !self.kept {
            return;
        }
        let mut free = lock();
        let bytes = free.bytes + 4 * numbers.len();
        if bytes <= KEPT_BYTES {
            free.bytes = bytes;
            free.by_len.entry(numbers.len()).or_default().push(numbers);
        }
    }
}

/// Let the process keep memory that it has freed, instead of giving it back to the system and
/// taking page faults when it asks for it again. For programs that train: tensors that are not
/// [`Buffer`]s, such as gradients, come and go with every step. To be called
/// before other threads are started; does something with glibc only.
pub fn keep_freed_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    crate::foreign::keep_freed_memory();
}

/// Give all that lies here unused back to the system.
pub fn release() {
    let mut free = lock();
    free.by_len.clear();
    free.bytes = 0;
}

fn lock() -> std::sync::MutexGuard<'static, Free> {
    // A panic elsewhere leaves the lists whole: nothing is done to them in two steps that can fail.
    FREE.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}
