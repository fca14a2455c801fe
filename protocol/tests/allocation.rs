//! Hostile lengths claim gigabytes; memory in use is counted while they are decoded.
#![allow(clippy::unwrap_used, reason = "helpers of tests")]

mod common;
mod counting;

use counting::peak_during;
use protocol::codec::{decode, encode};
use protocol::scene::Scene;
use protocol::transfer::Assembler;
use protocol::{ToDisplay, ToServer};

const MIB: usize = 1 << 20;
const HUGE: [u64; 5] = [1 << 20, 1 << 31, 1 << 32, 1 << 60, u64::MAX];

/// Lengths that claim more than there is, in messages, scenes and announcements.
#[test]
fn claims_do_not_allocate() {
    for claim in HUGE {
        for tag in 0u32..10 {
            for zeros in [0usize, 4, 8, 12, 200] {
                let mut bytes = tag.to_le_bytes().to_vec();
                bytes.resize(4 + zeros, 0);
                bytes.extend(claim.to_le_bytes());
                bytes.resize(bytes.len() + 300, 1);
                for start in [0, 4] {
                    let bytes = &bytes[start..];
                    let peak = peak_during(|| {
                        let _ = decode::<ToServer>(bytes);
                        let _ = decode::<ToDisplay>(bytes);
                        let _ = decode::<Scene>(bytes);
                    });
                    assert!(peak < 2 * MIB, "{peak} bytes for tag {tag}, claim {claim}");
                }
            }
        }
    }
    hostile_lengths_anywhere_in_a_scene();
    announced_scenes();
    entries_of_traces();
}

/// Entries that claim more bytes than the file has, or than any may have.
fn entries_of_traces() {
    use protocol::trace::{Entry, Event, Header, TraceReader, TraceWriter};
    let header = Header {
        seed: 0,
        digest: [0; 32],
        scene_bytes: u64::MAX,
        program: String::new(),
        options: String::new(),
    };
    let mut bytes = Vec::new();
    let mut writer = TraceWriter::new(&mut bytes, &header).unwrap();
    let frame = vec![0; 3000].into();
    let event = Event::Received {
        connection: 1,
        frame,
    };
    writer.write(Entry { time_us: 0, event }).unwrap();
    let entry = bytes.len() - 3000 - 24;
    for (place, claim) in [
        (entry, 64 << 20),
        (entry, u32::MAX),
        (12, 1 << 20),
        (12, u32::MAX),
    ] {
        let mut bytes = bytes.clone();
        bytes[place..place + 4].copy_from_slice(&claim.to_le_bytes());
        let peak = peak_during(|| {
            if let Ok(mut reader) = TraceReader::new(&bytes[..]) {
                assert_eq!(reader.next_entry().unwrap(), None);
            }
        });
        assert!(
            peak < 100_000,
            "{peak} bytes for a claim of {claim} at {place}"
        );
    }
}

fn hostile_lengths_anywhere_in_a_scene() {
    let good = encode(&common::scene()).unwrap();
    for place in 0..good.len() - 8 {
        for claim in HUGE {
            let mut bytes = good.clone();
            bytes[place..place + 8].copy_from_slice(&claim.to_le_bytes());
            let peak = peak_during(|| {
                let _ = decode::<Scene>(&bytes);
            });
            assert!(peak < 5 * MIB, "{peak} bytes for a length at byte {place}");
        }
    }
}

fn announced_scenes() {
    let peak = peak_during(|| {
        let mut assembler = Assembler::new([0; 32], 1 << 31, 1 << 31).unwrap();
        assembler.add(&[0; 1000]).unwrap();
    });
    assert!(peak < 10_000, "{peak} bytes for an announcement");
}
