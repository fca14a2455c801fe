use std::io::Cursor;

use bytes::Bytes;
use proptest::collection::vec;
use proptest::prelude::*;

use super::format::{ENTRY_HEADER, PREAMBLE};
use super::*;
use crate::messages::{Camera, ObjectMove, Triple, VERSION};

fn header() -> Header {
    Header {
        seed: 7,
        digest: [3; 32],
        scene_bytes: 5,
        program: "test 1".into(),
        options: "{}".into(),
    }
}

fn write(entries: &[Entry]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut writer = TraceWriter::new(&mut bytes, &header()).unwrap();
    for entry in entries {
        writer.write(entry.clone()).unwrap();
    }
    writer.flush().unwrap();
    assert_eq!(writer.written(), bytes.len() as u64);
    bytes
}

/// All entries, and how they end.
fn read(bytes: &[u8]) -> Result<(Vec<Entry>, Ending), OpenError> {
    let mut reader = TraceReader::new(Cursor::new(bytes))?;
    let mut entries = Vec::new();
    while let Some(entry) = reader.next_entry().unwrap() {
        entries.push(entry);
    }
    assert!(reader.next_entry().unwrap().is_none(), "an end is one");
    Ok((entries, reader.ending().unwrap()))
}

fn camera() -> impl Strategy<Value = Camera> {
    (any::<[u16; 3]>(), any::<u8>()).prop_map(|(eye, width)| Camera {
        eye: eye.map(f32::from),
        target: [0.0; 3],
        up: [0.0, 1.0, 0.0],
        fov_y: 40.0,
        width: u32::from(width),
        height: 9,
    })
}

fn step() -> impl Strategy<Value = Step> {
    let shaped = ("[a-z]{0,9}", any::<u32>(), any::<bool>());
    let triple = any::<[u32; 3]>().prop_map(|[light, blocker, receiver]| Triple {
        light,
        blocker,
        receiver,
    });
    let moved = (any::<u32>(), any::<u16>()).prop_map(|(object, x)| ObjectMove {
        object,
        transform: [[f32::from(x); 4]; 3],
    });
    let run = any::<(u64, u32, u32)>().prop_map(|(first, count, connection)| Run {
        first,
        count,
        connection,
    });
    prop_oneof![
        shaped.prop_map(|(choices, width, keep_points)| Step::Shaped {
            choices,
            width,
            height: 3,
            keep_points
        }),
        (any::<u32>(), camera()).prop_map(|(view, camera)| Step::Begun { view, camera }),
        (any::<u32>(), camera()).prop_map(|(view, camera)| Step::Drawn { view, camera }),
        (any::<u32>(), vec(moved, 0..3)).prop_map(|(epoch, objects)| Step::Edited {
            epoch,
            objects,
            lights: vec![]
        }),
        vec(triple, 0..4).prop_map(|triples| Step::Learned { triples }),
        vec(any::<(u64, bool)>(), 0..4).prop_map(|a| Step::Shadowed(Shadowed::Answers(a))),
        Just(Step::Shadowed(Shadowed::All)),
        Just(Step::Passed),
        (any::<u32>(), vec(run, 0..4)).prop_map(|(view, samples)| Step::Took { view, samples }),
        any::<[u8; 32]>().prop_map(|digest| Step::Pictured { digest }),
        (any::<u32>(), any::<bool>(), proptest::option::of(camera())).prop_map(
            |(budget, first, next)| Step::Planned {
                budget,
                first,
                next
            }
        ),
    ]
}

fn event() -> impl Strategy<Value = Event> {
    let data = vec(any::<u8>(), 0..40).prop_map(Bytes::from);
    prop_oneof![
        data.clone().prop_map(Event::Scene),
        any::<(u32, u32)>().prop_map(|(connection, server)| Event::Opened { connection, server }),
        (any::<u32>(), data.clone())
            .prop_map(|(connection, frame)| Event::Sent { connection, frame }),
        any::<(u32, u64, u32)>().prop_map(|(connection, at, bytes)| Event::SceneSent {
            connection,
            at,
            bytes
        }),
        (any::<u32>(), data).prop_map(|(connection, frame)| Event::Received { connection, frame }),
        (any::<u32>(), ".{0,9}").prop_map(|(connection, why)| Event::Closed { connection, why }),
        step().prop_map(Event::Step),
    ]
}

fn entries() -> impl Strategy<Value = Vec<Entry>> {
    let one = (0u64..1000, event());
    vec(one, 0..8).prop_map(|all| {
        let mut time_us = 0;
        let add = |(later, event)| {
            time_us += later;
            Entry { time_us, event }
        };
        all.into_iter().map(add).collect()
    })
}

fn end(after: &[Entry]) -> Entry {
    Entry {
        time_us: after.last().map_or(0, |entry| entry.time_us),
        event: Event::End { frames: 4 },
    }
}

/// Where the entries begin, and where the last one ends.
fn borders(entries: &[Entry]) -> Vec<u64> {
    (0..=entries.len())
        .map(|n| write(&entries[..n]).len() as u64)
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(128) })]

    #[test]
    fn what_is_written_is_read(mut entries in entries()) {
        let at = write(&entries).len() as u64;
        let (found, ending) = read(&write(&entries)).unwrap();
        prop_assert_eq!((&found, ending), (&entries, Ending::Cut { at }));
        entries.push(end(&entries));
        let whole = write(&entries);
        let longer = [&whole[..], b"more"].concat();
        for bytes in [whole, longer] {
            let (found, ending) = read(&bytes).unwrap();
            prop_assert_eq!((&found, ending), (&entries, Ending::Complete));
        }
    }

    /// Cut anywhere, what stands before the cut is read.
    #[test]
    fn a_cut_loses_what_follows_alone(entries in entries()) {
        let (bytes, borders) = (write(&entries), borders(&entries));
        for cut in 0..=bytes.len() {
            if (cut as u64) < borders[0] {
                let cut_off = matches!(read(&bytes[..cut]), Err(OpenError::Cut));
                prop_assert!(cut_off || cut == 0, "cut at {}", cut);
                continue;
            }
            let whole = borders.partition_point(|b| *b <= cut as u64) - 1;
            let (found, ending) = read(&bytes[..cut]).unwrap();
            prop_assert_eq!(&found[..], &entries[..whole]);
            prop_assert_eq!(ending, Ending::Cut { at: borders[whole] });
        }
    }

    /// A damaged entry ends the trace; those before it are read.
    #[test]
    fn damage_is_noticed(entries in entries(), place in any::<prop::sample::Index>(), flip in 1u8..) {
        let (mut bytes, borders) = (write(&entries), borders(&entries));
        let place = place.index(bytes.len());
        bytes[place] ^= flip;
        let hit = borders.partition_point(|b| *b <= place as u64);
        match read(&bytes) {
            Err(_) => prop_assert_eq!(hit, 0),
            Ok((found, ending)) => {
                // What the preamble says of the version may say another that is known.
                prop_assert!(hit > 0 || (8..12).contains(&place), "a damaged header was taken");
                if hit > 0 {
                    let at = borders[hit - 1];
                    prop_assert_eq!(&found[..], &entries[..hit - 1]);
                    prop_assert!([Ending::Damaged { at }, Ending::Cut { at }].contains(&ending), "{:?}", ending);
                }
            }
        }
    }

    #[test]
    fn any_bytes_are_read_without_harm(mut bytes in vec(any::<u8>(), 0..300), whole in any::<bool>()) {
        if whole {
            bytes = [write(&[]), bytes].concat();
        }
        if let Ok((entries, _)) = read(&bytes) {
            prop_assert!(entries.len() * ENTRY_HEADER <= bytes.len());
        }
    }
}

#[test]
fn other_versions_say_so() {
    let bytes = write(&[]);
    let with = |at: usize, version: u16| {
        let mut bytes = bytes.clone();
        bytes[at..at + 2].copy_from_slice(&version.to_le_bytes());
        read(&bytes).unwrap_err().to_string()
    };
    let newer = with(8, FORMAT + 1);
    assert!(
        newer.contains("trace format 2, which is newer than the 1"),
        "{newer}"
    );
    let older = with(8, FORMAT - 1);
    assert!(
        older.contains("trace format 0, which is older than the 1"),
        "{older}"
    );
    let newer = with(10, VERSION + 1);
    assert!(
        newer.contains("protocol version 4, which is newer"),
        "{newer}"
    );
    let older = with(10, 0);
    assert!(
        older.contains("protocol version 0, which is older"),
        "{older}"
    );
    // Whatever a newer format has after its number is not looked at.
    let mut cut = bytes[..PREAMBLE].to_vec();
    cut[8] = 9;
    assert!(matches!(read(&cut), Err(OpenError::Format { found: 9 })));
    for no_trace in [&b""[..], b"PNG", b"EP-TRACT", &[0; 100]] {
        assert!(matches!(read(no_trace), Err(OpenError::NotATrace)));
    }
}

#[test]
fn times_never_go_back() {
    let at = |time_us| Entry {
        time_us,
        event: Event::End { frames: 0 },
    };
    let mut closed = at(5);
    closed.event = Event::Opened {
        connection: 1,
        server: 0,
    };
    let (found, ending) = read(&write(&[closed, at(3)])).unwrap();
    assert_eq!((found[1].time_us, ending), (5, Ending::Complete));
}
