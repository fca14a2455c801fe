//! Whole sessions over loopback, the server in this process.
#![allow(clippy::unwrap_used)]

mod common;

use std::time::Duration;

use common::{
    Client, TestServer, camera, floor_and_lid, moved, object, requests, scene, sphere, square,
};
use protocol::{
    framing::display_side, handshake::hello, messages::*, scene::Light, session::DisplayEvent,
};
use tokio::{io::AsyncWriteExt, net::TcpStream, time::timeout};

fn view(view: u32) -> ToServer {
    ToServer::View {
        view,
        camera: camera(),
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_request_is_answered_once_and_shadows_once_an_epoch() {
    let server = TestServer::start(2, 1 << 16).await;
    let mut client = Client::connect(&server, &floor_and_lid(), 5).await;
    client.send(view(1)).await;
    let (samples, triples) = client.ask(1, requests(0..4096)).await;
    assert_eq!(samples.len(), 4096);
    let misses = samples
        .values()
        .filter(|(_, s)| s.flags == flags::MISS)
        .count();
    assert!(misses > 100, "{misses} misses");
    for (epoch, sample) in samples.values() {
        assert_eq!(*epoch, 0);
        if sample.flags == flags::MISS {
            assert_eq!(sample.radiance, [0.25, 0.5, 1.]);
        }
    }
    let shadow = Triple {
        light: 0,
        blocker: 1,
        receiver: 0,
    };
    assert_eq!(triples, [(0, shadow)]);
    let (_, again) = client.ask(1, requests(4096..8192)).await;
    assert_eq!(again, []);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn samples_depend_on_seed_and_id_alone() {
    let area = Light::Area {
        vertices: vec![[-1., 3., -1.], [1., 3., -1.], [1., 3., 1.], [-1., 3., 1.]],
        radiance: [3.; 3],
    };
    let scene = common::Scene {
        lights: vec![area],
        ..floor_and_lid()
    };
    let mut runs = vec![];
    for (threads, seed, chunk) in [(1, 7, 4096), (2, 7, 100), (2, 8, 4096)] {
        let server = TestServer::start(threads, 1 << 16).await;
        let mut client = Client::connect(&server, &scene, seed).await;
        client.send(view(1)).await;
        let mut all = vec![];
        for part in requests(0..4096).chunks(chunk).rev() {
            all.extend(
                client
                    .ask(1, part.to_vec())
                    .await
                    .0
                    .into_values()
                    .map(|(_, s)| s),
            );
        }
        all.sort_by_key(|sample| sample.id);
        runs.push(all);
        server.stop().await;
    }
    assert_eq!(runs[0], runs[1]);
    assert_ne!(runs[0], runs[2]);
    let differ = runs[0].iter().zip(&runs[2]).filter(|(a, b)| a != b).count();
    assert!(
        differ < 1500,
        "only penumbrae are random, but {differ} samples differ"
    );
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn edits_move_objects_and_lights_in_their_epoch() {
    let server = TestServer::start(2, 1 << 16).await;
    let mut client = Client::connect(&server, &floor_and_lid(), 5).await;
    client.send(view(1)).await;
    let lit = |all: &std::collections::HashMap<u64, (u32, Sample)>| {
        all.values()
            .filter(|(_, s)| s.object == 0 && s.radiance[0] > 0.)
            .count()
    };
    let (before, _) = client.ask(1, requests(0..4096)).await;
    let lift = ObjectMove {
        object: 1,
        transform: moved(0., 50., 0.),
    };
    client
        .send(ToServer::Edit {
            epoch: 1,
            objects: vec![lift],
            lights: vec![],
        })
        .await;
    let (after, triples) = client.ask(1, requests(4096..8192)).await;
    assert!(
        after
            .values()
            .all(|(epoch, s)| *epoch == 1 && s.object != 1)
    );
    assert_eq!(triples, []);
    assert!(lit(&after) > lit(&before));

    let lower = ObjectMove {
        object: 1,
        transform: moved(0., 1., 0.),
    };
    let value = Light::Point {
        position: [1., 2., 0.],
        intensity: [0., 4., 0.],
    };
    let lights = vec![LightMove { light: 0, value }];
    client
        .send(ToServer::Edit {
            epoch: 2,
            objects: vec![lower],
            lights,
        })
        .await;
    let (third, triples) = client.ask(1, requests(8192..12288)).await;
    assert!(
        third
            .values()
            .filter(|(_, s)| s.object == 0)
            .all(|(_, s)| s.radiance[0] == 0.)
    );
    assert!(third.values().any(|(_, s)| s.radiance[1] > 0.));
    assert_eq!(
        triples,
        [(
            2,
            Triple {
                light: 0,
                blocker: 1,
                receiver: 0
            }
        )]
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn cancelling_stops_work() {
    // Light that is slow to shade: many large area lights behind a comb of lids.
    let lights = (0..32)
        .map(|i| {
            let x = i as f32 * 0.1;
            let vertices = vec![
                [x - 1., 3., -1.],
                [x + 1., 3., -1.],
                [x + 1., 3., 1.],
                [x - 1., 3., 1.],
            ];
            Light::Area {
                vertices,
                radiance: [1.; 3],
            }
        })
        .collect();
    let mut objects = vec![object("floor", 0, common::AT_ORIGIN)];
    objects.extend(
        (0..20).map(|i| object(&format!("lid {i}"), 1, moved(0.3 * i as f32 - 3., 1., 0.))),
    );
    let scene = scene(lights, vec![square(4.), square(0.12)], objects);
    let server = TestServer::start(1, 1 << 16).await;
    let mut client = Client::connect(&server, &scene, 5).await;
    client.send(view(1)).await;
    client.send(view(2)).await;
    client
        .send(ToServer::Request {
            view: 1,
            samples: requests(0..30_000),
        })
        .await;
    while !matches!(client.next().await.0, ToDisplay::Samples { .. }) {}
    client.send(ToServer::Cancel { views_before: 2 }).await;
    let released = loop {
        match client.next().await.1 {
            DisplayEvent::Status { released } if !released.is_empty() => break released.len(),
            _ => {}
        }
    };
    assert!(released > 20_000, "{released} requests were left to cancel");
    assert_eq!(client.session.outstanding(), 0);
    // The session goes on, with its whole credit, and checks in `next` that nothing of view 1 comes.
    let (samples, _) = client.ask(2, requests(30_000..30_100)).await;
    assert_eq!(samples.len(), 100);
    client.send(ToServer::Cancel { views_before: 2 }).await;
    let ToDisplay::Status { queued, traced, .. } = client.next().await.0 else {
        panic!("no status");
    };
    assert_eq!(queued, 0);
    assert!(traced < 10_000, "{traced} samples were traced after all");
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn more_requests_than_credits_are_a_fault() {
    let server = TestServer::start(1, 100).await;
    let mut client = Client::connect(&server, &floor_and_lid(), 5).await;
    assert_eq!(client.session.free_credits(), 100);
    client.send(view(1)).await;
    let (samples, _) = client.ask(1, requests(0..100)).await;
    assert_eq!(samples.len(), 100);
    client
        .send(ToServer::Request {
            view: 1,
            samples: requests(100..201),
        })
        .await;
    let fault = loop {
        if let DisplayEvent::Fault(violation) = client.next().await.1 {
            break violation;
        }
    };
    assert_eq!(fault.code, FaultCode::Limit);
    assert!(
        client.receiver.receive().await.unwrap().is_none(),
        "the server closes"
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn broken_peers_do_not_disturb_others() {
    let server = TestServer::start(2, 1 << 16).await;
    let mut good = Client::connect(&server, &floor_and_lid(), 5).await;
    assert!(!good.scene_was_held);
    good.send(view(1)).await;

    // Bytes that are no message, and half a frame.
    let garbage: [&[u8]; 3] = [
        &[255; 64],
        &[8, 0, 0, 0, 99, 0, 0, 0, 1, 2, 3, 4],
        &[100, 0, 0],
    ];
    for bytes in garbage {
        let mut raw = TcpStream::connect(server.address).await.unwrap();
        raw.write_all(bytes).await.unwrap();
    }
    // A request before any scene is told what is wrong.
    let (mut receiver, mut sender) =
        display_side(TcpStream::connect(server.address).await.unwrap());
    sender.send(&hello("hasty", 0)).await.unwrap();
    sender.send(&view(1)).await.unwrap();
    let mut last = None;
    while let Ok(Some(message)) = receiver.receive().await {
        last = Some(message);
    }
    assert!(
        matches!(
            last,
            Some(ToDisplay::Fault {
                code: FaultCode::OutOfOrder,
                ..
            })
        ),
        "{last:?}"
    );

    // One that asks for much and never reads.
    let mut silent = Client::connect(&server, &floor_and_lid(), 5).await;
    assert!(silent.scene_was_held);
    silent.send(view(1)).await;
    silent
        .send(ToServer::Request {
            view: 1,
            samples: requests(0..30_000),
        })
        .await;

    let asked = timeout(Duration::from_secs(20), good.ask(1, requests(0..4096))).await;
    assert_eq!(asked.expect("others are served").0.len(), 4096);
    // And when it reads at last, everything is there.
    let (late, _) = silent.gather().await;
    assert_eq!(late.len(), 30_000);
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn two_displays_have_epochs_of_their_own() {
    let server = TestServer::start(2, 1 << 16).await;
    let mut first = Client::connect(&server, &floor_and_lid(), 1).await;
    let mut second = Client::connect(&server, &floor_and_lid(), 1).await;
    assert!(second.scene_was_held);
    first.send(view(1)).await;
    second.send(view(1)).await;
    let lift = ObjectMove {
        object: 1,
        transform: moved(0., 50., 0.),
    };
    first
        .send(ToServer::Edit {
            epoch: 1,
            objects: vec![lift],
            lights: vec![],
        })
        .await;
    let (moved, _) = first.ask(1, requests(0..4096)).await;
    let (still, _) = second.ask(1, requests(0..4096)).await;
    assert!(
        moved
            .values()
            .all(|(epoch, s)| *epoch == 1 && s.object != 1)
    );
    assert!(
        still
            .values()
            .any(|(epoch, s)| *epoch == 0 && s.object == 1)
    );
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn pings_are_answered_while_a_scene_is_built() {
    let server = TestServer::start(1, 1 << 16).await;
    let ball = object("ball", 0, moved(0., 0., 0.));
    let large = scene(vec![], vec![sphere(300, 300)], vec![ball]);
    let mut client = Client::begin(&server, &large, 1, &[]).await;
    client.send(ToServer::Ping { token: 4 }).await;
    let (_, event) = client.next().await;
    assert_eq!(event, DisplayEvent::Pong { token: 4 });
    assert_eq!(client.next().await.1, DisplayEvent::Ready);
    server.stop().await;
}

/// A lid over a floor, under an area light and a linear one.
fn two_lights() -> common::Scene {
    let area = Light::Area {
        vertices: vec![[-1., 3., -1.], [1., 3., -1.], [1., 3., 1.], [-1., 3., 1.]],
        radiance: [3.; 3],
    };
    let line = Light::Linear {
        from: [-1., 2.5, 0.5],
        to: [1., 2.5, 0.5],
        intensity: [4.; 3],
    };
    common::Scene {
        lights: vec![area, line],
        ..floor_and_lid()
    }
}

/// Brightness of all samples by id, asked for in portions of this size, and the triples.
async fn brightness(
    method: ShadowMethod,
    threads: usize,
    portion: usize,
) -> (Vec<(u64, f32)>, Vec<Triple>) {
    let server = TestServer::start(threads, 1 << 16).await;
    let mut client = Client::begin(&server, &two_lights(), 7, &[method; 2]).await;
    assert_eq!(client.next().await.1, DisplayEvent::Ready);
    let (told, _) = client.next().await;
    let ToDisplay::Shadows { lights } = told else {
        panic!("{told:?} in place of the methods")
    };
    let methods: Vec<ShadowMethod> = lights.iter().map(|light| light.method).collect();
    assert_eq!(methods, [method; 2], "{lights:?}");
    client.send(view(1)).await;
    let (mut all, mut triples) = (vec![], vec![]);
    for part in requests(0..4096).chunks(portion).rev() {
        let (samples, more) = client.ask(1, part.to_vec()).await;
        all.extend(samples.into_iter().map(|(id, (_, s))| (id, s.radiance[0])));
        triples.extend(more.into_iter().map(|(_, triple)| triple));
    }
    all.sort_unstable_by_key(|(id, _)| *id);
    triples.sort_unstable();
    server.stop().await;
    (all, triples)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_method_gives_the_same_picture_whatever_the_portions() {
    let (rays, shadows) = brightness(ShadowMethod::Rays, 1, 4096).await;
    assert_eq!(shadows.len(), 2);
    for (method, most_mean, most_rms) in [
        (ShadowMethod::Penumbra, 0.002, 0.01),
        // A square is taken for its four edges.
        (ShadowMethod::SoftMap, 0.05, 0.1),
    ] {
        let (whole, met) = brightness(method, 1, 4096).await;
        let (parts, met_too) = brightness(method, 2, 100).await;
        assert!(whole == parts, "{method:?} depends on portions or threads");
        assert_eq!(met, met_too, "{method:?}");
        // Maps may take a surface for its own blocker at its border.
        let found = |triple: &Triple| met.contains(triple);
        assert!(
            shadows.iter().all(found) && met.len() <= shadows.len() + 2,
            "{met:?}"
        );
        assert!(method == ShadowMethod::SoftMap || met == shadows, "{met:?}");
        let bright = rays.iter().map(|(_, v)| v).sum::<f32>() / rays.len() as f32;
        let off: Vec<f32> = rays.iter().zip(&whole).map(|(a, b)| b.1 - a.1).collect();
        let mean = off.iter().sum::<f32>() / off.len() as f32 / bright;
        let rms = (off.iter().map(|d| d * d).sum::<f32>() / off.len() as f32).sqrt() / bright;
        assert!(mean.abs() < most_mean, "{method:?}: mean off by {mean}");
        assert!(rms > 0. && rms < most_rms, "{method:?}: {rms} rms");
    }
}
