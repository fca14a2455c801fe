//! Messages over streams that split, join, break off and lie.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use protocol::framing::{FrameError, Receiver, display_side, frame, server_side};
use protocol::limits::MAX_FRAME;
use protocol::messages::FaultCode;
use protocol::{ToDisplay, ToServer};
use tokio::io::AsyncWriteExt;

fn block_on<F: Future>(future: F) -> F::Output {
    tokio::runtime::Builder::new_current_thread()
        .build()
        .unwrap()
        .block_on(future)
}

fn messages() -> Vec<ToServer> {
    vec![
        ToServer::Hello {
            min_version: 1,
            max_version: 1,
            name: "test".into(),
            seed: 3,
        },
        ToServer::SceneChunk {
            data: vec![7; 1 << 20],
        },
        ToServer::Ping { token: 9 },
        ToServer::Goodbye,
    ]
}

/// Everything that a receiver makes of these bytes when they arrive in pieces of this size.
fn received(bytes: &[u8], piece: usize) -> (Vec<ToServer>, Result<(), FrameError>) {
    block_on(async {
        let (mut near, far) = tokio::io::duplex(piece);
        let write = async move {
            // The reader may give up early, which is what is being tested.
            let _ = near.write_all(bytes).await;
        };
        let read = async move {
            let mut receiver = Receiver::<_, ToServer>::new(far);
            let mut got = Vec::new();
            loop {
                match receiver.receive().await {
                    Ok(Some(message)) => got.push(message),
                    Ok(None) => return (got, Ok(())),
                    Err(error) => return (got, Err(error)),
                }
            }
        };
        tokio::join!(read, write).0
    })
}

#[test]
fn messages_survive_any_fragmentation() {
    let small = [messages()[0].clone(), messages()[2].clone()];
    let bytes: Vec<u8> = small.iter().flat_map(|m| frame(m).unwrap()).collect();
    for piece in 1..=bytes.len() {
        let (got, end) = received(&bytes, piece);
        assert_eq!(got, small);
        end.unwrap();
    }
    let bytes: Vec<u8> = messages().iter().flat_map(|m| frame(m).unwrap()).collect();
    for piece in [1000, 65_536, bytes.len()] {
        assert_eq!(received(&bytes, piece).0, messages());
    }
}

#[test]
fn both_directions_work_at_once() {
    block_on(async {
        let (near, far) = tokio::io::duplex(64);
        let (mut from_server, mut to_server) = display_side(near);
        let (mut from_display, mut to_display) = server_side(far);
        let display = async {
            for message in &messages() {
                to_server.feed(message).await.unwrap();
            }
            to_server.close().await.unwrap();
            let mut tokens = Vec::new();
            while let Some(ToDisplay::Pong { token }) = from_server.receive().await.unwrap() {
                tokens.push(token);
            }
            tokens
        };
        let server = async {
            let mut count = 0;
            while from_display.receive().await.unwrap().is_some() {
                to_display
                    .send(&ToDisplay::Pong { token: count })
                    .await
                    .unwrap();
                count += 1;
            }
            to_display.close().await.unwrap();
        };
        assert_eq!(tokio::join!(display, server).0, [0, 1, 2, 3]);
    });
}

#[test]
fn an_end_between_frames_is_none_and_inside_one_an_error() {
    let bytes = frame(&ToServer::Ping { token: 9 }).unwrap();
    for cut in 1..bytes.len() {
        let (got, end) = received(&bytes[..cut], 64);
        assert!(got.is_empty());
        assert!(
            matches!(end, Err(FrameError::Truncated)),
            "cut at byte {cut}: {end:?}"
        );
    }
    assert!(received(&[], 64).1.is_ok());
}

#[test]
fn long_frames_are_refused_by_their_header() {
    for length in [MAX_FRAME as u32 + 1, u32::MAX] {
        let error = received(&length.to_le_bytes(), 64).1.unwrap_err();
        assert!(matches!(error, FrameError::TooLong));
        assert_eq!(error.fault(), Some(FaultCode::Limit));
    }
    let too_long = ToServer::SceneChunk {
        data: vec![0; MAX_FRAME],
    };
    assert!(matches!(frame(&too_long), Err(FrameError::TooLong)));
    block_on(async {
        let (near, far) = tokio::io::duplex(64);
        let sent = display_side(near).1.send(&too_long).await;
        assert!(matches!(sent, Err(FrameError::TooLong)));
        drop(far);
    });
}

#[test]
fn frames_without_a_message_are_refused() {
    for (payload, code) in [
        (vec![], FaultCode::Malformed),
        (vec![99, 0, 0, 0], FaultCode::Malformed),
        (vec![8, 0, 0, 0, 1], FaultCode::Malformed),
        (vec![2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0], FaultCode::Limit),
    ] {
        let mut bytes = (payload.len() as u32).to_le_bytes().to_vec();
        bytes.extend(&payload);
        assert_eq!(
            received(&bytes, 64).1.unwrap_err().fault(),
            Some(code),
            "{payload:?}"
        );
    }
}
