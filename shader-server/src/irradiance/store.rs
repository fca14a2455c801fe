//! A table that many threads fill at once.

use std::{
    collections::HashMap,
    hash::{BuildHasher, BuildHasherDefault, Hash, Hasher},
    sync::{Arc, PoisonError, RwLock},
};

/// Parts with a lock each, so that threads seldom meet.
const PARTS: usize = 64;

type Part<K, V> = RwLock<HashMap<K, Arc<V>, BuildHasherDefault<Mixer>>>;

/// Hashes the few small numbers of a lattice key; nobody chooses those to make them collide.
#[derive(Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u8(*b));
    }

    fn write_u8(&mut self, value: u8) {
        self.write_u32(value.into());
    }

    fn write_i32(&mut self, value: i32) {
        self.write_u32(value.cast_unsigned());
    }

    fn write_u32(&mut self, value: u32) {
        let mixed = (self.0 ^ u64::from(value)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = mixed ^ (mixed >> 29);
    }

    fn finish(&self) -> u64 {
        self.0.wrapping_mul(0xBF58_476D_1CE4_E5B9)
    }
}

/// Values by key; made once, never changed, never removed.
#[derive(Debug)]
pub(crate) struct Store<K, V> {
    parts: Vec<Part<K, V>>,
}

impl<K: Eq + Hash + Copy, V> Store<K, V> {
    /// Nothing yet.
    pub(crate) fn new() -> Self {
        Self {
            parts: (0..PARTS).map(|_| RwLock::default()).collect(),
        }
    }

    fn part(&self, key: &K) -> &Part<K, V> {
        let hash = BuildHasherDefault::<Mixer>::default().hash_one(key);
        &self.parts[(hash >> 58) as usize % PARTS]
    }

    /// The value of a key, made by `make` if there is none. No lock is held while it is in use.
    pub(crate) fn value(&self, key: K, make: impl FnOnce() -> V) -> Arc<V> {
        let part = self.part(&key);
        let known = part.read().unwrap_or_else(PoisonError::into_inner);
        if let Some(value) = known.get(&key) {
            return Arc::clone(value);
        }
        drop(known);
        let mut known = part.write().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(known.entry(key).or_insert_with(|| Arc::new(make())))
    }

    /// Puts a value in place.
    pub(crate) fn put(&self, key: K, value: Arc<V>) {
        let mut known = self
            .part(&key)
            .write()
            .unwrap_or_else(PoisonError::into_inner);
        known.insert(key, value);
    }

    /// Visits all, in no order.
    pub(crate) fn each(&self, mut visit: impl FnMut(&K, &Arc<V>)) {
        for part in &self.parts {
            let part = part.read().unwrap_or_else(PoisonError::into_inner);
            part.iter().for_each(|(key, value)| visit(key, value));
        }
    }
}
