//! A peer that does not know the secret.

use std::cell::RefCell;
use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};

use protocol::secret::{MAGIC, Role, Secret, accepted, dialled};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::runtime::{Builder, Runtime};

use super::source::Source;

/// Answers with bytes of its own, or with what it was sent from some place on; then ends.
struct Stranger<'a> {
    source: Source<'a>,
    heard: Vec<u8>,
}

impl AsyncRead for Stranger<'_> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        if self.source.is_empty() {
            return Poll::Ready(Ok(()));
        }
        let this = &mut *self;
        let (how, length) = (this.source.byte(), 1 + this.source.below(72));
        let echo = |place: usize| this.heard.get(place..).unwrap_or(&[]);
        let answer = match how % 4 {
            0 => &MAGIC[..],
            1 => echo(usize::from(how / 4)),
            2 => echo(8),
            _ => this.source.take(length),
        };
        let length = length.min(answer.len()).min(buffer.remaining());
        if length == 0 {
            // An answer of nothing would be its end.
            buffer.put_slice(&[0]);
        }
        buffer.put_slice(&answer[..length]);
        Poll::Ready(Ok(()))
    }
}

impl AsyncWrite for Stranger<'_> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.heard.extend_from_slice(bytes);
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

thread_local! {
    static RUNTIME: RefCell<Runtime> =
        RefCell::new(Builder::new_current_thread().enable_time().build().expect("a runtime starts"));
}

/// It is never let in, and never hears more than a stranger may: who accepts says its question and nothing else.
pub(super) fn secret(data: &[u8]) {
    let mut source = Source::new(data);
    let accepts = source.chance(2);
    let own = if source.chance(2) {
        Role::Display
    } else {
        Role::ShaderServer
    };
    let secret = Secret::new(*b"sixteen bytes of it");
    let mut stranger = Stranger {
        source,
        heard: Vec::new(),
    };
    let result = RUNTIME.with_borrow_mut(|runtime| {
        runtime.block_on(async {
            if accepts {
                accepted(&mut stranger, &secret, own).await
            } else {
                dialled(&mut stranger, &secret, own).await
            }
        })
    });
    assert!(result.is_err(), "a stranger was let in");
    assert!(
        stranger.heard.len() <= if accepts { 40 } else { 64 },
        "a stranger heard too much"
    );
}
