//! Settling on a version.

use crate::messages::{FaultCode, ToServer, VERSION};
use crate::session::Violation;

/// Oldest version that this crate speaks.
pub const MIN_VERSION: u16 = 1;

/// The display's first message.
pub fn hello(name: &str, seed: u64) -> ToServer {
    ToServer::Hello {
        min_version: MIN_VERSION,
        max_version: VERSION,
        name: name.into(),
        seed,
    }
}

/// The server's choice: the newest version that both sides speak.
///
/// # Errors
/// [`FaultCode::Version`] where there is none.
pub fn choose_version(min_version: u16, max_version: u16) -> Result<u16, Violation> {
    let version = max_version.min(VERSION);
    if version < min_version || version < MIN_VERSION {
        return Err(Violation::new(
            FaultCode::Version,
            format!(
                "no common version: the display speaks {min_version} to {max_version}, the server {MIN_VERSION} to {VERSION}"
            ),
        ));
    }
    Ok(version)
}

/// The display's check of the server's choice.
///
/// # Errors
/// [`FaultCode::Version`] where it is none of the display's.
pub fn accept_version(version: u16) -> Result<(), Violation> {
    if (MIN_VERSION..=VERSION).contains(&version) {
        return Ok(());
    }
    Err(Violation::new(
        FaultCode::Version,
        format!(
            "the server chose version {version}, the display speaks {MIN_VERSION} to {VERSION}"
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_common_version_is_chosen() {
        assert_eq!(choose_version(1, 1).unwrap(), 1);
        assert_eq!(choose_version(1, 9).unwrap(), VERSION);
        assert_eq!(
            choose_version(VERSION + 1, 9).unwrap_err().code,
            FaultCode::Version
        );
        assert_eq!(choose_version(0, 0).unwrap_err().code, FaultCode::Version);
    }

    #[test]
    fn a_version_that_was_not_offered_is_refused() {
        accept_version(VERSION).unwrap();
        assert!(accept_version(0).is_err());
        assert!(accept_version(VERSION + 1).is_err());
    }
}
