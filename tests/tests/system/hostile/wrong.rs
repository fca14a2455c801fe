//! Bytes that are no frames or no messages, the same in both directions.

use protocol::messages::FaultCode;

/// What a peer might send, and what it is to be told.
pub(super) fn frames(unknown_variant: u32) -> Vec<(&'static str, Vec<u8>, FaultCode)> {
    let framed = |payload: &[u8]| {
        let mut bytes = (payload.len() as u32).to_le_bytes().to_vec();
        bytes.extend(payload);
        bytes
    };
    let goodbye = [8, 0, 0, 0];
    let fault = |code: u32, length: u64, text: &[u8]| {
        // In both directions a fault is a code and a text, whatever its number.
        let mut payload = if unknown_variant == 9 { 6u32 } else { 9 }
            .to_le_bytes()
            .to_vec();
        payload.extend(code.to_le_bytes());
        payload.extend(length.to_le_bytes());
        payload.extend(text);
        framed(&payload)
    };
    vec![
        ("nothing in a frame", framed(&[]), FaultCode::Malformed),
        ("one byte in a frame", framed(&[0]), FaultCode::Malformed),
        (
            "a frame of 4 GiB",
            u32::MAX.to_le_bytes().to_vec(),
            FaultCode::Limit,
        ),
        (
            "a frame of 2 MiB and a byte",
            ((2u32 << 20) + 1).to_le_bytes().to_vec(),
            FaultCode::Limit,
        ),
        (
            "an unknown message",
            framed(&unknown_variant.to_le_bytes()),
            FaultCode::Malformed,
        ),
        (
            "bytes after a message",
            framed(&[&goodbye[..], &[0]].concat()),
            FaultCode::Malformed,
        ),
        ("an unknown code", fault(7, 0, b""), FaultCode::Malformed),
        (
            "a count that is more than there is",
            fault(1, 1 << 60, b"a"),
            FaultCode::Malformed,
        ),
        (
            "text that is none",
            fault(1, 1, &[0xff]),
            FaultCode::Malformed,
        ),
    ]
}
