//! Logs of sessions: what comes late never enters, and in which order triples come makes no difference.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use protocol::messages::Triple;
use protocol::trace::{Event, Step};
use protocol::{ToDisplay, ToServer};
use system_tests::report::stats;

use crate::recorded::{Fate, Place, Proxy, read, redraw, text, write};
use crate::support::ShaderServer;

#[test]
fn samples_of_an_older_epoch_never_enter() {
    let place = Place::new();
    let server = ShaderServer::start();
    let late = Proxy::start(&server.address, Fate::Late(Duration::from_millis(3)));
    let args = format!(
        "--path push --fps 600 --frames 1000 --write none --connect {}",
        late.address
    );
    let trace = place.record("late", &args);
    let entries = read(&trace).1;
    let (mut epoch, mut came_late, mut entered) = (0, 0, 0);
    let mut of_older: BTreeMap<(u32, u64), bool> = BTreeMap::new();
    // The display's epochs by those that the server was told of, which may be fewer.
    let mut told = vec![0];
    for entry in &entries {
        match &entry.event {
            Event::Step(Step::Edited { epoch: now, .. }) => {
                epoch = *now;
                of_older.values_mut().for_each(|older| *older = true);
            }
            Event::Sent { frame, .. } => {
                if let ToServer::Edit { .. } = protocol::decode(frame).unwrap() {
                    told.push(epoch);
                }
            }
            Event::Received { connection, frame } => {
                let message = protocol::decode(frame).unwrap();
                if let ToDisplay::Samples {
                    epoch: traced,
                    samples,
                    ..
                } = message
                {
                    let traced = told[traced as usize];
                    came_late += if traced < epoch { samples.len() } else { 0 };
                    let all = samples
                        .iter()
                        .map(|s| ((*connection, s.id), traced < epoch));
                    of_older.extend(all);
                }
            }
            Event::Step(Step::Took { samples, .. }) => {
                for run in samples {
                    for id in run.first..run.first + u64::from(run.count) {
                        entered += 1;
                        assert!(!of_older[&(run.connection, id)], "sample {id} is too late");
                    }
                }
            }
            _ => {}
        }
    }
    println!("{came_late} samples came late, {entered} entered");
    assert!(epoch > 4 && came_late > 0 && entered > 60);
    assert!(
        redraw(&trace, &place.at("again"), &[])
            .unwrap()
            .differing
            .is_empty()
    );
}

/// Shadow edges and triples of each frame of a trace.
fn shadow_edges(trace: &Path, place: &Place) -> Vec<u64> {
    let out = place.at("edges");
    let file = out.join("stats.jsonl");
    std::fs::create_dir_all(&out).unwrap();
    redraw(trace, &out, &["--write", "none", "--stats", text(&file)]).unwrap();
    let lines = std::fs::read_to_string(file).unwrap();
    let lines = stats::parse(&lines).unwrap();
    lines.iter().map(|line| line.shadow_edges).collect()
}

/// ANCHORS of the log: what is learned of triples, in any order, twice, and with one left out.
#[test]
fn edges_do_not_depend_on_the_order_of_triples_and_a_lost_one_costs_its_edges_alone() {
    let place = Place::new();
    let trace = place.record(
        "first",
        "--path push --frames 20 --lockstep --shadow-edges all",
    );
    let (header, entries) = read(&trace);
    let wanted = shadow_edges(&trace, &place);
    assert!(wanted[2..].iter().all(|n| *n > 0), "{wanted:?}");
    let edges_of = |change: &mut dyn FnMut(usize, &mut Vec<Triple>)| {
        let mut entries = entries.clone();
        let mut learned = 0;
        for entry in &mut entries {
            if let Event::Step(Step::Learned { triples }) = &mut entry.event {
                change(learned, triples);
                learned += 1;
            }
        }
        let other = place.at("other.trace");
        write(&other, &header, &entries);
        shadow_edges(&other, &place)
    };
    let reversed = edges_of(&mut |_, triples| triples.reverse());
    assert_eq!(reversed, wanted, "in another order");
    let mut before = Vec::new();
    let twice = edges_of(&mut |_, triples| {
        let own = triples.clone();
        triples.extend_from_slice(&own);
        triples.splice(..0, std::mem::replace(&mut before, own));
    });
    assert_eq!(twice, wanted, "twice, and once more later");
    // The first triple is left out until the next edit has it told again.
    let lost = edges_of(&mut |learned, triples| {
        if learned == 0 {
            triples.remove(0);
        }
    });
    println!("{wanted:?}\n{lost:?}");
    assert!(lost.iter().zip(&wanted).all(|(lost, all)| lost <= all));
    assert!(lost[0] < wanted[0]);
    assert_eq!(lost.last(), wanted.last(), "it was told again");
}
