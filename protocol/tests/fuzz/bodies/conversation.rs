//! Two sides that keep to the rules, with messages on their way between them.

use std::collections::VecDeque;

use protocol::session::{DisplayEvent, DisplaySession, SceneSize, ServerEvent, ServerSession};
use protocol::validate::{validate_to_display, validate_to_server};
use protocol::{ToDisplay, ToServer};

use super::source::Source;
use super::world;

struct Both {
    display: DisplaySession,
    server: ServerSession,
    to_server: VecDeque<ToServer>,
    to_display: VecDeque<ToDisplay>,
    /// What the server has yet to trace: id and view.
    queue: Vec<(u64, u32)>,
    view: u32,
    next_id: u64,
    /// The display's count; the server's comes with its account.
    epoch: u32,
    token: u64,
    cancel_before: u32,
}

/// Whatever is said, and however long it is on its way, neither side finds that the other broke a rule, and in the end
/// everything that was asked is answered or cancelled.
pub(super) fn conversation(data: &[u8]) {
    let mut source = Source::new(data);
    let mut both = begin(&mut source);
    while !source.is_empty() {
        match source.below(8) {
            0..=2 => both.say(&mut source),
            3 | 4 => both.hear_in_server(),
            5 | 6 => both.hear_in_display(),
            _ => both.trace(&mut source),
        }
    }
    while !both.to_server.is_empty() || !both.to_display.is_empty() || !both.queue.is_empty() {
        both.hear_in_server();
        both.trace(&mut source);
        both.hear_in_display();
    }
    assert_eq!((both.display.outstanding(), both.server.held()), (0, 0));
    assert!(!both.display.awaits_pong());
}

fn begin(source: &mut Source) -> Both {
    let offer = world::offer(source);
    let encoded = world::encoded();
    let mut display = DisplaySession::new(SceneSize::from(&world::scene()));
    let mut server = ServerSession::new(offer.clone(), vec![], 1 << 20);
    let hello = protocol::handshake::hello("d", 1);
    let Ok(ServerEvent::Hello { version, .. }) = server.receive(hello) else {
        panic!("Hello is taken");
    };
    let welcome = ToDisplay::Welcome {
        version,
        name: String::new(),
        shader: String::new(),
        capabilities: offer,
        holds: vec![],
    };
    assert_eq!(display.receive(&welcome), Ok(DisplayEvent::Welcome));
    display.announce(encoded.digest());
    server.receive(encoded.begin()).expect("a scene is taken");
    for chunk in encoded.chunks() {
        server.receive(chunk).expect("its bytes are taken");
    }
    server.scene_built(&world::scene());
    let ready = ToDisplay::SceneReady {
        digest: encoded.digest(),
    };
    assert_eq!(display.receive(&ready), Ok(DisplayEvent::Ready));
    let mut both = Both {
        display,
        server,
        to_server: VecDeque::new(),
        to_display: VecDeque::new(),
        queue: Vec::new(),
        view: 0,
        next_id: 0,
        epoch: 0,
        token: 0,
        cancel_before: 0,
    };
    both.new_view();
    both
}

impl Both {
    fn new_view(&mut self) {
        self.view += 1;
        self.to_server.push_back(ToServer::View {
            view: self.view,
            camera: world::camera(),
        });
    }

    fn say(&mut self, source: &mut Source) {
        let Some(offer) = self.display.capabilities().cloned() else {
            return;
        };
        match source.below(8) {
            0..=3 => {
                let most = self.display.free_credits().min(offer.max_batch as usize);
                let back = source.below(3) as u32;
                let view = self
                    .view
                    .saturating_sub(back)
                    .max(self.cancel_before)
                    .max(1);
                if most == 0 || view > self.view {
                    return;
                }
                let samples: Vec<_> = (0..1 + source.below(most))
                    .map(|_| {
                        self.next_id += 1;
                        let mut request = world::request(&mut Source::new(&[]), self.next_id);
                        request.x = source.below(world::IMAGE as usize) as u16;
                        request
                    })
                    .collect();
                self.display.requested(view, &samples);
                self.to_server
                    .push_back(ToServer::Request { view, samples });
            }
            4 => self.new_view(),
            5 => {
                let before = self.view.saturating_sub(source.below(2) as u32);
                self.cancel_before = self.cancel_before.max(before);
                self.display.cancelling(self.cancel_before);
                self.to_server.push_back(ToServer::Cancel {
                    views_before: self.cancel_before,
                });
            }
            6 if offer.edits => {
                self.epoch += 1;
                self.display.edited(self.epoch);
                self.to_server.push_back(ToServer::Edit {
                    epoch: self.epoch,
                    objects: vec![],
                    lights: vec![],
                });
            }
            _ => {
                self.token += 1;
                self.display.pinged(self.token);
                self.to_server
                    .push_back(ToServer::Ping { token: self.token });
            }
        }
    }

    fn hear_in_server(&mut self) {
        let Some(message) = self.to_server.pop_front() else {
            return;
        };
        assert_eq!(validate_to_server(&message), Ok(()));
        match self
            .server
            .receive(message)
            .expect("the display keeps to the rules")
        {
            ServerEvent::Request { view, samples, .. } => {
                self.queue.extend(samples.iter().map(|s| (s.id, view)));
            }
            ServerEvent::Cancel { .. } => {
                let status = ToDisplay::Status {
                    queued: self.server.held() as u32,
                    traced: 0,
                    rays: 0,
                    cancelled_before: self.server.cancelled_before(),
                };
                self.to_display.push_back(status);
            }
            ServerEvent::Ping { token } => self.to_display.push_back(ToDisplay::Pong { token }),
            _ => {}
        }
    }

    /// Answers some request that is still held, whichever the input says.
    fn trace(&mut self, source: &mut Source) {
        if self.queue.is_empty() {
            return;
        }
        let (id, view) = self.queue.swap_remove(source.below(self.queue.len()));
        if self.server.release(id) {
            self.to_display.push_back(ToDisplay::Samples {
                view,
                epoch: self.server.epoch(),
                samples: vec![world::sample(&mut Source::new(&[]), id)],
            });
        }
    }

    fn hear_in_display(&mut self) {
        let Some(message) = self.to_display.pop_front() else {
            return;
        };
        assert_eq!(validate_to_display(&message), Ok(()));
        self.display
            .receive(&message)
            .expect("the server keeps to the rules");
    }
}
