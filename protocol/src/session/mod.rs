//! What may be said when: one pure state machine for each side, without sockets or clocks.
//!
//! [`DisplaySession`] is the display's account of one connection to a server, [`ServerSession`] the server's. Each is
//! told what was received and what is about to be sent, and answers what it means or which rule it breaks.

mod display;
mod server;

pub use display::{DisplayEvent, DisplaySession, Outstanding, SceneSize};
pub use server::{ServerEvent, ServerSession};

use crate::framing::FrameError;
use crate::limits::MAX_TEXT;
use crate::messages::{FaultCode, ToDisplay, ToServer};
use crate::transfer::TransferError;

/// A rule that the peer broke. It is told, and closed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text}")]
pub struct Violation {
    /// The kind of fault.
    pub code: FaultCode,
    /// One line for people.
    pub text: String,
}

impl Violation {
    /// A violation with this text.
    pub fn new(code: FaultCode, text: impl Into<String>) -> Self {
        Self {
            code,
            text: text.into(),
        }
    }

    /// What a server sends before it closes.
    pub fn to_display(&self) -> ToDisplay {
        ToDisplay::Fault {
            code: self.code,
            text: self.bounded_text(),
        }
    }

    /// What a display sends before it closes.
    pub fn to_server(&self) -> ToServer {
        ToServer::Fault {
            code: self.code,
            text: self.bounded_text(),
        }
    }

    fn bounded_text(&self) -> String {
        let mut end = self.text.len().min(MAX_TEXT);
        while !self.text.is_char_boundary(end) {
            end -= 1;
        }
        self.text[..end].to_owned()
    }
}

impl From<&TransferError> for Violation {
    fn from(error: &TransferError) -> Self {
        Self::new(error.fault(), error.to_string())
    }
}

impl Violation {
    /// The peer's fault in a broken frame, if it is one.
    pub fn of_frame(error: &FrameError) -> Option<Self> {
        error.fault().map(|code| Self::new(code, error.to_string()))
    }
}

#[cfg(test)]
mod tests;
