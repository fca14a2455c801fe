use protocol::messages::NO_OBJECT;

use super::super::testing::{answer, camera, requests, scene};
use super::*;

fn state(servers: usize, capacity: usize) -> State {
    let mut state = State::new(&scene(2), servers, capacity);
    for server in &mut state.servers {
        server.phase = ServerPhase::Ready;
        server.credits = 100;
    }
    state
}

fn take(state: &mut State, server: usize, most: usize) -> Vec<u64> {
    let mut batch = Vec::new();
    state.take(server, most, &mut batch);
    batch.iter().map(|request| request.id).collect()
}

fn deliver(state: &mut State, server: usize, ids: &[u64], current: bool) -> bool {
    let received = |&id: &u64| ReceivedSample {
        connection: 0,
        view: 1,
        epoch: 0,
        sample: answer(0, id),
        texel: None,
    };
    state.deliver(server, ids.iter().map(received), current)
}

#[test]
fn newer_requests_come_first_and_views_do_not_mix() {
    let mut state = state(1, 100);
    let old = state.set_view(camera());
    state.request(old, &requests(0..3));
    let new = state.set_view(camera());
    state.request(new, &requests(3..5));
    let mut batch = Vec::new();
    assert_eq!(state.take(0, 10, &mut batch), Some(new));
    assert_eq!(batch, requests(3..5));
    assert_eq!(take(&mut state, 0, 2), [0, 1]);
    assert_eq!(take(&mut state, 0, 2), [2]);
    assert_eq!(state.take(0, 2, &mut batch), None);
    assert_eq!(state.pending(), 5);
}

#[test]
fn the_oldest_give_way_when_it_is_full() {
    let mut state = state(1, 10);
    let view = state.set_view(camera());
    assert_eq!(state.request(view, &requests(0..4)), 4);
    assert_eq!(take(&mut state, 0, 2), [0, 1]);
    deliver(&mut state, 0, &[0], true);
    assert_eq!(state.request(view, &requests(4..11)), 7);
    assert_eq!(take(&mut state, 0, 100), [4, 5, 6, 7, 8, 9, 10, 2]);
    assert_eq!(state.request(view, &requests(11..20)), 0);
    assert_eq!(state.status().dropped, 1);
}

#[test]
fn several_servers_share_by_credit() {
    let mut state = state(2, 10_000);
    state.servers[1].credits = 300;
    let view = state.set_view(camera());
    state.request(view, &requests(0..8000));
    assert_eq!(take(&mut state, 0, usize::MAX).len(), 1000);
    assert_eq!(take(&mut state, 0, usize::MAX).len(), 0);
    assert_eq!(take(&mut state, 1, usize::MAX).len(), 3000);
    let all: Vec<u64> = (0..1000).collect();
    deliver(&mut state, 0, &all, true);
    assert_eq!(take(&mut state, 0, usize::MAX).len(), 875);
    state.servers[1].credits = 0;
    assert_eq!(take(&mut state, 0, usize::MAX).len(), 3125);
}

#[test]
fn lost_requests_return_to_the_front_unless_cancelled() {
    let mut state = state(1, 100);
    let old = state.set_view(camera());
    state.request(old, &requests(0..2));
    let new = state.set_view(camera());
    state.request(new, &requests(2..5));
    take(&mut state, 0, 2);
    let held: Vec<_> = requests(2..4)
        .into_iter()
        .map(|request| Outstanding { view: new, request })
        .collect();
    state.hand_back(0, &held);
    assert_eq!(take(&mut state, 0, 100), [2, 3, 4]);
    let held: Vec<_> = requests(2..5)
        .into_iter()
        .map(|request| Outstanding { view: new, request })
        .collect();
    state.cancel(new + 1);
    state.hand_back(0, &held);
    assert_eq!((state.pending(), state.status().dropped), (0, 0));
    assert_eq!(state.request(new, &requests(9..10)), 0);
}

#[test]
fn forgotten_views_take_their_requests_along() {
    let mut state = state(1, 100);
    let first = state.set_view(camera());
    state.request(first, &requests(0..3));
    for _ in 0..VIEWS_KEPT {
        state.set_view(camera());
    }
    assert_eq!((state.pending(), state.status().dropped), (0, 3));
    assert_eq!(state.request(first, &requests(3..4)), 0);
}

#[test]
fn answers_of_older_epochs_are_counted_and_dropped() {
    let mut state = state(1, 100);
    let view = state.set_view(camera());
    state.request(view, &requests(0..10));
    take(&mut state, 0, 10);
    assert!(deliver(&mut state, 0, &[0, 1], true));
    assert!(!deliver(&mut state, 0, &[2], true));
    let triple = Triple {
        light: 0,
        blocker: 0,
        receiver: 1,
    };
    state.deliver_triples(&[triple, triple], true);
    state.edits.add(&[], &[]).unwrap();
    state.forget_answers();
    assert!(!deliver(&mut state, 0, &[3], false));
    state.deliver_triples(&[triple], false);
    state.deliver_triples(&[triple], true);
    let (mut samples, mut triples) = (Vec::new(), Vec::new());
    state.drain(&mut samples, &mut triples);
    assert!(samples.is_empty());
    assert_eq!(triples, [triple]);
    assert_eq!(state.status().stale, 6);
    assert_eq!(state.status().samples, 4);
    assert_ne!(triples[0].receiver, NO_OBJECT);
}

#[test]
fn a_server_counts_as_gone_after_its_attempts() {
    let mut state = state(2, 10);
    state.lost(0, 3, "gone");
    assert!(state.any_left(3));
    state.lost(1, 2, "gone");
    assert!(state.any_left(3));
    state.lost(1, 3, "gone too");
    assert!(!state.any_left(3));
    assert_eq!(state.status().last_fault.as_deref(), Some("gone too"));
    assert_eq!((state.status().faults, state.status().connected), (3, 0));
}
