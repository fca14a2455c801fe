//! Servers that are many, slow, far, or come by themselves.

use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use protocol::secret::{self, Role, Secret};
use tokio::net::TcpStream;

use super::face::{Link, LinkConfig, ServerSource, WaitOutcome};
use super::status::LinkStatus;
use super::testing::{Behaviour, FakeServer, Fate, HONEST, answer, camera, requests, scene, serve};

const LONG: Duration = Duration::from_secs(20);

fn start(config: LinkConfig) -> Link {
    Link::start(config, Arc::new(scene(2))).unwrap()
}

fn slow(ms: u64) -> FakeServer {
    FakeServer::start(Behaviour {
        fate: Fate::Slow(ms),
        ..HONEST
    })
}

/// Asks for samples, with ids from `first` on, and waits for them.
fn ask(link: &mut Link, first: u64, count: u64) -> Duration {
    let view = link.set_view(camera()).unwrap();
    let start = Instant::now();
    let asked = requests(first..first + count);
    assert_eq!(link.request(view, &asked).unwrap(), asked.len());
    let mut samples = Vec::new();
    let outcome = link.wait(LONG, &mut samples, &mut Vec::new());
    assert_eq!(outcome, WaitOutcome::Complete, "{:?}", link.status());
    let expected = (first..first + count).map(|id| answer(7, id));
    assert!(samples.iter().map(|r| r.sample).eq(expected));
    start.elapsed()
}

fn wait_until(link: &Link, so_far: impl Fn(&LinkStatus) -> bool) {
    let start = Instant::now();
    while !so_far(&link.status()) {
        assert!(start.elapsed() < LONG, "{:?}", link.status());
        std::thread::yield_now();
    }
}

#[test]
fn a_slow_server_holds_nothing_up() {
    let (fast, slow) = (FakeServer::start(HONEST), slow(200));
    let mut config = LinkConfig::new(vec![fast.source(), slow.source()], 7);
    // Whoever answers nothing for so long is lost: this one must not be.
    config.timeout = Duration::from_secs(60);
    let mut link = start(config);
    wait_until(&link, |status| status.connected == 2);
    // 64 requests to begin with would take the slow one 13 s.
    let took = ask(&mut link, 0, 1000);
    assert!(took < Duration::from_secs(8), "{took:?}");
    assert!(slow.asked() > 0, "it was not asked");
    assert_eq!(link.status().faults, 0);
}

#[test]
fn a_mute_server_s_requests_are_answered_by_another_long_before_it_is_lost() {
    let mute = FakeServer::start(Behaviour {
        fate: Fate::Mute,
        ..HONEST
    });
    let fast = FakeServer::start(HONEST);
    let mut config = LinkConfig::new(vec![mute.source(), fast.source()], 7);
    config.timeout = Duration::from_secs(600);
    let mut link = start(config);
    wait_until(&link, |status| status.connected == 2);
    ask(&mut link, 0, 1000);
    assert!(mute.asked() > 0, "it was not asked");
    let status = link.status();
    assert_eq!(
        (status.faults, status.queued, status.outstanding),
        (0, 0, 0)
    );
    ask(&mut link, 1000, 1000);
}

#[test]
fn all_servers_behind_a_host_name_are_used_also_those_that_come_later() {
    let first = FakeServer::start_at("127.0.0.1:0", HONEST);
    let port = first.address.parse::<SocketAddr>().unwrap().port();
    let mut config = LinkConfig::new(vec![ServerSource::Connect("shaders:80".into())], 7);
    let names = Arc::new(Mutex::new(Vec::<SocketAddr>::new()));
    let known = Arc::clone(&names);
    config.look_up = Arc::new(move |host| {
        assert_eq!(host, "shaders:80");
        let known = known.lock().unwrap().clone();
        if known.is_empty() {
            return Err(std::io::ErrorKind::NotFound.into());
        }
        Ok(known)
    });
    let name = |hosts: &[u8]| {
        let all = hosts
            .iter()
            .map(|&d| SocketAddr::from(([127, 0, 0, d], port)));
        *names.lock().unwrap() = all.collect();
    };
    let mut link = start(config);
    wait_until(&link, |status| status.faults > 0);
    let why = link.status().last_fault.unwrap();
    assert!(
        why.starts_with("no address is known for shaders:80"),
        "{why}"
    );
    name(&[1]);
    ask(&mut link, 0, 100);
    let second = FakeServer::start_at(&format!("127.0.0.2:{port}"), HONEST);
    let _third = FakeServer::start_at(&format!("127.0.0.3:{port}"), HONEST);
    name(&[1, 2, 3]);
    wait_until(&link, |status| status.connected == 3);
    // One that the name no longer leads to is used until it is lost, and not looked for again.
    name(&[1, 3]);
    wait_until(&link, |_| !names.lock().unwrap().is_empty());
    drop(second);
    wait_until(&link, |status| status.servers == 2);
    ask(&mut link, 100, 1000);
}

#[test]
fn a_server_that_comes_back_is_fed_within_a_second() {
    let other = FakeServer::start(HONEST);
    let server = FakeServer::start(HONEST);
    let place = server.address.clone();
    let mut link = start(LinkConfig::new(vec![other.source(), server.source()], 7));
    wait_until(&link, |status| status.connected == 2);
    drop(server);
    wait_until(&link, |status| status.connected == 1);
    // Long enough for the pauses between attempts to have grown.
    wait_until(&link, |status| status.faults > 6);
    let server = FakeServer::start_at(&place, HONEST);
    let back = Instant::now();
    let mut first = 0;
    while server.asked() == 0 {
        ask(&mut link, first, 200);
        first += 200;
    }
    // A second, and what a loaded machine adds.
    assert!(
        back.elapsed() < Duration::from_secs(5),
        "{:?}",
        back.elapsed()
    );
}

/// A server that dials a display, with a secret or without, on a thread of its own.
fn dial(address: SocketAddr, key: Option<&'static str>) -> std::thread::JoinHandle<bool> {
    std::thread::spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .unwrap();
        runtime.block_on(async move {
            let mut stream = TcpStream::connect(address).await.unwrap();
            if let Some(key) = key {
                let key = Secret::new(key);
                if secret::dialled(&mut stream, &key, Role::ShaderServer)
                    .await
                    .is_err()
                {
                    return false;
                }
            }
            let log = Arc::new(Mutex::new(Vec::new()));
            serve(stream, HONEST, Arc::clone(&log)).await;
            !log.lock().unwrap().is_empty()
        })
    })
}

#[test]
fn servers_that_dial_in_are_used_if_they_know_the_secret() {
    let mut config = LinkConfig::new(vec![ServerSource::Accept(([127, 0, 0, 1], 0).into())], 7);
    config.secret = Some(Secret::new("an open secret of tests"));
    let mut link = start(config);
    let address = link.listening()[0];
    let without = dial(address, None);
    let wrong = dial(address, Some("not the one that counts"));
    assert!(!wrong.join().unwrap(), "it came in");
    let right = [0, 1].map(|_| dial(address, Some("an open secret of tests")));
    wait_until(&link, |status| status.connected == 2);
    ask(&mut link, 0, 1000);
    drop(link);
    assert!(right.into_iter().all(|server| server.join().unwrap()));
    assert!(!without.join().unwrap(), "it was told something");
}

#[test]
fn beyond_this_machine_a_secret_is_wanted() {
    let far: SocketAddr = ([192, 0, 2, 1], 80).into();
    let any: SocketAddr = ([0, 0, 0, 0], 0).into();
    for source in [
        ServerSource::Connect(far.to_string()),
        ServerSource::Accept(any),
    ] {
        let refused = Link::start(LinkConfig::new(vec![source], 7), Arc::new(scene(2)));
        let error = refused.err().unwrap().to_string();
        assert!(error.contains("--secret-file"), "{error}");
    }
    let mut config = LinkConfig::new(vec![ServerSource::Accept(any)], 7);
    config.secret = Some(Secret::new("an open secret of tests"));
    start(config);
    let mut config = LinkConfig::new(vec![ServerSource::Connect("far:80".into())], 7);
    config.look_up = Arc::new(move |_| Ok(vec![far]));
    let link = start(config);
    wait_until(&link, |status| status.faults > 0);
    let why = link.status().last_fault.unwrap();
    assert!(why.contains("--secret-file"), "{why}");
}
