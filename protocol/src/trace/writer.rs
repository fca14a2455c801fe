//! Entries to bytes.

use std::io::{self, Write};

use super::format::{ENTRY_HEADER, Entry, Header, UNCHECKED, put, put_header};
use crate::codec::EncodeError;
use crate::limits::{MAX_TRACE_ENTRY, MAX_TRACE_HEADER};
use crate::messages::VERSION;

/// A trace cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file cannot be written to.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// An entry cannot be encoded.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// An entry or the header is longer than readers take.
    #[error("{bytes} bytes are more than an entry of a trace may have ({limit})")]
    TooLong {
        /// Its length, bytes.
        bytes: usize,
        /// Most that is allowed, bytes.
        limit: usize,
    },
}

/// Writes a trace, each entry in one go.
pub struct TraceWriter<W> {
    output: W,
    bytes: Vec<u8>,
    last_us: u64,
    written: u64,
}

impl<W: Write> TraceWriter<W> {
    /// Begins a trace.
    ///
    /// # Errors
    /// Every [`WriteError`].
    pub fn new(mut output: W, header: &Header) -> Result<Self, WriteError> {
        let bytes = put_header(header, VERSION)?;
        if bytes.len() > MAX_TRACE_HEADER {
            return Err(WriteError::TooLong {
                bytes: bytes.len(),
                limit: MAX_TRACE_HEADER,
            });
        }
        output.write_all(&bytes)?;
        Ok(Self {
            output,
            written: bytes.len() as u64,
            bytes,
            last_us: 0,
        })
    }

    /// Writes an entry; one that is dated before the last gets the last one's time.
    ///
    /// # Errors
    /// Every [`WriteError`]; nothing of the entry was written unless it is [`WriteError::Io`].
    pub fn write(&mut self, mut entry: Entry) -> Result<(), WriteError> {
        entry.time_us = entry.time_us.max(self.last_us);
        self.bytes.clear();
        put(&entry, &mut self.bytes)?;
        let payload = self.bytes.len() - ENTRY_HEADER;
        if payload > MAX_TRACE_ENTRY {
            return Err(WriteError::TooLong {
                bytes: payload,
                limit: MAX_TRACE_ENTRY,
            });
        }
        let (unchecked, checked) = self.bytes.split_at_mut(UNCHECKED);
        unchecked[..4].copy_from_slice(&(payload as u32).to_le_bytes());
        unchecked[4..].copy_from_slice(&crc32fast::hash(checked).to_le_bytes());
        self.output.write_all(&self.bytes)?;
        self.last_us = entry.time_us;
        self.written += self.bytes.len() as u64;
        Ok(())
    }

    /// Bytes written so far.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Hands what is buffered on.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn flush(&mut self) -> Result<(), WriteError> {
        Ok(self.output.flush()?)
    }
}
