//! Bytes that may be a trace.

use protocol::limits::MAX_TRACE_HEADER;
use protocol::trace::{Ending, Entry, TraceReader, TraceWriter};

use super::source::Source;

/// A damaged trace says so and is read up to the damage; what is read and written again is the same bytes.
pub(super) fn trace(data: &[u8]) {
    let Ok(mut reader) = TraceReader::new(data) else {
        return;
    };
    let mut written = Vec::new();
    let writer = TraceWriter::new(&mut written, reader.header());
    let mut writer = writer.expect("a header that was read can be written");
    let start = reader.position();
    assert!(start as usize <= MAX_TRACE_HEADER.max(data.len()));
    let mut entries: Vec<Entry> = Vec::new();
    while let Some(entry) = reader.next_entry().expect("memory does not fail") {
        writer
            .write(entry.clone())
            .expect("what was read can be written");
        entries.push(entry);
    }
    let read = match reader.ending() {
        Some(Ending::Cut { at } | Ending::Damaged { at }) => at,
        Some(Ending::Complete) => reader.position(),
        None => panic!("a trace ends somehow"),
    };
    assert_eq!(read, reader.position());
    assert_eq!(
        written[start as usize..],
        data[start as usize..read as usize]
    );
    assert!(entries.is_sorted_by_key(|entry| entry.time_us));
}

/// The same for an input whose checksums are made right first: chance does not find them.
pub(super) fn trace_checked(data: &[u8]) {
    let mut source = Source::new(data);
    let mut bytes = Vec::new();
    let header = source.take(256).to_vec();
    bytes.extend(b"EP-TRACE\x01\0\x01\0");
    bytes.extend((header.len() as u32).to_le_bytes());
    bytes.extend(crc32fast::hash(&header).to_le_bytes());
    bytes.extend(&header);
    let mut time = 0u64;
    while !source.is_empty() {
        let (kind, length) = (source.byte() % 9, source.below(256));
        time += u64::from(source.byte());
        let payload = source.take(length);
        let mut checked = time.to_le_bytes().to_vec();
        checked.extend(u32::from(kind).to_le_bytes());
        checked.extend(u32::from(source.byte()).to_le_bytes());
        checked.extend(payload);
        bytes.extend((payload.len() as u32).to_le_bytes());
        bytes.extend(crc32fast::hash(&checked).to_le_bytes());
        bytes.extend(checked);
    }
    trace(&bytes);
}
