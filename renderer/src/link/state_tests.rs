use std::time::Duration;

use protocol::messages::NO_OBJECT;

use super::super::testing::{answer, camera, requests, scene};
use super::*;

fn state(servers: usize, capacity: usize) -> State {
    let mut state = State::new(&scene(2), capacity);
    for server in 0..servers {
        assert_eq!(state.slots.open("here"), Some(server));
        state.slots.connect(server);
        let slot = state.slots.get_mut(server).unwrap();
        slot.status.phase = ServerPhase::Ready;
        slot.status.credits = 100;
    }
    state
}

fn take_at(state: &mut State, server: usize, now: Instant) -> Vec<u64> {
    let mut batch = Vec::new();
    state.take(server, usize::MAX, &mut batch, now);
    batch.iter().map(|request| request.id).collect()
}

fn take(state: &mut State, server: usize, most: usize) -> Vec<u64> {
    let mut batch = Vec::new();
    state.take(server, most, &mut batch, Instant::now());
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
    assert_eq!(state.take(0, 10, &mut batch, Instant::now()), Some(new));
    assert_eq!(batch, requests(3..5));
    assert_eq!(take(&mut state, 0, 2), [0, 1]);
    assert_eq!(take(&mut state, 0, 2), [2]);
    assert_eq!(state.take(0, 2, &mut batch, Instant::now()), None);
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

/// Has a server show that it does so many requests a second.
fn show_speed(state: &mut State, server: usize, speed: usize, now: Instant) {
    let flow = &mut state.slots.get_mut(server).unwrap().flow;
    for k in 0..9 {
        let at = now - Duration::from_millis(100 - 10 * k);
        flow.sent(speed / 100, at);
        flow.answered(speed / 100, at + Duration::from_millis(10));
    }
}

#[test]
fn several_servers_share_by_speed() {
    let mut state = state(3, 100_000);
    let now = Instant::now();
    show_speed(&mut state, 0, 10_000, now);
    show_speed(&mut state, 1, 30_000, now);
    show_speed(&mut state, 2, 20_000, now);
    let view = state.set_view(camera());
    state.request(view, &requests(0..90_000));
    let ms = Duration::from_millis;
    // What each does in 100 ms and twice its quickest batch, however much there is.
    assert_eq!(take_at(&mut state, 0, now).len(), 1200);
    assert_eq!(take_at(&mut state, 0, now).len(), 0);
    assert_eq!(take_at(&mut state, 1, now).len(), 3600);
    state.cancel(view + 1);
    state.release(0, &(0..1200).collect::<Vec<_>>());
    state.release(1, &(1200..4800).collect::<Vec<_>>());
    assert_eq!(state.pending(), 0);
    // Half of its share where there is little.
    let view = state.set_view(camera());
    state.request(view, &requests(100_000..101_200));
    assert_eq!(take_at(&mut state, 1, now).len(), 300);
    assert_eq!(take_at(&mut state, 0, now).len(), 100);
    assert_eq!(take_at(&mut state, 2, now).len(), 200);
    // One that is silent is given nothing more, and its share goes to the others.
    assert_eq!(take_at(&mut state, 0, now + ms(260)), [] as [u64; 0]);
    let held: Vec<u64> = (100_300..100_400).collect();
    deliver(&mut state, 0, &held, true);
    assert!(!take_at(&mut state, 0, Instant::now()).is_empty());
}

#[test]
fn a_silent_server_s_requests_are_asked_of_another_and_the_first_answer_counts() {
    let mut state = state(2, 1000);
    let now = Instant::now();
    show_speed(&mut state, 0, 1000, now);
    show_speed(&mut state, 1, 1000, now);
    let view = state.set_view(camera());
    state.request(view, &requests(0..40));
    let held = take_at(&mut state, 0, now);
    assert_eq!(held, (0..10).collect::<Vec<u64>>());
    assert_eq!(state.overdue(0, now), 0);
    let late = now + Duration::from_millis(300);
    assert_eq!(state.overdue(0, late), 10, "it said nothing for too long");
    let again = requests(0..10).into_iter();
    state.ask_again(0, again.map(|request| Outstanding { view, request }));
    assert_eq!(state.pending(), 40);
    assert_eq!(take_at(&mut state, 1, late), held, "first of all");
    assert_eq!(state.pending(), 40);
    deliver(&mut state, 1, &held[..5], true);
    deliver(&mut state, 0, &held, true);
    deliver(&mut state, 1, &held[5..], true);
    let (mut samples, mut triples) = (Vec::new(), Vec::new());
    state.drain(&mut samples, &mut triples);
    let mut ids: Vec<u64> = samples.iter().map(|s| s.sample.id).collect();
    ids.sort_unstable();
    assert_eq!(ids, held, "each once");
    assert_eq!((state.status().late, state.pending()), (10, 30));
}

#[test]
fn a_slow_server_s_requests_are_asked_of_an_idle_one() {
    let mut state = state(2, 1000);
    let now = Instant::now();
    let view = state.set_view(camera());
    show_speed(&mut state, 0, 100, now);
    show_speed(&mut state, 1, 900, now);
    state.request(view, &requests(0..40));
    state.slots.get_mut(1).unwrap().status.phase = ServerPhase::Connecting;
    assert_eq!(take_at(&mut state, 0, now).len(), 40, "it is alone");
    state.slots.get_mut(1).unwrap().status.phase = ServerPhase::Ready;
    assert_eq!(state.overdue(0, now), 36, "so that both end together");
    state.request(view, &requests(40..50));
    assert_eq!(state.overdue(0, now), 0, "there is other work");
    assert_eq!(state.overdue(1, now), 0);
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
