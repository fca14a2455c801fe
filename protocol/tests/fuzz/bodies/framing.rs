//! A stream of bytes that arrives in pieces.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};

use protocol::ToServer;
use protocol::encode;
use protocol::framing::Receiver;
use tokio::io::{AsyncRead, ReadBuf};

use super::source::Source;

/// Bytes that come in pieces of these lengths, over and over; a length of 0 makes the reader wait once.
struct Pieces<'a> {
    bytes: &'a [u8],
    lengths: &'a [u8],
    next: usize,
}

impl AsyncRead for Pieces<'_> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let length = match self.lengths {
            [] => usize::MAX,
            lengths => usize::from(lengths[self.next % lengths.len()]),
        };
        self.next += 1;
        // Two waits in a row would let all-zero lengths wait for ever.
        if length == 0 && self.next % 2 == 1 {
            return Poll::Pending;
        }
        let count = length.max(1).min(self.bytes.len()).min(buffer.remaining());
        let (now, later) = self.bytes.split_at(count);
        buffer.put_slice(now);
        self.bytes = later;
        Poll::Ready(Ok(()))
    }
}

/// Runs what never waits for anything but its next turn.
pub(super) fn finish<F: Future>(future: F) -> F::Output {
    let mut future = std::pin::pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(output) = future.as_mut().poll(&mut context) {
            return output;
        }
    }
}

/// The messages of a stream, encoded, and how it ended.
fn received(bytes: &[u8], lengths: &[u8]) -> (Vec<Vec<u8>>, String) {
    let mut receiver = Receiver::<_, ToServer>::new(Pieces {
        bytes,
        lengths,
        next: 0,
    });
    let mut messages = Vec::new();
    loop {
        match finish(receiver.receive()) {
            Ok(Some(message)) => messages.push(encode(&message).expect("it was decoded")),
            Ok(None) => return (messages, "well".into()),
            Err(error) => return (messages, error.to_string()),
        }
    }
}

/// However a stream is cut, the same messages come out of it, and the same end.
pub(super) fn stream(data: &[u8]) {
    let mut source = Source::new(data);
    let pieces = source.below(16);
    let lengths = source.take(pieces);
    let bytes = source.rest();
    assert_eq!(received(bytes, lengths), received(bytes, &[]));
}
