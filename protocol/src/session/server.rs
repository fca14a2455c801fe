//! A shader server's account of a connection.

use std::collections::{HashMap, VecDeque};

use super::Violation;
use crate::handshake::choose_version;
use crate::limits::MAX_VIEWS;
use crate::messages::{
    Camera, Capabilities, Digest, FaultCode, LightMove, ObjectMove, SHADOWS_VERSION, SampleRequest,
    ShadowMethod, ToServer,
};
use crate::scene::{Light, Scene};
use crate::transfer::Assembler;

/// What a message from a display means.
#[derive(Debug)]
pub enum ServerEvent {
    /// Answer with `Welcome`.
    Hello {
        /// The version to answer with.
        version: u16,
        /// The display's name.
        name: String,
        /// Seed of the random numbers.
        seed: u64,
    },
    /// The display wants a scene that this server holds: build it, call [`ServerSession::scene_built`] and answer with
    /// `SceneReady`.
    Held(Digest),
    /// All bytes of a scene are there: finish and build it, call [`ServerSession::scene_built`], answer with
    /// `SceneReady`.
    Scene(Digest, Assembler),
    /// How the visibility of lights is wanted, in the scene that comes next.
    Shadows {
        /// Whether samples are to be the same on every machine and in every run.
        steady: bool,
        /// Error that may be made.
        error: f32,
        /// By index of the light; there may be fewer than lights, or more.
        methods: Vec<ShadowMethod>,
    },
    /// Nothing to do yet.
    More,
    /// A new view.
    View {
        /// Its number.
        view: u32,
        /// Its camera.
        camera: Camera,
    },
    /// Samples to be traced. Each is held until [`ServerSession::release`].
    Request {
        /// The view's number.
        view: u32,
        /// Its camera.
        camera: Camera,
        /// The samples, most wanted first.
        samples: Vec<SampleRequest>,
    },
    /// Things moved; every index and kind was checked.
    Edit {
        /// The new epoch.
        epoch: u32,
        /// Objects that moved.
        objects: Vec<ObjectMove>,
        /// Lights that changed.
        lights: Vec<LightMove>,
    },
    /// Requests of views before this one are no longer held: answer with `Status`.
    Cancel {
        /// First view that is kept.
        views_before: u32,
    },
    /// Answer with `Pong`.
    Ping {
        /// The token to return.
        token: u64,
    },
    /// The display is done, or says which rule this server broke.
    Goodbye(Option<Violation>),
}

#[derive(Debug)]
enum Phase {
    Greeting,
    Scene,
    Receiving(Assembler),
    Building,
    Ready,
}

/// A server's account of one connection.
#[derive(Debug)]
pub struct ServerSession {
    phase: Phase,
    version: u16,
    shadows_told: bool,
    offer: Capabilities,
    holds: Vec<Digest>,
    scene_limit: u64,
    digest: Digest,
    objects: usize,
    lights: Vec<u8>,
    epoch: u32,
    cancelled: u32,
    views: VecDeque<(u32, Camera)>,
    newest_view: Option<u32>,
    held: HashMap<u64, u32>,
}

impl ServerSession {
    /// A fresh connection of a server that offers this, holds these scenes and takes scenes up to `scene_limit` bytes.
    pub fn new(offer: Capabilities, holds: Vec<Digest>, scene_limit: u64) -> Self {
        Self {
            phase: Phase::Greeting,
            version: 0,
            shadows_told: false,
            offer,
            holds,
            scene_limit,
            digest: [0; 32],
            objects: 0,
            lights: Vec::new(),
            epoch: 0,
            cancelled: 0,
            views: VecDeque::new(),
            newest_view: None,
            held: HashMap::new(),
        }
    }

    /// Requests held.
    pub fn held(&self) -> usize {
        self.held.len()
    }

    /// The scene's state after the last `Edit`.
    pub fn epoch(&self) -> u32 {
        self.epoch
    }

    /// No sample of a view before this one may be sent.
    pub fn cancelled_before(&self) -> u32 {
        self.cancelled
    }

    /// Gives back the credit of a request whose sample is about to be sent. False if it was cancelled: the sample must
    /// then be dropped.
    pub fn release(&mut self, id: u64) -> bool {
        self.held.remove(&id).is_some()
    }

    /// The scene is built; requests may come once `SceneReady` is sent.
    pub fn scene_built(&mut self, scene: &Scene) {
        self.phase = Phase::Ready;
        self.objects = scene.objects.len();
        self.lights = scene.lights.iter().map(kind).collect();
    }

    /// Says what a message means. Its values must have been checked by [`crate::validate::validate_to_server`].
    ///
    /// # Errors
    /// The rule that the display broke.
    pub fn receive(&mut self, message: ToServer) -> Result<ServerEvent, Violation> {
        match message {
            ToServer::Goodbye => return Ok(ServerEvent::Goodbye(None)),
            ToServer::Fault { code, text } => {
                return Ok(ServerEvent::Goodbye(Some(Violation { code, text })));
            }
            ToServer::Hello {
                min_version,
                max_version,
                name,
                seed,
            } => {
                if !matches!(self.phase, Phase::Greeting) {
                    return Err(out_of_order("Hello came twice"));
                }
                let version = choose_version(min_version, max_version)?;
                self.phase = Phase::Scene;
                self.version = version;
                return Ok(ServerEvent::Hello {
                    version,
                    name,
                    seed,
                });
            }
            _ if matches!(self.phase, Phase::Greeting) => {
                return Err(out_of_order("the first message is not Hello"));
            }
            ToServer::Ping { token } => return Ok(ServerEvent::Ping { token }),
            ToServer::Shadows {
                steady,
                error,
                methods,
            } => return self.shadows(steady, error, methods),
            ToServer::SceneBegin { digest, bytes } => return self.begin(digest, bytes),
            ToServer::SceneChunk { data } => return self.chunk(&data),
            _ => {}
        }
        if !matches!(self.phase, Phase::Ready) {
            return Err(out_of_order(
                "views, requests and edits come after SceneReady",
            ));
        }
        match message {
            ToServer::View { view, camera } => self.view(view, camera),
            ToServer::Request { view, samples } => self.request(view, samples),
            ToServer::Edit {
                epoch,
                objects,
                lights,
            } => self.edit(epoch, objects, lights),
            ToServer::Cancel { views_before } => Ok(self.cancel(views_before)),
            _ => Err(out_of_order("a message has no place here")),
        }
    }

    fn shadows(
        &mut self,
        steady: bool,
        error: f32,
        methods: Vec<ShadowMethod>,
    ) -> Result<ServerEvent, Violation> {
        if self.version < SHADOWS_VERSION {
            let text = format!("version {} has no Shadows", self.version);
            return Err(out_of_order(text));
        }
        if !matches!(self.phase, Phase::Scene) || self.shadows_told {
            return Err(out_of_order("Shadows comes once, before SceneBegin"));
        }
        self.shadows_told = true;
        Ok(ServerEvent::Shadows {
            steady,
            error,
            methods,
        })
    }

    fn begin(&mut self, digest: Digest, bytes: u64) -> Result<ServerEvent, Violation> {
        if !matches!(self.phase, Phase::Scene) {
            return Err(out_of_order("SceneBegin has no place here"));
        }
        self.digest = digest;
        if self.holds.contains(&digest) {
            self.phase = Phase::Building;
            return Ok(ServerEvent::Held(digest));
        }
        let assembler =
            Assembler::new(digest, bytes, self.scene_limit).map_err(|e| Violation::from(&e))?;
        self.phase = Phase::Receiving(assembler);
        Ok(ServerEvent::More)
    }

    fn chunk(&mut self, data: &[u8]) -> Result<ServerEvent, Violation> {
        let Phase::Receiving(assembler) = &mut self.phase else {
            return Err(out_of_order("SceneChunk has no place here"));
        };
        if !assembler.add(data).map_err(|e| Violation::from(&e))? {
            return Ok(ServerEvent::More);
        }
        match std::mem::replace(&mut self.phase, Phase::Building) {
            Phase::Receiving(assembler) => Ok(ServerEvent::Scene(self.digest, assembler)),
            _ => Ok(ServerEvent::More),
        }
    }

    fn view(&mut self, view: u32, camera: Camera) -> Result<ServerEvent, Violation> {
        if self.newest_view.is_some_and(|newest| view <= newest) {
            return Err(out_of_order(format!(
                "view {view} is not newer than the last"
            )));
        }
        self.newest_view = Some(view);
        if self.views.len() == MAX_VIEWS {
            self.views.pop_front();
        }
        self.views.push_back((view, camera));
        Ok(ServerEvent::View { view, camera })
    }

    fn request(
        &mut self,
        view: u32,
        samples: Vec<SampleRequest>,
    ) -> Result<ServerEvent, Violation> {
        if view < self.cancelled {
            return Err(out_of_order(format!("view {view} is cancelled")));
        }
        let found = self
            .views
            .binary_search_by_key(&view, |(number, _)| *number);
        let place = found.map_err(|_| out_of_order(format!("view {view} is not known")))?;
        let camera = self.views[place].1;
        if samples.len() > self.offer.max_batch as usize
            || self.held.len() + samples.len() > self.offer.credits as usize
        {
            return Err(Violation::new(
                FaultCode::Limit,
                format!(
                    "{} requests on top of {}: at most {} in a message and {} in all",
                    samples.len(),
                    self.held.len(),
                    self.offer.max_batch,
                    self.offer.credits
                ),
            ));
        }
        for request in &samples {
            if u32::from(request.x) >= camera.width || u32::from(request.y) >= camera.height {
                return Err(value(format!(
                    "request {} is outside the image",
                    request.id
                )));
            }
            if self.held.insert(request.id, view).is_some() {
                return Err(value(format!("request {} came twice", request.id)));
            }
        }
        Ok(ServerEvent::Request {
            view,
            camera,
            samples,
        })
    }

    fn edit(
        &mut self,
        epoch: u32,
        objects: Vec<ObjectMove>,
        lights: Vec<LightMove>,
    ) -> Result<ServerEvent, Violation> {
        if !self.offer.edits {
            return Err(Violation::new(
                FaultCode::Unsupported,
                "this server takes no edits",
            ));
        }
        if Some(epoch) != self.epoch.checked_add(1) {
            return Err(out_of_order(format!(
                "epoch {epoch} does not follow {}",
                self.epoch
            )));
        }
        if let Some(moved) = objects.iter().find(|m| m.object as usize >= self.objects) {
            return Err(value(format!(
                "object {} is past the scene's table",
                moved.object
            )));
        }
        for moved in &lights {
            if self.lights.get(moved.light as usize) != Some(&kind(&moved.value)) {
                return Err(value(format!("light {} is not of this kind", moved.light)));
            }
        }
        self.epoch = epoch;
        Ok(ServerEvent::Edit {
            epoch,
            objects,
            lights,
        })
    }

    fn cancel(&mut self, views_before: u32) -> ServerEvent {
        self.cancelled = self.cancelled.max(views_before);
        let before = self.cancelled;
        self.held.retain(|_, view| *view >= before);
        ServerEvent::Cancel {
            views_before: before,
        }
    }
}

fn kind(light: &Light) -> u8 {
    match light {
        Light::Point { .. } => 0,
        Light::Linear { .. } => 1,
        Light::Area { .. } => 2,
    }
}

fn value(text: impl Into<String>) -> Violation {
    Violation::new(FaultCode::Value, text)
}

fn out_of_order(text: impl Into<String>) -> Violation {
    Violation::new(FaultCode::OutOfOrder, text)
}
