//! The window's events.

use std::path::PathBuf;
use std::rc::Rc;
use std::time::{Duration, Instant};

use protocol::scene::Scene;
use winit::application::ApplicationHandler;
use winit::dpi::PhysicalSize;
use winit::event::{ElementState, KeyEvent, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow};
use winit::keyboard::ModifiersState;
use winit::window::{Window, WindowId};

use super::WindowError;
use super::controller::{Controller, Drag};
use super::hands::Hands;
use super::keys::{self, Command, HELP};
use super::overlay::Canvas;
use super::screenshot;
use super::session::Session;
use super::surface::Surface;
use crate::cli::WindowArgs;
use crate::explain::Explanation;
use crate::servers::ServersError;
use crate::show::Show;

/// Least time between frames: what screens show.
const SHORTEST: Duration = Duration::from_millis(16);
/// Most time between frames of a camera that stands, while samples come in.
const LONGEST: Duration = Duration::from_millis(100);
/// The display's share of a core while the camera stands: one part in so many.
const STANDING_SHARE: f64 = 3.0;
/// How often the servers' state is looked at while nothing happens.
const LOOK_AFTER: Duration = Duration::from_millis(500);
/// How long a message stays.
const MESSAGE_TIME: Duration = Duration::from_secs(4);
/// Pixels of a touchpad's scroll that count as a notch.
const NOTCH_PX: f64 = 40.0;

/// Sent by the link when samples have come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wake;

/// What is told about the servers, as far as a change of it wants a new frame.
type Told = (usize, u64, bool);

/// The window and all behind it.
pub(super) struct App {
    session: Session,
    controller: Controller,
    hands: Hands,
    title: String,
    size: (u32, u32),
    out: PathBuf,
    screen: Option<(Rc<Window>, Surface)>,
    failure: Option<WindowError>,
    show: Show,
    help: bool,
    message: Option<(String, Instant)>,
    modifiers: ModifiersState,
    pointer: Option<(f64, f64)>,
    frame_start: Option<Instant>,
    clock: Instant,
    dirty: bool,
    woken: bool,
    told: Told,
}

impl App {
    /// Everything but the window, which is opened when the event loop says so.
    pub(super) fn new(
        session: Session,
        controller: Controller,
        hands: Hands,
        title: String,
        args: &WindowArgs,
    ) -> Self {
        Self {
            session,
            controller,
            hands,
            title,
            size: args.size,
            out: args.out.clone(),
            screen: None,
            failure: None,
            show: Show::Picture,
            help: false,
            message: Some(("H: keys".into(), Instant::now() + MESSAGE_TIME)),
            modifiers: ModifiersState::empty(),
            pointer: None,
            frame_start: None,
            clock: Instant::now(),
            dirty: true,
            woken: false,
            told: (0, 0, false),
        }
    }

    /// Why the window had to be closed, if a person did not close it.
    pub(super) fn into_failure(self) -> Option<WindowError> {
        self.failure
    }

    /// Which models are chosen for the scene.
    pub(super) fn explain(&self, scene: &Scene) -> Explanation {
        self.session.explain(scene)
    }

    fn open(&self, event_loop: &ActiveEventLoop) -> Result<(Rc<Window>, Surface), WindowError> {
        let attributes = Window::default_attributes()
            .with_title(self.title.clone())
            .with_inner_size(PhysicalSize::new(self.size.0, self.size.1))
            .with_min_inner_size(PhysicalSize::new(16, 16));
        let window = event_loop
            .create_window(attributes)
            .map_err(|e| WindowError::NoDisplay(e.to_string()))?;
        let window = Rc::new(window);
        let surface = Surface::new(&window).map_err(|e| WindowError::NoDisplay(e.to_string()))?;
        Ok((window, surface))
    }

    fn redraw(&mut self, event_loop: &ActiveEventLoop) {
        let Some((window, surface)) = &mut self.screen else {
            return;
        };
        let size = window.inner_size();
        let most = protocol::limits::MAX_SIDE;
        let (width, height) = (size.width.min(most), size.height.min(most));
        if width == 0 || height == 0 {
            self.dirty = false;
            return;
        }
        let now = Instant::now();
        self.frame_start = Some(now);
        self.woken = false;
        let since = now - self.clock;
        let moved = self.controller.advance(since.as_secs_f32());
        self.clock = now;
        let camera = self.controller.camera(width, height);
        let next = self.controller.predicted(width, height);
        let pose = self.controller.pose();
        let reach = (pose.target - pose.eye).length();
        let (pointer, modifiers) = (self.pointer, self.modifiers);
        let seconds = since.as_secs_f32();
        let work = self
            .hands
            .work(&mut self.session, &camera, pointer, modifiers, seconds);
        let result = work.and(self.session.frame(&camera, next.as_ref(), reach, self.show));
        if let Err(e) = result {
            self.message = Some((e.to_string(), now + MESSAGE_TIME));
        }
        self.controller.drawn();
        // The frame after a motion shows that it has ended.
        self.dirty = moved;
        let mut items = self.session.status();
        if self.show != Show::Picture {
            items.push(format!("showing {}", self.show.name()));
        }
        items.extend(self.controller.playing().then(|| "playing".into()));
        items.extend(self.hands.status());
        items.extend(self.message.iter().map(|(text, _)| text.clone()));
        let shown = self.session.shown();
        let markers = if self.modifiers.shift_key() || self.hands.holding() {
            self.session.markers()
        } else {
            Vec::new()
        };
        let (help, scale) = (self.help, window.scale_factor());
        window.pre_present_notify();
        let presented = surface.present(width, height, |pixels| {
            let n = pixels.len().min(shown.len());
            pixels[..n].copy_from_slice(&shown[..n]);
            let mut canvas = Canvas::new(pixels, width as usize, height as usize, scale);
            markers.iter().for_each(|m| canvas.cross(*m));
            canvas.status(&items);
            if help {
                canvas.panel_in_the_middle(&HELP);
            }
        });
        if let Err(e) = presented {
            self.failure = Some(WindowError::Lost(e.to_string()));
            event_loop.exit();
        }
    }

    /// Looks at what changes without an event: the servers' state, a message's time.
    fn look_after(&mut self, now: Instant) {
        let status = self.session.servers();
        let busy = status.samples_per_second > 0.0;
        let told = (status.connected, status.faults, busy);
        if told != self.told {
            self.told = told;
            self.dirty = true;
        }
        if self
            .message
            .as_ref()
            .is_some_and(|(_, until)| *until <= now)
        {
            self.message = None;
            self.dirty = true;
        }
    }

    fn say(&mut self, text: impl Into<String>) {
        self.message = Some((text.into(), Instant::now() + MESSAGE_TIME));
    }

    fn key(&mut self, event: &KeyEvent, event_loop: &ActiveEventLoop) {
        self.dirty = true;
        let control = self.modifiers.control_key();
        let held = keys::held(event.physical_key);
        if event.state == ElementState::Released {
            if let Some(held) = held {
                self.controller.release(held);
            }
            return;
        }
        if event.repeat {
            return;
        }
        if let Some(held) = held.filter(|_| !control) {
            if !self.controller.moving() {
                self.clock = Instant::now();
            }
            self.controller.press(held);
        } else if let Some(command) = keys::command(event.physical_key, &event.logical_key, control)
        {
            self.obey(command, event_loop);
        }
    }

    fn obey(&mut self, command: Command, event_loop: &ActiveEventLoop) {
        match command {
            Command::Show(stage) => self.show = stage,
            Command::Freeze => self.session.toggle_freeze(),
            Command::Pause => self.session.toggle_pause(),
            Command::Clear => self.session.clear(),
            Command::Method => self.session.next_method(),
            Command::Shadows => self.session.next_shadow_edges(),
            Command::Baseline => self.session.toggle_baseline(),
            Command::Home => self.controller.go_home(),
            Command::Path => {
                self.clock = Instant::now();
                if !self.controller.toggle_path() {
                    self.say("the scene has no path");
                }
            }
            Command::Moves => {
                self.clock = Instant::now();
                let played = self.hands.play_next(&mut self.session);
                self.tell(played);
            }
            Command::Undo => {
                let undone = self.hands.undo(&mut self.session);
                self.tell(undone);
            }
            Command::Help => self.help = !self.help,
            Command::Screenshot => {
                let saved =
                    screenshot::save(&self.out, self.session.shown(), self.session.picture());
                match saved {
                    Ok(path) => self.say(format!("saved {}", path.display())),
                    Err(e) => self.say(e.to_string()),
                }
            }
            Command::Escape if self.hands.holding() => {
                let back = self.hands.undo(&mut self.session);
                self.tell(back);
            }
            Command::Quit | Command::Escape => event_loop.exit(),
        }
    }

    fn tell(&mut self, outcome: Result<Option<&'static str>, ServersError>) {
        match outcome {
            Ok(None) => {}
            Ok(Some(text)) => self.say(text),
            Err(e) => self.say(e.to_string()),
        }
    }

    fn pointer_moved(&mut self, x: f64, y: f64) {
        if let (Some((old_x, old_y)), Some((window, _))) = (self.pointer, &self.screen) {
            let height = window.inner_size().height as f32;
            let before = self.controller.pose();
            self.controller
                .drag((x - old_x) as f32, (y - old_y) as f32, height);
            self.dirty |= self.controller.pose() != before;
        }
        self.pointer = Some((x, y));
        self.dirty |= self.hands.holding();
    }

    fn button(&mut self, button: MouseButton, state: ElementState) {
        if button == MouseButton::Left {
            self.dirty = true;
            match state {
                ElementState::Pressed if self.modifiers.shift_key() => {
                    let (session, pointer) = (&self.session, self.pointer);
                    if !self.hands.take(session, pointer) {
                        self.say("nothing here that can be moved");
                    }
                    return;
                }
                ElementState::Released if self.hands.holding() => return self.hands.let_go(),
                _ => {}
            }
        }
        let drag = match button {
            MouseButton::Left => Drag::Orbit,
            MouseButton::Right | MouseButton::Middle => Drag::Pan,
            _ => return,
        };
        match state {
            ElementState::Pressed => self.controller.grab(drag),
            ElementState::Released => self.controller.let_go(drag),
        }
    }
}

impl ApplicationHandler<Wake> for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.screen.is_some() {
            return;
        }
        match self.open(event_loop) {
            Ok(screen) => self.screen = Some(screen),
            Err(e) => {
                self.failure = Some(e);
                event_loop.exit();
            }
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, _: Wake) {
        self.woken = true;
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::RedrawRequested => self.redraw(event_loop),
            WindowEvent::Resized(_) | WindowEvent::ScaleFactorChanged { .. } => self.dirty = true,
            WindowEvent::Focused(false) => {
                self.controller.release_all();
                self.hands.let_go();
            }
            WindowEvent::ModifiersChanged(modifiers) => {
                self.modifiers = modifiers.state();
                self.dirty = true;
            }
            WindowEvent::KeyboardInput { event, .. } => self.key(&event, event_loop),
            WindowEvent::CursorMoved { position, .. } => {
                self.pointer_moved(position.x, position.y);
            }
            WindowEvent::MouseInput { button, state, .. } => self.button(button, state),
            WindowEvent::MouseWheel { delta, .. } => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, y) => y,
                    MouseScrollDelta::PixelDelta(by) => (by.y / NOTCH_PX) as f32,
                };
                self.controller.wheel(notches);
                self.dirty = true;
            }
            _ => {}
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let now = Instant::now();
        self.look_after(now);
        let urgent = self.dirty || self.controller.moving() || self.hands.playing();
        let Some((window, _)) = &self.screen else {
            return;
        };
        if !(urgent || self.woken || self.session.restless()) {
            event_loop.set_control_flow(ControlFlow::WaitUntil(now + LOOK_AFTER));
            return;
        }
        let pause = if urgent {
            SHORTEST
        } else {
            let share = Duration::from_secs_f64(self.session.cost_ms() * STANDING_SHARE / 1e3);
            share.clamp(SHORTEST, LONGEST)
        };
        let due = self.frame_start.map_or(now, |start| start + pause);
        if due <= now {
            window.request_redraw();
            event_loop.set_control_flow(ControlFlow::WaitUntil(now + LOOK_AFTER));
        } else {
            event_loop.set_control_flow(ControlFlow::WaitUntil(due));
        }
    }
}
