//! The display's account of a connection.

use std::collections::HashMap;

use super::Violation;
use crate::handshake::accept_version;
use crate::limits::MAX_UNASKED;
use crate::messages::{
    Capabilities, Digest, FaultCode, LightShadows, SHADOWS_VERSION, Sample, SampleRequest,
    TEXTURED_VERSION, TexturedSample, ToDisplay, Triple, flags,
};
use crate::scene::Scene;

/// How many lights, objects and faces samples and triples may name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SceneSize {
    /// Lights in the scene.
    pub lights: usize,
    /// Objects in the scene.
    pub objects: usize,
    /// Faces of the mesh that has most.
    pub faces: usize,
}

impl From<&Scene> for SceneSize {
    fn from(scene: &Scene) -> Self {
        Self {
            lights: scene.lights.len(),
            objects: scene.objects.len(),
            faces: scene
                .meshes
                .iter()
                .map(|m| m.faces.len())
                .max()
                .unwrap_or(0),
        }
    }
}

/// What a message from a server means.
#[derive(Clone, Debug, PartialEq)]
pub enum DisplayEvent {
    /// The server is there: [`DisplaySession::announce`] the scene.
    Welcome,
    /// Views and requests may be sent from now on.
    Ready,
    /// The message's samples, each of which had been asked for, are good.
    Samples,
    /// The message's triples are good.
    Triples,
    /// The message's lights are the scene's.
    Shadows,
    /// These requests were dropped by the server, as asked.
    Status {
        /// Ids of the requests whose credit came back, in no order.
        released: Vec<u64>,
    },
    /// The token's answer.
    Pong {
        /// The ping's.
        token: u64,
    },
    /// The server closes, and why.
    Fault(Violation),
}

/// A request that a server holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outstanding {
    /// The view that it was asked of.
    pub view: u32,
    /// The request.
    pub request: SampleRequest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Greeting,
    Scene,
    Ready,
}

/// The display's account of one connection. What is to be sent is told to it first.
#[derive(Debug)]
pub struct DisplaySession {
    phase: Phase,
    version: u16,
    digest: Option<Digest>,
    holds: Vec<Digest>,
    size: SceneSize,
    capabilities: Option<Capabilities>,
    name: String,
    epoch: u32,
    cancel_sent: u32,
    cancelled: u32,
    outstanding: HashMap<u64, Outstanding>,
    taken: Vec<Outstanding>,
    tokens: Vec<u64>,
    unasked: usize,
}

impl DisplaySession {
    /// A connection on which `Hello` is being sent, to work on a scene of this size.
    pub fn new(size: SceneSize) -> Self {
        Self {
            phase: Phase::Greeting,
            version: 0,
            digest: None,
            holds: Vec::new(),
            size,
            capabilities: None,
            name: String::new(),
            epoch: 0,
            cancel_sent: 0,
            cancelled: 0,
            outstanding: HashMap::new(),
            taken: Vec::new(),
            tokens: Vec::new(),
            unasked: 0,
        }
    }

    /// What the server offered, once it said so.
    pub fn capabilities(&self) -> Option<&Capabilities> {
        self.capabilities.as_ref()
    }

    /// The server's name, once it said it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether views and requests may be sent.
    pub fn is_ready(&self) -> bool {
        self.phase == Phase::Ready
    }

    /// Whether the server knows [`crate::ToServer::Shadows`].
    pub fn takes_shadows(&self) -> bool {
        self.version >= SHADOWS_VERSION
    }

    /// Requests that the server holds.
    pub fn outstanding(&self) -> usize {
        self.outstanding.len()
    }

    /// Requests that may be sent now: what is left of the server's credit. Zero before [`DisplayEvent::Ready`].
    pub fn free_credits(&self) -> usize {
        let credits = self.capabilities.as_ref().map_or(0, |c| c.credits as usize);
        if self.is_ready() {
            credits.saturating_sub(self.outstanding.len())
        } else {
            0
        }
    }

    /// Notes a `SceneBegin` that is about to be sent, after [`DisplayEvent::Welcome`]. True if the server holds the
    /// scene, so that no chunk is to follow.
    pub fn announce(&mut self, digest: Digest) -> bool {
        self.digest = Some(digest);
        self.holds.contains(&digest)
    }

    /// Notes requests that are about to be sent; no more than [`Self::free_credits`], and each id new.
    pub fn requested(&mut self, view: u32, requests: &[SampleRequest]) {
        for &request in requests {
            self.outstanding
                .insert(request.id, Outstanding { view, request });
        }
    }

    /// Notes an `Edit` that is about to be sent.
    pub fn edited(&mut self, epoch: u32) {
        self.epoch = epoch;
    }

    /// Notes a `Cancel` that is about to be sent.
    pub fn cancelling(&mut self, views_before: u32) {
        self.cancel_sent = self.cancel_sent.max(views_before);
    }

    /// Notes a `Ping` that is about to be sent.
    pub fn pinged(&mut self, token: u64) {
        self.tokens.push(token);
    }

    /// Whether a ping has no answer yet.
    pub fn awaits_pong(&self) -> bool {
        !self.tokens.is_empty()
    }

    /// The requests that the server holds, in no order.
    pub fn held(&self) -> impl Iterator<Item = &Outstanding> {
        self.outstanding.values()
    }

    /// Takes out all requests that the server holds, in the order of their ids, to hand them to another server.
    pub fn take_outstanding(&mut self) -> Vec<Outstanding> {
        let mut all: Vec<_> = self.outstanding.drain().map(|(_, held)| held).collect();
        all.sort_unstable_by_key(|held| held.request.id);
        all
    }

    /// Says what a message means. Its values must have been checked by [`crate::validate::validate_to_display`].
    ///
    /// # Errors
    /// The rule that the server broke; the message is then to be dropped as a whole, and its requests are still
    /// outstanding.
    pub fn receive(&mut self, message: &ToDisplay) -> Result<DisplayEvent, Violation> {
        if let ToDisplay::Fault { code, text } = message {
            return Ok(DisplayEvent::Fault(Violation::new(*code, text.clone())));
        }
        if let ToDisplay::Welcome {
            version,
            name,
            capabilities,
            holds,
            ..
        } = message
        {
            self.expect(Phase::Greeting, "Welcome")?;
            accept_version(*version)?;
            self.version = *version;
            self.phase = Phase::Scene;
            self.name.clone_from(name);
            self.capabilities = Some(capabilities.clone());
            self.holds.clone_from(holds);
            return Ok(DisplayEvent::Welcome);
        }
        if self.phase == Phase::Greeting {
            return Err(out_of_order("the first message is not Welcome"));
        }
        self.count_unasked(message)?;
        match message {
            ToDisplay::SceneReady { digest } => {
                self.expect(Phase::Scene, "SceneReady")?;
                if Some(*digest) != self.digest {
                    return Err(value("SceneReady names another scene"));
                }
                self.phase = Phase::Ready;
                Ok(DisplayEvent::Ready)
            }
            ToDisplay::Samples {
                view,
                epoch,
                samples,
            } => {
                self.check_epoch(*epoch)?;
                self.take_samples(*view, samples.iter())?;
                Ok(DisplayEvent::Samples)
            }
            ToDisplay::Textured {
                view,
                epoch,
                samples,
            } => {
                if self.version < TEXTURED_VERSION {
                    return Err(out_of_order(format!(
                        "version {} has no Textured",
                        self.version
                    )));
                }
                self.check_epoch(*epoch)?;
                for textured in samples {
                    self.check_face(textured)?;
                }
                self.take_samples(*view, samples.iter().map(|t| &t.sample))?;
                Ok(DisplayEvent::Samples)
            }
            ToDisplay::Triples { epoch, triples } => {
                self.expect(Phase::Ready, "Triples")?;
                self.check_epoch(*epoch)?;
                triples
                    .iter()
                    .try_for_each(|triple| self.check_triple(triple))?;
                Ok(DisplayEvent::Triples)
            }
            ToDisplay::Shadows { lights } => {
                self.check_shadows(lights)?;
                Ok(DisplayEvent::Shadows)
            }
            ToDisplay::Status {
                cancelled_before, ..
            } => self.status(*cancelled_before),
            ToDisplay::Pong { token } => {
                let place = self.tokens.iter().position(|t| t == token);
                let place = place.ok_or_else(|| value("Pong answers no Ping"))?;
                self.tokens.swap_remove(place);
                self.unasked = 0;
                Ok(DisplayEvent::Pong { token: *token })
            }
            ToDisplay::Welcome { .. } | ToDisplay::Fault { .. } => {
                Err(out_of_order("a message came twice"))
            }
        }
    }

    fn expect(&self, phase: Phase, what: &str) -> Result<(), Violation> {
        if self.phase == phase {
            Ok(())
        } else {
            Err(out_of_order(format!("{what} has no place here")))
        }
    }

    /// A server that talks without end would cost the display its time, although each message is good.
    fn count_unasked(&mut self, message: &ToDisplay) -> Result<(), Violation> {
        let items = match message {
            ToDisplay::Status { .. } => 0,
            ToDisplay::Triples { triples, .. } => triples.len(),
            ToDisplay::Shadows { lights } => lights.len(),
            _ => return Ok(()),
        };
        self.unasked += 1 + items / 256;
        if self.unasked > MAX_UNASKED {
            let text = format!("more than {MAX_UNASKED} messages answer nothing");
            return Err(Violation::new(FaultCode::Limit, text));
        }
        Ok(())
    }

    fn check_epoch(&self, epoch: u32) -> Result<(), Violation> {
        if epoch > self.epoch {
            return Err(value(format!(
                "epoch {epoch} is yet to come, now is {}",
                self.epoch
            )));
        }
        Ok(())
    }

    fn take_samples<'a>(
        &mut self,
        view: u32,
        samples: impl Iterator<Item = &'a Sample>,
    ) -> Result<(), Violation> {
        self.taken.clear();
        for sample in samples {
            let checked =
                self.check_object(sample)
                    .and_then(|()| match self.outstanding.get(&sample.id) {
                        Some(held) if held.view == view => Ok(()),
                        Some(held) => Err(value(format!(
                            "sample {} was asked for view {}, not {view}",
                            sample.id, held.view
                        ))),
                        None => Err(out_of_order(format!(
                            "sample {} is not outstanding",
                            sample.id
                        ))),
                    });
            if let Err(violation) = checked {
                let taken = self.taken.drain(..);
                self.outstanding
                    .extend(taken.map(|held| (held.request.id, held)));
                return Err(violation);
            }
            self.taken.extend(self.outstanding.remove(&sample.id));
        }
        self.unasked = self.unasked.saturating_sub(self.taken.len());
        Ok(())
    }

    fn check_face(&self, textured: &TexturedSample) -> Result<(), Violation> {
        if textured.texel.face as usize >= self.size.faces {
            return Err(value(format!(
                "sample {} hits face {}",
                textured.sample.id, textured.texel.face
            )));
        }
        Ok(())
    }

    fn check_object(&self, sample: &Sample) -> Result<(), Violation> {
        let (len, what) = match sample.flags & (flags::MISS | flags::LIGHT) {
            0 => (self.size.objects, "object"),
            flags::LIGHT => (self.size.lights, "light"),
            _ => return Ok(()),
        };
        if sample.object as usize >= len {
            return Err(value(format!(
                "sample {} hits {what} {}",
                sample.id, sample.object
            )));
        }
        Ok(())
    }

    fn check_shadows(&self, lights: &[LightShadows]) -> Result<(), Violation> {
        if !self.takes_shadows() {
            let text = format!("version {} has no Shadows", self.version);
            return Err(out_of_order(text));
        }
        self.expect(Phase::Ready, "Shadows")?;
        match lights.iter().find(|l| l.light as usize >= self.size.lights) {
            Some(past) => Err(value(format!(
                "light {} is past the scene's table",
                past.light
            ))),
            None => Ok(()),
        }
    }

    fn check_triple(&self, triple: &Triple) -> Result<(), Violation> {
        let known = (triple.light as usize) < self.size.lights
            && (triple.blocker as usize) < self.size.objects
            && (triple.receiver as usize) < self.size.objects;
        if known {
            Ok(())
        } else {
            Err(value(format!("{triple:?} is past the scene's tables")))
        }
    }

    fn status(&mut self, cancelled_before: u32) -> Result<DisplayEvent, Violation> {
        if cancelled_before > self.cancel_sent || cancelled_before < self.cancelled {
            return Err(value(format!(
                "Status cancels before view {cancelled_before}, unasked"
            )));
        }
        let mut released = Vec::new();
        if cancelled_before > self.cancelled {
            self.cancelled = cancelled_before;
            self.outstanding.retain(|&id, held| {
                let kept = held.view >= cancelled_before;
                if !kept {
                    released.push(id);
                }
                kept
            });
        }
        Ok(DisplayEvent::Status { released })
    }
}

fn value(text: impl Into<String>) -> Violation {
    Violation::new(FaultCode::Value, text)
}

fn out_of_order(text: impl Into<String>) -> Violation {
    Violation::new(FaultCode::OutOfOrder, text)
}
