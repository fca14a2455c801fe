//! Cameras and their numbers.

use crate::limits::MAX_VIEWS;
use crate::messages::FaultCode::{OutOfOrder, Value};
use crate::messages::{Camera, ToServer};

use super::check::{At, Check, refused};
use super::judge::{judge, right};
use super::peer::Peer;
use super::world::{camera, spread};
use super::{Bench, Checked};

const VIEWS: &str = "2, Views";
const VIEW: &str = "3, View";

pub(super) fn checks() -> Vec<Check> {
    let bad = |name, change: fn(&mut Camera)| {
        refused(name, VIEW, At::Ready, &[Value], move |peer| {
            let mut camera = camera();
            change(&mut camera);
            peer.send(&ToServer::View { view: 2, camera });
        })
    };
    vec![
        Check::new("views.256-back", VIEWS, far_back),
        Check::new("views.numbers-jump", VIEWS, jumps),
        refused("views.257-back", VIEWS, At::Ready, &[OutOfOrder], |peer| {
            for view in 2..=MAX_VIEWS as u32 + 1 {
                peer.view(view, camera());
            }
            peer.ask(1, &spread(&camera(), 0..1));
        }),
        refused(
            "views.number-again",
            VIEWS,
            At::Ready,
            &[OutOfOrder],
            |peer| {
                peer.view(1, camera());
            },
        ),
        refused(
            "views.number-smaller",
            VIEWS,
            At::Ready,
            &[OutOfOrder],
            |peer| {
                peer.view(7, camera());
                peer.view(6, camera());
            },
        ),
        refused("views.unknown", VIEWS, At::Ready, &[OutOfOrder], |peer| {
            peer.ask(2, &spread(&camera(), 0..1));
        }),
        bad("views.eye-nan", |c| c.eye[1] = f32::NAN),
        bad("views.eye-1e30", |c| c.eye[1] = 1e30),
        bad("views.no-line-of-sight", |c| c.target = c.eye),
        bad("views.up-along-sight", |c| {
            c.up = [-3.0, -3.5, -6.0];
        }),
        bad("views.up-zero", |c| c.up = [0.0; 3]),
        bad("views.fov-180", |c| c.fov_y = 180.0),
        bad("views.fov-0", |c| c.fov_y = 0.0),
        bad("views.width-0", |c| c.width = 0),
        bad("views.height-16385", |c| c.height = 16_385),
    ]
}

/// The oldest of the last 256 views can still be asked for, and is the one that it was.
fn far_back(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut peer = Peer::ready(bench, world)?;
    let mut moved = camera();
    for view in 2..=MAX_VIEWS as u32 {
        moved.eye[0] = 3.0 - view as f32 / 100.0;
        peer.view(view, moved);
    }
    peer.ask(1, &spread(&camera(), 0..60));
    peer.ask(MAX_VIEWS as u32 / 2, &spread(&camera(), 60..120));
    judge(&world.scene, &peer.answers(120)?, right)
}

fn jumps(bench: &Bench) -> Checked {
    let world = &bench.worlds.lit;
    let mut peer = Peer::ready(bench, world)?;
    for view in [5, 1000, u32::MAX] {
        peer.view(view, camera());
    }
    peer.ask(u32::MAX, &spread(&camera(), 0..20));
    peer.ask(5, &spread(&camera(), 20..40));
    judge(&world.scene, &peer.answers(40)?, right)
}
