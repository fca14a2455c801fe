//! A scene in pieces: [`EncodedScene`] cuts it up, [`Assembler`] puts it together.

use crate::codec::{DecodeError, EncodeError, decode, encode};
use crate::limits::MAX_SCENE;
use crate::messages::{Digest, FaultCode, ToServer};
use crate::scene::{MAX_CHUNK, Scene};
use crate::validate::{ValueError, validate_scene};

/// A scene cannot be sent or put together.
#[derive(Debug, thiserror::Error)]
pub enum TransferError {
    /// The scene cannot be encoded.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// A value in the scene is not allowed.
    #[error("the scene holds a value that is not allowed: {0}")]
    Value(#[from] ValueError),
    /// The scene is longer than agreed.
    #[error("the scene has {bytes} bytes, at most {limit} are taken")]
    TooLong {
        /// Announced length, bytes.
        bytes: u64,
        /// Most that is taken, bytes.
        limit: u64,
    },
    /// More bytes came than were announced.
    #[error("more bytes came than the {bytes} announced")]
    Overrun {
        /// Announced length, bytes.
        bytes: u64,
    },
    /// The bytes are not those that the digest was made of.
    #[error("the scene's bytes do not have the announced digest")]
    Digest,
    /// The bytes are no scene.
    #[error("the scene's bytes are no scene: {0}")]
    Decode(#[from] DecodeError),
}

impl TransferError {
    /// The kind of fault to report to who sent it.
    pub fn fault(&self) -> FaultCode {
        match self {
            Self::Encode(_) => FaultCode::Internal,
            Self::Value(error) => error.fault(),
            Self::TooLong { .. } | Self::Overrun { .. } => FaultCode::Limit,
            Self::Digest | Self::Decode(_) => FaultCode::Malformed,
        }
    }
}

/// A scene ready to be sent.
pub struct EncodedScene {
    digest: Digest,
    bytes: Vec<u8>,
}

impl EncodedScene {
    /// Checks and encodes a scene.
    ///
    /// # Errors
    /// [`TransferError::Value`], [`TransferError::Encode`] or [`TransferError::TooLong`] (above [`MAX_SCENE`]).
    pub fn new(scene: &Scene) -> Result<Self, TransferError> {
        validate_scene(scene)?;
        let bytes = encode(scene)?;
        if bytes.len() as u64 > MAX_SCENE {
            return Err(TransferError::TooLong {
                bytes: bytes.len() as u64,
                limit: MAX_SCENE,
            });
        }
        Ok(Self {
            digest: blake3::hash(&bytes).into(),
            bytes,
        })
    }

    /// BLAKE3 of the encoded scene.
    pub fn digest(&self) -> Digest {
        self.digest
    }

    /// The encoded scene.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The message that announces the scene.
    pub fn begin(&self) -> ToServer {
        ToServer::SceneBegin {
            digest: self.digest,
            bytes: self.bytes.len() as u64,
        }
    }

    /// The messages that carry it, in order.
    pub fn chunks(&self) -> impl Iterator<Item = ToServer> {
        self.bytes
            .chunks(MAX_CHUNK)
            .map(|data| ToServer::SceneChunk {
                data: data.to_vec(),
            })
    }
}

/// Puts a scene together, keeping no more than has really arrived.
#[derive(Debug)]
pub struct Assembler {
    digest: Digest,
    expected: u64,
    bytes: Vec<u8>,
}

impl Assembler {
    /// Starts with what [`ToServer::SceneBegin`] announced. Nothing is allocated for it yet.
    ///
    /// # Errors
    /// [`TransferError::TooLong`] above `limit` (bytes; [`MAX_SCENE`] if in doubt).
    pub fn new(digest: Digest, bytes: u64, limit: u64) -> Result<Self, TransferError> {
        if bytes > limit.min(MAX_SCENE) {
            return Err(TransferError::TooLong {
                bytes,
                limit: limit.min(MAX_SCENE),
            });
        }
        Ok(Self {
            digest,
            expected: bytes,
            bytes: Vec::new(),
        })
    }

    /// Takes the next bytes; true when all are there.
    ///
    /// # Errors
    /// [`TransferError::Overrun`].
    pub fn add(&mut self, data: &[u8]) -> Result<bool, TransferError> {
        if (self.bytes.len() + data.len()) as u64 > self.expected {
            return Err(TransferError::Overrun {
                bytes: self.expected,
            });
        }
        self.bytes.extend_from_slice(data);
        Ok(self.is_complete())
    }

    /// Whether all announced bytes are there.
    pub fn is_complete(&self) -> bool {
        self.bytes.len() as u64 == self.expected
    }

    /// The scene, its digest and every value checked.
    ///
    /// # Errors
    /// [`TransferError::Digest`] (also when bytes are missing), [`TransferError::Decode`], [`TransferError::Value`].
    pub fn finish(self) -> Result<Scene, TransferError> {
        if Digest::from(blake3::hash(&self.bytes)) != self.digest {
            return Err(TransferError::Digest);
        }
        let scene = decode(&self.bytes)?;
        drop(self.bytes);
        validate_scene(&scene)?;
        Ok(scene)
    }
}
