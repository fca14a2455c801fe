//! Bytes to entries.

use std::io::{self, BufReader, ErrorKind, Read};

use bytes::Bytes;

use super::format::{
    ENTRY_HEADER, Entry, Event, FORMAT, Header, MAGIC, PREAMBLE, UNCHECKED, take, take_header,
};
use crate::handshake::MIN_VERSION;
use crate::limits::{MAX_TRACE_ENTRY, MAX_TRACE_HEADER};
use crate::messages::VERSION;

/// Nothing of a trace can be read.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// It does not begin as traces do.
    #[error("it is no trace: it does not begin with EP-TRACE; `renderer record` writes traces")]
    NotATrace,
    /// The format is not the one that is read.
    #[error(
        "it has trace format {found}, which is {} than the {FORMAT} that is read here; \
         use the program that recorded it, or record it again",
        if *.found > FORMAT { "newer" } else { "older" }
    )]
    Format {
        /// The trace's.
        found: u16,
    },
    /// Its frames are of a version that is not spoken.
    #[error(
        "its frames are of protocol version {found}, which is {} than the {MIN_VERSION} to {VERSION} that are spoken here; \
         use the program that recorded it, or record it again",
        if *.found > VERSION { "newer" } else { "older" }
    )]
    Protocol {
        /// The trace's.
        found: u16,
    },
    /// The file ends inside the header.
    #[error("it is cut off inside its header: nothing can be replayed")]
    Cut,
    /// The header is not what was written.
    #[error("its header is damaged: nothing can be replayed")]
    Damaged,
}

/// How the entries of a trace end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// With [`Event::End`].
    Complete,
    /// Without it: whoever recorded was ended, or the file was cut, perhaps inside an entry.
    Cut {
        /// Where the last whole entry ends, bytes.
        at: u64,
    },
    /// With an entry that is not what was written.
    Damaged {
        /// Where that entry begins, bytes.
        at: u64,
    },
}

/// Reads a trace, entry after entry, up to its end or to where it is cut or damaged.
pub struct TraceReader<R> {
    input: BufReader<R>,
    header: Header,
    at: u64,
    last_us: u64,
    ending: Option<Ending>,
}

impl<R: Read> TraceReader<R> {
    /// Reads the header.
    ///
    /// # Errors
    /// Every [`OpenError`].
    pub fn new(input: R) -> Result<Self, OpenError> {
        let mut input = BufReader::new(input);
        let mut preamble = Vec::new();
        input
            .by_ref()
            .take(PREAMBLE as u64)
            .read_to_end(&mut preamble)?;
        let known = preamble.len().min(MAGIC.len());
        if preamble.is_empty() || preamble[..known] != MAGIC[..known] {
            return Err(OpenError::NotATrace);
        }
        let Ok::<[u8; PREAMBLE], _>(preamble) = preamble.try_into() else {
            return Err(OpenError::Cut);
        };
        let short = |at: usize| u16::from_le_bytes([preamble[at], preamble[at + 1]]);
        let found = short(8);
        if found != FORMAT {
            return Err(OpenError::Format { found });
        }
        let found = short(10);
        if !(MIN_VERSION..=VERSION).contains(&found) {
            return Err(OpenError::Protocol { found });
        }
        let [length, checksum] = words(&preamble[12..]);
        if length as usize > MAX_TRACE_HEADER {
            return Err(OpenError::Damaged);
        }
        let mut body = Vec::new();
        input
            .by_ref()
            .take(u64::from(length))
            .read_to_end(&mut body)?;
        if body.len() < length as usize {
            return Err(OpenError::Cut);
        }
        if crc32fast::hash(&body) != checksum {
            return Err(OpenError::Damaged);
        }
        let header = take_header(&body).map_err(|_| OpenError::Damaged)?;
        Ok(Self {
            input,
            header,
            at: (PREAMBLE + body.len()) as u64,
            last_us: 0,
            ending: None,
        })
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// How the trace ends, once [`Self::next_entry`] gave nothing.
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// Where the next entry begins, bytes.
    pub fn position(&self) -> u64 {
        self.at
    }

    /// The next entry; nothing after the last whole one. Allocates no more than the entry has bytes in the file, twice, and
    /// what [`crate::decode`] may.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn next_entry(&mut self) -> io::Result<Option<Entry>> {
        if self.ending.is_some() {
            return Ok(None);
        }
        let at = self.at;
        let mut header = [0; ENTRY_HEADER];
        match self.input.read_exact(&mut header) {
            Ok(()) => {}
            Err(e) if e.kind() == ErrorKind::UnexpectedEof => return self.end(Ending::Cut { at }),
            Err(e) => return Err(e),
        }
        let [length, checksum] = words(&header);
        if length as usize > MAX_TRACE_ENTRY {
            return self.end(Ending::Damaged { at });
        }
        let mut payload = Vec::new();
        self.input
            .by_ref()
            .take(u64::from(length))
            .read_to_end(&mut payload)?;
        if payload.len() < length as usize {
            return self.end(Ending::Cut { at });
        }
        let mut sum = crc32fast::Hasher::new();
        sum.update(&header[UNCHECKED..]);
        sum.update(&payload);
        let whole = sum.finalize() == checksum;
        let entry = take(&header[UNCHECKED..], Bytes::from(payload));
        let entry = entry.filter(|entry| whole && entry.time_us >= self.last_us);
        let Some(entry) = entry else {
            return self.end(Ending::Damaged { at });
        };
        self.at += (ENTRY_HEADER + length as usize) as u64;
        self.last_us = entry.time_us;
        if matches!(entry.event, Event::End { .. }) {
            self.ending = Some(Ending::Complete);
        }
        Ok(Some(entry))
    }

    fn end(&mut self, ending: Ending) -> io::Result<Option<Entry>> {
        self.ending = Some(ending);
        Ok(None)
    }
}

/// The first two words.
fn words(bytes: &[u8]) -> [u32; 2] {
    [0, 4].map(|at| {
        let word = bytes[at..].first_chunk();
        word.map_or(0, |word| u32::from_le_bytes(*word))
    })
}
