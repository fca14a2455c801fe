//! Values to bytes and back.
//!
//! bincode 2 with fixed-width little-endian integers, behind one pair of functions, so that it can be exchanged. What
//! [`decode`] takes is exactly what [`encode`] makes: bytes left over are an error. What is allocated is bounded by
//! the bytes that are there, whatever lengths they claim (see [`decode`]).

use bincode::config::{Configuration, Fixint, LittleEndian, standard};
use bincode::error::DecodeError as Inner;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Longest input of [`decode`], bytes.
pub const MAX_DECODE: usize = 1 << 31;

/// A value could not be turned into bytes.
#[derive(Debug, thiserror::Error)]
#[error("cannot encode: {0}")]
pub struct EncodeError(#[from] bincode::error::EncodeError);

/// Bytes are not what [`encode`] makes of a value of this type.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// The value needs more bytes than there are.
    #[error("the value ends early, {len} bytes are not enough")]
    Truncated {
        /// Bytes given.
        len: usize,
    },
    /// Bytes follow the value.
    #[error("{} bytes follow the value, which ends at byte {read}", len - read)]
    Trailing {
        /// Bytes that the value takes.
        read: usize,
        /// Bytes given.
        len: usize,
    },
    /// More than [`MAX_DECODE`].
    #[error("{len} bytes are more than the {MAX_DECODE} that can be decoded")]
    TooLong {
        /// Bytes given.
        len: usize,
    },
    /// An enum variant, boolean or string that does not exist.
    #[error("not a value of this type: {0}")]
    Invalid(String),
}

/// The bytes of a value.
pub fn encode<T: Serialize>(value: &T) -> Result<Vec<u8>, EncodeError> {
    let mut bytes = Vec::new();
    encode_into(value, &mut bytes)?;
    Ok(bytes)
}

/// Appends the bytes of a value, so that a buffer can be used again.
pub fn encode_into<T: Serialize>(value: &T, bytes: &mut Vec<u8>) -> Result<(), EncodeError> {
    let config = standard().with_fixed_int_encoding();
    bincode::serde::encode_into_std_write(value, bytes, config)?;
    Ok(())
}

/// The value that these bytes, all of them, are.
///
/// Never allocates more than 16 times their number and a few MiB: a length that claims more is refused first.
pub fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, DecodeError> {
    // The limit of bincode is a constant: the least step that holds the input bounds what a length can claim.
    match bytes.len() {
        0..=0x1000 => decode_within::<T, 0x1000>(bytes),
        0x1001..=0x1_0000 => decode_within::<T, 0x1_0000>(bytes),
        0x1_0001..=0x10_0000 => decode_within::<T, 0x10_0000>(bytes),
        0x10_0001..=0x100_0000 => decode_within::<T, 0x100_0000>(bytes),
        0x100_0001..=0x1000_0000 => decode_within::<T, 0x1000_0000>(bytes),
        0x1000_0001..=MAX_DECODE => decode_within::<T, MAX_DECODE>(bytes),
        len => Err(DecodeError::TooLong { len }),
    }
}

fn decode_within<T: DeserializeOwned, const LIMIT: usize>(bytes: &[u8]) -> Result<T, DecodeError> {
    let config: Configuration<LittleEndian, Fixint, _> =
        standard().with_fixed_int_encoding().with_limit::<LIMIT>();
    let len = bytes.len();
    let (value, read) =
        bincode::serde::decode_from_slice(bytes, config).map_err(|error| match error {
            Inner::UnexpectedEnd { .. } | Inner::LimitExceeded => DecodeError::Truncated { len },
            other => DecodeError::Invalid(other.to_string()),
        })?;
    if read == len {
        Ok(value)
    } else {
        Err(DecodeError::Trailing { read, len })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ToServer;

    #[test]
    fn bytes_are_fixed_width_and_little_endian() {
        let bytes = encode(&ToServer::Ping { token: 0x0102 }).unwrap();
        assert_eq!(bytes, [7, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn missing_and_extra_bytes_are_refused() {
        let bytes = encode(&ToServer::Ping { token: 5 }).unwrap();
        assert!(matches!(
            decode::<ToServer>(&bytes[..11]),
            Err(DecodeError::Truncated { len: 11 })
        ));
        let longer = [&bytes[..], &[0]].concat();
        assert!(matches!(
            decode::<ToServer>(&longer),
            Err(DecodeError::Trailing { read: 12, len: 13 })
        ));
    }

    #[test]
    fn unknown_variants_and_bad_text_are_refused() {
        assert!(matches!(
            decode::<ToServer>(&[11, 0, 0, 0]),
            Err(DecodeError::Invalid(_))
        ));
        let mut bytes = encode(&"é").unwrap();
        bytes[9] = b'x';
        assert!(matches!(
            decode::<String>(&bytes),
            Err(DecodeError::Invalid(_))
        ));
    }
}
