use std::sync::mpsc;

use super::super::testing::{
    Behaviour, FakeServer, Fate, HONEST, answer, camera, link_to, link_with, requests, scene,
};
use super::*;
use protocol::ToServer;
use protocol::messages::FaultCode;

const LONG: Duration = Duration::from_secs(20);

fn with(fate: Fate) -> Behaviour {
    Behaviour { fate, ..HONEST }
}

/// Waits until the link has got so far.
fn wait_for(link: &Link, so_far: impl Fn(&LinkStatus) -> bool) {
    let mut state = link.shared.lock();
    while !so_far(&state.status()) {
        let (woken, timeout) = link.shared.changed.wait_timeout(state, LONG).unwrap();
        assert!(!timeout.timed_out(), "nothing happened");
        state = woken;
    }
}

/// Asks for 1000 samples and waits for them.
fn thousand(link: &mut Link) -> (Vec<ReceivedSample>, Vec<Triple>) {
    let view = link.set_view(camera()).unwrap();
    let first = link.newest_id.map_or(0, |id| id + 1);
    assert_eq!(
        link.request(view, &requests(first..first + 1000)).unwrap(),
        1000
    );
    let (mut samples, mut triples) = (Vec::new(), Vec::new());
    let outcome = link.wait(LONG, &mut samples, &mut triples);
    assert_eq!(outcome, WaitOutcome::Complete, "{:?}", link.status());
    let expected = (first..first + 1000).map(|id| answer(7, id));
    assert!(
        samples.iter().map(|r| r.sample).eq(expected),
        "samples are wrong or missing"
    );
    assert!(
        samples
            .iter()
            .all(|r| r.view == view && r.epoch == link.epoch())
    );
    (samples, triples)
}

#[test]
fn two_servers_give_what_one_gives() {
    let (a, b) = (FakeServer::start(HONEST), FakeServer::start(HONEST));
    let one = thousand(&mut link_to(&[&a]));
    let alone = a.asked();
    assert_eq!(alone, 1000);
    let mut link = link_to(&[&a, &b]);
    let two = thousand(&mut link);
    assert!(one == two, "samples or triples differ");
    assert_eq!(two.1.len(), 2);
    assert_eq!(a.asked() - alone + b.asked(), 1000);
    let both_ready = |link: &Link| link.status().connected == 2;
    while !both_ready(&link) {
        thousand(&mut link);
    }
    let before = (a.asked(), b.asked());
    thousand(&mut link);
    assert!(
        a.asked() > before.0 && b.asked() > before.1,
        "one server did it all"
    );
}

#[test]
fn what_a_lost_server_held_goes_to_the_others() {
    for fate in [Fate::CloseAfter(90), Fate::Nan, Fate::Twice, Fate::Mute] {
        let (bad, good) = (FakeServer::start(with(fate)), FakeServer::start(HONEST));
        let mut config = LinkConfig::new(vec![], 7);
        if fate == Fate::Mute {
            config.timeout = Duration::from_millis(400);
        }
        let mut link = link_with(&[&bad, &good], config);
        // The bad one may be late for the first thousand.
        while link.status().faults == 0 {
            thousand(&mut link);
        }
        thousand(&mut link);
        let status = link.status();
        assert_eq!((status.outstanding, status.queued), (0, 0), "{fate:?}");
        drop(link);
        let told = bad
            .log_of_all()
            .into_iter()
            .find_map(|message| match message {
                ToServer::Fault { code, .. } => Some(code),
                _ => None,
            });
        match fate {
            Fate::Nan => assert_eq!(told, Some(FaultCode::Value)),
            Fate::Twice => assert_eq!(told, Some(FaultCode::OutOfOrder)),
            _ => assert_eq!(told, None),
        }
    }
}

#[test]
fn a_server_that_comes_back_is_used_again() {
    let server = FakeServer::start(with(Fate::CloseAfter(400)));
    let mut link = link_to(&[&server]);
    thousand(&mut link);
    assert_eq!(link.status().faults, 2);
    // Whether writing or reading meets the end first is a matter of luck.
    let fault = link.status().last_fault.unwrap();
    let told = ["the server closed the connection", "the connection failed"];
    assert!(told.iter().any(|t| fault.starts_with(t)), "{fault}");
}

#[test]
fn with_no_server_left_waiting_ends() {
    let gone = FakeServer::start(HONEST).source();
    let mut config = LinkConfig::new(vec![gone], 0);
    config.attempts = 2;
    let mut link = Link::start(config, Arc::new(scene(2))).unwrap();
    let view = link.set_view(camera()).unwrap();
    link.request(view, &requests(0..3)).unwrap();
    let outcome = link.wait(LONG, &mut Vec::new(), &mut Vec::new());
    assert_eq!(outcome, WaitOutcome::NoServer);
    assert_eq!(link.status().queued, 3);
    assert!(link.status().last_fault.unwrap().contains("cannot connect"));
}

#[test]
fn edits_reach_servers_before_the_requests_that_follow() {
    let server = FakeServer::start(HONEST);
    let mut link = link_to(&[&server]);
    thousand(&mut link);
    let moved = |x| ObjectMove {
        object: 1,
        transform: [
            [1.0, 0.0, 0.0, x],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ],
    };
    assert_eq!(link.edit(&[moved(1.0)], &[]).unwrap(), 1);
    assert_eq!(link.edit(&[moved(2.0)], &[]).unwrap(), 2);
    let (samples, triples) = thousand(&mut link);
    assert_eq!(samples[0].epoch, 2);
    assert!(!triples.is_empty(), "triples are told anew in each epoch");
    let log = server.log();
    let edit = log
        .iter()
        .rposition(|m| matches!(m, ToServer::Edit { .. }))
        .unwrap();
    let asked_after = log[edit..]
        .iter()
        .filter(|m| matches!(m, ToServer::Request { .. }))
        .count();
    assert!(asked_after >= 1000 / 70);
    assert!(matches!(&log[edit], ToServer::Edit { objects, .. } if objects[..] == [moved(2.0)]));

    let late = FakeServer::start(HONEST);
    let mut link = link_to(&[&late]);
    link.edit(&[moved(1.0)], &[]).unwrap();
    link.edit(&[moved(3.0)], &[]).unwrap();
    thousand(&mut link);
    assert!(
        link.edit(
            &[ObjectMove {
                object: 9,
                ..moved(0.0)
            }],
            &[]
        )
        .is_err()
    );
    assert_eq!(link.epoch(), 2);
}

#[test]
fn samples_of_an_older_epoch_never_enter() {
    let server = FakeServer::start(with(Fate::Late));
    let mut link = link_to(&[&server]);
    let view = link.set_view(camera()).unwrap();
    link.request(view, &requests(0..50)).unwrap();
    wait_for(&link, |status| status.outstanding == 50);
    link.edit(&[], &[]).unwrap();
    let (mut samples, mut triples) = (Vec::new(), Vec::new());
    assert_eq!(
        link.wait(LONG, &mut samples, &mut triples),
        WaitOutcome::Complete
    );
    assert!(samples.is_empty() && triples.is_empty());
    assert_eq!(link.status().stale, 100, "50 samples, each with its triple");
    thousand(&mut link);
}

#[test]
fn a_server_without_edits_is_sent_the_scene_again() {
    let server = FakeServer::start(Behaviour {
        edits: false,
        ..HONEST
    });
    let mut link = link_to(&[&server]);
    thousand(&mut link);
    let value = protocol::scene::Light::Point {
        position: [1.0; 3],
        intensity: [2.0; 3],
    };
    link.edit(&[], &[LightMove { light: 0, value }]).unwrap();
    thousand(&mut link);
    let digests: Vec<_> = server
        .log()
        .into_iter()
        .filter_map(|m| match m {
            ToServer::SceneBegin { digest, .. } => Some(digest),
            _ => None,
        })
        .collect();
    assert_eq!(digests.len(), 2);
    assert_ne!(digests[0], digests[1]);
    assert_eq!(link.status().faults, 0);
}

#[test]
fn cancelled_requests_are_waited_for_no_longer() {
    let server = FakeServer::start(with(Fate::Hold));
    let mut link = link_to(&[&server]);
    let old = link.set_view(camera()).unwrap();
    link.request(old, &requests(0..1000)).unwrap();
    wait_for(&link, |status| status.outstanding > 0);
    let new = link.set_view(camera()).unwrap();
    link.cancel_before(new);
    let mut samples = Vec::new();
    assert_eq!(
        link.wait(LONG, &mut samples, &mut Vec::new()),
        WaitOutcome::Complete
    );
    assert!(samples.is_empty());
    assert_eq!(link.request(old, &requests(1000..1001)).unwrap(), 0);
    assert_eq!(link.status().faults, 0, "{:?}", link.status());
}

#[test]
fn the_waker_tells_of_samples_and_draining_does_not_wait() {
    let server = FakeServer::start(HONEST);
    let (tell, told) = mpsc::channel();
    let mut config = LinkConfig::new(vec![server.source()], 7);
    config.waker = Some(Box::new(move || {
        let _ = tell.send(());
    }));
    let mut link = Link::start(config, Arc::new(scene(2))).unwrap();
    let view = link.set_view(camera()).unwrap();
    link.request(view, &requests(0..500)).unwrap();
    let (mut samples, mut triples) = (Vec::new(), Vec::new());
    while samples.len() < 500 {
        told.recv_timeout(LONG).unwrap();
        link.drain(&mut samples, &mut triples);
    }
    assert_eq!(link.servers()[0].name.as_ref(), "fake (test)");
}

#[test]
fn bad_input_is_refused_with_a_reason() {
    let start = |servers| Link::start(LinkConfig::new(servers, 0), Arc::new(scene(2))).err();
    assert!(matches!(start(vec![]), Some(LinkError::NoServers)));
    let far = vec![ServerSource::Connect("192.0.2.1:80".into())];
    assert!(matches!(start(far), Some(LinkError::NotLoopback(_))));
    let mut bad_scene = scene(1);
    bad_scene.objects[0].mesh = 5;
    let server = FakeServer::start(HONEST);
    let config = LinkConfig::new(vec![server.source()], 0);
    let error = Link::start(config, Arc::new(bad_scene)).err().unwrap();
    assert!(error.to_string().contains("objects[0].mesh"), "{error}");

    let mut link = link_to(&[&server]);
    assert!(
        link.set_view(Camera {
            fov_y: 0.0,
            ..camera()
        })
        .is_err()
    );
    let view = link.set_view(camera()).unwrap();
    link.request(view, &requests(5..6)).unwrap();
    let repeated = link.request(view, &requests(5..7));
    assert!(matches!(repeated, Err(LinkError::Ids { id: 5, newest: 5 })));
}

#[cfg(unix)]
#[test]
fn spawned_servers_end_with_the_link() {
    let server = FakeServer::start(HONEST);
    let mark = std::env::temp_dir().join(format!("edge-point-link-{}", std::process::id()));
    let script = format!(
        "echo listening on {}; echo more; cat > /dev/null; echo $1 > '{}'",
        server.address,
        mark.display()
    );
    let spawn = |script: &str| ServerSource::Spawn {
        program: "sh".into(),
        args: ["-c", script, "server"].map(OsString::from).into(),
    };
    let config = LinkConfig::new(vec![spawn(&script)], 7);
    let mut link = Link::start(config, Arc::new(scene(2))).unwrap();
    thousand(&mut link);
    assert!(!mark.exists());
    drop(link);
    let said = std::fs::read_to_string(&mark).unwrap();
    std::fs::remove_file(&mark).unwrap();
    assert_eq!(
        said.trim(),
        "--listen",
        "the server was not left to end by itself"
    );

    for script in ["echo hello", "exit 1", "echo listening on nowhere"] {
        let mut config = LinkConfig::new(vec![spawn(script)], 7);
        config.attempts = 1;
        let mut link = Link::start(config, Arc::new(scene(2))).unwrap();
        let view = link.set_view(camera()).unwrap();
        link.request(view, &requests(0..1)).unwrap();
        let outcome = link.wait(LONG, &mut Vec::new(), &mut Vec::new());
        assert_eq!(outcome, WaitOutcome::NoServer);
        assert!(
            link.status().last_fault.unwrap().contains("did not print"),
            "{script}"
        );
    }
}
