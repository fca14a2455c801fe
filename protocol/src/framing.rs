//! Messages on a byte stream.
//!
//! A frame is a little-endian `u32`, the payload's length, and the payload: one encoded message. [`Receiver`] and
//! [`Sender`] are the typed halves of a connection; [`display_side`] and [`server_side`] make them of any stream.

use std::io;
use std::marker::PhantomData;

use bytes::{BufMut, Bytes, BytesMut};
use futures_util::{SinkExt, StreamExt};
use serde::Serialize;
use serde::de::DeserializeOwned;
use tokio::io::{AsyncRead, AsyncWrite, ReadHalf, WriteHalf};
use tokio_util::codec::{Decoder, Encoder, FramedRead, FramedWrite, LengthDelimitedCodec};

use crate::codec::{DecodeError, EncodeError, decode, encode_into};
use crate::limits::MAX_FRAME;
use crate::messages::{FaultCode, ToDisplay, ToServer};
use crate::secret::MAGIC;
use crate::validate::{ValueError, validate_to_display, validate_to_server};

/// Bytes of a frame before its payload.
pub const HEADER: usize = 4;

/// A connection cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The stream failed.
    #[error("the connection failed: {0}")]
    Io(#[from] io::Error),
    /// The stream ended inside a frame.
    #[error("the connection ended inside a frame")]
    Truncated,
    /// The peer wants a secret to be proved first (see [`crate::secret`]).
    #[error("the peer asks for a secret; give --secret-file")]
    SecretWanted,
    /// A frame claims a length above [`MAX_FRAME`], or a message to be sent has one.
    #[error("a frame is longer than {MAX_FRAME} bytes")]
    TooLong,
    /// A frame holds no message.
    #[error("a frame holds no message: {0}")]
    Decode(#[from] DecodeError),
    /// A message to be sent cannot be encoded.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// A message holds a value that is not allowed.
    #[error("a message holds a value that is not allowed: {0}")]
    Value(#[from] ValueError),
}

impl FrameError {
    /// What to tell the peer, if it is at fault.
    pub fn fault(&self) -> Option<FaultCode> {
        match self {
            Self::Io(_) | Self::Truncated | Self::SecretWanted | Self::Encode(_) => None,
            Self::TooLong => Some(FaultCode::Limit),
            Self::Decode(_) => Some(FaultCode::Malformed),
            Self::Value(error) => Some(error.fault()),
        }
    }
}

/// What may travel in a frame.
pub trait Message: Serialize + DeserializeOwned {
    /// Checks every value that can be checked without knowing what came before.
    fn validate(&self) -> Result<(), ValueError>;
}

impl Message for ToServer {
    fn validate(&self) -> Result<(), ValueError> {
        validate_to_server(self)
    }
}

impl Message for ToDisplay {
    fn validate(&self) -> Result<(), ValueError> {
        validate_to_display(self)
    }
}

/// tokio-util's codec with this protocol's settings. It differs in one thing: an end of the stream right after a
/// frame's header is an error.
struct FrameCodec {
    inner: LengthDelimitedCodec,
    inside: bool,
}

impl FrameCodec {
    fn new() -> Self {
        let inner = LengthDelimitedCodec::builder()
            .little_endian()
            .length_field_length(HEADER)
            .max_frame_length(MAX_FRAME)
            .new_codec();
        Self {
            inner,
            inside: false,
        }
    }
}

fn too_long(error: io::Error) -> FrameError {
    match error.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput => FrameError::TooLong,
        _ => FrameError::Io(error),
    }
}

impl Decoder for FrameCodec {
    type Item = BytesMut;
    type Error = FrameError;

    fn decode(&mut self, source: &mut BytesMut) -> Result<Option<BytesMut>, FrameError> {
        let header_there = self.inside || source.len() >= HEADER;
        if !self.inside && source.starts_with(&MAGIC[..HEADER]) {
            return Err(FrameError::SecretWanted);
        }
        let frame = self.inner.decode(source).map_err(too_long)?;
        self.inside = frame.is_none() && header_there;
        Ok(frame)
    }

    fn decode_eof(&mut self, source: &mut BytesMut) -> Result<Option<BytesMut>, FrameError> {
        match self.decode(source)? {
            Some(frame) => Ok(Some(frame)),
            None if self.inside || !source.is_empty() => Err(FrameError::Truncated),
            None => Ok(None),
        }
    }
}

impl Encoder<Bytes> for FrameCodec {
    type Error = FrameError;

    fn encode(&mut self, payload: Bytes, target: &mut BytesMut) -> Result<(), FrameError> {
        self.inner.encode(payload, target).map_err(too_long)
    }
}

/// The receiving half: messages of type `M` from a stream.
pub struct Receiver<R, M> {
    frames: FramedRead<R, FrameCodec>,
    message: PhantomData<fn() -> M>,
}

impl<R: AsyncRead + Unpin, M: Message> Receiver<R, M> {
    /// Reads messages from this stream.
    pub fn new(stream: R) -> Self {
        Self {
            frames: FramedRead::new(stream, FrameCodec::new()),
            message: PhantomData,
        }
    }

    /// Takes no frame whose payload is longer than this, nor than [`MAX_FRAME`], from now on.
    pub fn set_longest(&mut self, bytes: usize) {
        let frames = self.frames.decoder_mut();
        frames.inner.set_max_frame_length(bytes.min(MAX_FRAME));
    }

    /// The next message, its values checked; nothing when the peer closed the connection between two frames. May be
    /// dropped before it is done: nothing is lost.
    ///
    /// # Errors
    /// Every [`FrameError`] but [`FrameError::Encode`]; the connection cannot be used after one.
    pub async fn receive(&mut self) -> Result<Option<M>, FrameError> {
        self.receive_seen(|_| {}).await
    }

    /// As [`Self::receive`]; the payload is shown to `seen` first, whatever it holds.
    ///
    /// # Errors
    /// As [`Self::receive`].
    pub async fn receive_seen(
        &mut self,
        seen: impl FnOnce(&Bytes),
    ) -> Result<Option<M>, FrameError> {
        let Some(frame) = self.frames.next().await else {
            return Ok(None);
        };
        let payload = frame?.freeze();
        seen(&payload);
        let message: M = decode(&payload)?;
        message.validate()?;
        Ok(Some(message))
    }

    /// Reads what still comes and throws it away, until the peer closes the connection or it fails. A socket that is
    /// closed with bytes unread resets the connection, and the peer may lose the last message that it was sent: read
    /// on after a [`Sender::close`] that followed a fault.
    pub async fn discard(&mut self) {
        // How it ends makes no difference: nothing more is expected of it.
        let _ = tokio::io::copy(self.frames.get_mut(), &mut tokio::io::sink()).await;
    }
}

/// The sending half: messages of type `M` to a stream.
pub struct Sender<W, M> {
    frames: FramedWrite<W, FrameCodec>,
    message: PhantomData<fn(M)>,
}

impl<W: AsyncWrite + Unpin, M: Message> Sender<W, M> {
    /// Writes messages to this stream.
    pub fn new(stream: W) -> Self {
        Self {
            frames: FramedWrite::new(stream, FrameCodec::new()),
            message: PhantomData,
        }
    }

    /// Sends a message and all that was fed before it.
    ///
    /// # Errors
    /// [`FrameError::Encode`] and [`FrameError::TooLong`] (nothing was sent), [`FrameError::Io`].
    pub async fn send(&mut self, message: &M) -> Result<(), FrameError> {
        self.feed(message).await?;
        self.flush().await
    }

    /// Puts a message into the buffer; it may go out now or with the next [`Self::flush`].
    ///
    /// # Errors
    /// As [`Self::send`].
    pub async fn feed(&mut self, message: &M) -> Result<(), FrameError> {
        self.feed_seen(message, |_| {}).await
    }

    /// As [`Self::feed`]; the payload is shown to `seen` first.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub async fn feed_seen(
        &mut self,
        message: &M,
        seen: impl FnOnce(&Bytes),
    ) -> Result<(), FrameError> {
        let mut payload = Vec::new();
        encode_into(message, &mut payload)?;
        let payload = Bytes::from(payload);
        if payload.len() <= MAX_FRAME {
            seen(&payload);
        }
        self.frames.feed(payload).await
    }

    /// Sends all that was fed.
    ///
    /// # Errors
    /// [`FrameError::Io`].
    pub async fn flush(&mut self) -> Result<(), FrameError> {
        SinkExt::<Bytes>::flush(&mut self.frames).await
    }

    /// Sends all that was fed and closes this direction.
    ///
    /// # Errors
    /// [`FrameError::Io`].
    pub async fn close(&mut self) -> Result<(), FrameError> {
        SinkExt::<Bytes>::close(&mut self.frames).await
    }
}

/// A display's halves of a stream.
pub fn display_side<S: AsyncRead + AsyncWrite>(
    stream: S,
) -> (
    Receiver<ReadHalf<S>, ToDisplay>,
    Sender<WriteHalf<S>, ToServer>,
) {
    let (read, write) = tokio::io::split(stream);
    (Receiver::new(read), Sender::new(write))
}

/// A shader server's halves of a stream.
pub fn server_side<S: AsyncRead + AsyncWrite>(
    stream: S,
) -> (
    Receiver<ReadHalf<S>, ToServer>,
    Sender<WriteHalf<S>, ToDisplay>,
) {
    let (read, write) = tokio::io::split(stream);
    (Receiver::new(read), Sender::new(write))
}

/// The bytes of one message in its frame, as they stand on the wire.
///
/// # Errors
/// [`FrameError::Encode`], [`FrameError::TooLong`].
pub fn frame<M: Message>(message: &M) -> Result<Vec<u8>, FrameError> {
    let mut bytes = Vec::new();
    bytes.put_u32_le(0);
    encode_into(message, &mut bytes)?;
    let payload = bytes.len() - HEADER;
    if payload > MAX_FRAME {
        return Err(FrameError::TooLong);
    }
    bytes[..HEADER].copy_from_slice(&(payload as u32).to_le_bytes());
    Ok(bytes)
}
