//! Who may come in: a shared secret, proved by both sides before the first message.
//!
//! Whoever accepted the connection sends [`MAGIC`] and a nonce of 32 random bytes. Whoever dialled answers with a nonce of
//! its own and a tag of 32 bytes; only if that is right does the other answer with its tag. A tag is the HMAC-SHA256 of a
//! label, which names the role of who makes it, the acceptor's nonce and the dialler's, keyed with the secret. So the
//! secret never travels, nothing can be replayed, no side can be made to answer its own question, and a stranger learns
//! nothing but that a secret is wanted. Everything has a fixed size: a stranger costs one buffer of 64 bytes, for at most
//! [`AUTH_TIMEOUT_S`] seconds.
//!
//! A secret says who is there; it does not hide what is said. Where others can listen in, or alter what they hear, both
//! ends belong behind a tunnel (see `README.md`).

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use hmac::{Hmac, Mac};
use sha2::Sha256;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};

use crate::limits::{AUTH_TIMEOUT_S, SECRET_BYTES};

/// First bytes of whoever accepted a connection and wants the secret. As the length of a frame they are too long for any.
pub const MAGIC: [u8; 8] = *b"EP-AUTH1";

const NONCE: usize = 32;
const TAG: usize = 32;
/// Tests do not wait so long.
const PATIENCE: Duration = Duration::from_secs(if cfg!(test) { 2 } else { AUTH_TIMEOUT_S });

type Nonce = [u8; NONCE];

/// What a side of a connection is, whoever dialled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It owns the scene and asks for samples.
    Display,
    /// It answers them.
    ShaderServer,
}

impl Role {
    fn label(self) -> &'static [u8] {
        match self {
            Self::Display => b"edge-point display 1",
            Self::ShaderServer => b"edge-point shader server 1",
        }
    }

    fn other(self) -> Self {
        match self {
            Self::Display => Self::ShaderServer,
            Self::ShaderServer => Self::Display,
        }
    }
}

/// A shared secret. It is never shown.
#[derive(Clone)]
pub struct Secret {
    key: Vec<u8>,
    readable: bool,
}

impl std::fmt::Debug for Secret {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Secret")
    }
}

/// A secret file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SecretFileError {
    /// It cannot be read.
    #[error("cannot read the secret file {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// It is too short to be a secret, or too long.
    #[error(
        "the secret file {} must hold {} to {} bytes; `head -c 32 /dev/urandom | base64 > FILE` makes a good one",
        path.display(), SECRET_BYTES[0], SECRET_BYTES[1]
    )]
    Length {
        /// The file.
        path: PathBuf,
    },
}

/// The peer did not prove that it knows the secret.
#[derive(Debug, thiserror::Error)]
pub enum SecretError {
    /// The connection failed or was closed, as it is on a wrong tag.
    #[error(
        "the connection ended while the secret was being proved ({0}); have both sides the same --secret-file?"
    )]
    Io(#[from] io::Error),
    /// Nothing came in time.
    #[error(
        "the peer did not prove within {AUTH_TIMEOUT_S} s that it knows the secret; was it started with --secret-file?"
    )]
    TimedOut,
    /// It says something else.
    #[error("the peer does not ask for the secret; start it with --secret-file")]
    NotAsked,
    /// Its tag is wrong.
    #[error("the peer does not know the secret; have both sides the same --secret-file?")]
    Wrong,
    /// No random bytes are to be had.
    #[error("the system gives no random bytes: {0}")]
    Random(getrandom::Error),
}

impl Secret {
    /// A secret of these bytes.
    pub fn new(key: impl Into<Vec<u8>>) -> Self {
        Self {
            key: key.into(),
            readable: false,
        }
    }

    /// The content of a file, without a line break at its end.
    ///
    /// # Errors
    /// If it cannot be read, or is shorter or longer than [`SECRET_BYTES`].
    pub fn read(path: &Path) -> Result<Self, SecretFileError> {
        let failed = |source| SecretFileError::Read {
            path: path.to_owned(),
            source,
        };
        let file = File::open(path).map_err(failed)?;
        let readable = readable_by_others(&file).map_err(failed)?;
        let mut key = Vec::new();
        // One more than allowed, and a line break, so that too long a file is found to be that.
        let most = SECRET_BYTES[1] as u64 + 3;
        file.take(most).read_to_end(&mut key).map_err(failed)?;
        if key.last() == Some(&b'\n') {
            key.pop();
            if key.last() == Some(&b'\r') {
                key.pop();
            }
        }
        if !(SECRET_BYTES[0]..=SECRET_BYTES[1]).contains(&key.len()) {
            return Err(SecretFileError::Length {
                path: path.to_owned(),
            });
        }
        Ok(Self { key, readable })
    }

    /// Whether it came from a file that every user of the machine can read.
    pub fn is_readable_by_others(&self) -> bool {
        self.readable
    }

    fn mac(&self, role: Role, acceptor: &Nonce, dialler: &Nonce) -> Hmac<Sha256> {
        // Keys of every length are taken; the type cannot say so.
        let mut mac = <Hmac<Sha256> as Mac>::new_from_slice(&self.key)
            .unwrap_or_else(|_| unreachable!("HMAC takes keys of every length"));
        mac.update(role.label());
        mac.update(acceptor);
        mac.update(dialler);
        mac
    }

    fn tag(&self, role: Role, acceptor: &Nonce, dialler: &Nonce) -> [u8; TAG] {
        self.mac(role, acceptor, dialler)
            .finalize()
            .into_bytes()
            .into()
    }

    /// Compares in constant time.
    fn check(
        &self,
        role: Role,
        acceptor: &Nonce,
        dialler: &Nonce,
        tag: &[u8],
    ) -> Result<(), SecretError> {
        self.mac(role, acceptor, dialler)
            .verify_slice(tag)
            .map_err(|_| SecretError::Wrong)
    }
}

#[cfg(unix)]
fn readable_by_others(file: &File) -> io::Result<bool> {
    use std::os::unix::fs::MetadataExt;
    Ok(file.metadata()?.mode() & 0o004 != 0)
}

#[cfg(not(unix))]
fn readable_by_others(_: &File) -> io::Result<bool> {
    Ok(false)
}

fn nonce() -> Result<Nonce, SecretError> {
    let mut nonce = [0; NONCE];
    getrandom::fill(&mut nonce).map_err(SecretError::Random)?;
    Ok(nonce)
}

async fn in_time(work: impl Future<Output = Result<(), SecretError>>) -> Result<(), SecretError> {
    tokio::time::timeout(PATIENCE, work)
        .await
        .unwrap_or(Err(SecretError::TimedOut))
}

/// Proves the secret on a connection that this side, which is `own`, accepted, and has the peer prove it.
///
/// # Errors
/// Every [`SecretError`] but [`SecretError::NotAsked`]: close the connection without a word.
pub async fn accepted<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    secret: &Secret,
    own: Role,
) -> Result<(), SecretError> {
    in_time(async {
        let acceptor = nonce()?;
        let mut greeting = [0; MAGIC.len() + NONCE];
        greeting[..MAGIC.len()].copy_from_slice(&MAGIC);
        greeting[MAGIC.len()..].copy_from_slice(&acceptor);
        stream.write_all(&greeting).await?;
        let mut dialler = [0; NONCE];
        let mut tag = [0; TAG];
        stream.read_exact(&mut dialler).await?;
        stream.read_exact(&mut tag).await?;
        secret.check(own.other(), &acceptor, &dialler, &tag)?;
        let own_tag = secret.tag(own, &acceptor, &dialler);
        stream.write_all(&own_tag).await?;
        Ok(stream.flush().await?)
    })
    .await
}

/// Proves the secret on a connection that this side, which is `own`, opened, and has the peer prove it.
///
/// # Errors
/// Every [`SecretError`]: close the connection.
pub async fn dialled<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    secret: &Secret,
    own: Role,
) -> Result<(), SecretError> {
    in_time(async {
        let mut magic = [0; MAGIC.len()];
        stream.read_exact(&mut magic).await?;
        if magic != MAGIC {
            return Err(SecretError::NotAsked);
        }
        let mut acceptor = [0; NONCE];
        stream.read_exact(&mut acceptor).await?;
        let dialler = nonce()?;
        let mut answer = [0; NONCE + TAG];
        answer[..NONCE].copy_from_slice(&dialler);
        answer[NONCE..].copy_from_slice(&secret.tag(own, &acceptor, &dialler));
        stream.write_all(&answer).await?;
        stream.flush().await?;
        let mut tag = [0; TAG];
        stream.read_exact(&mut tag).await?;
        secret.check(own.other(), &acceptor, &dialler, &tag)
    })
    .await
}

#[cfg(test)]
#[path = "secret_tests.rs"]
mod tests;
