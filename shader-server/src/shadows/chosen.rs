//! Which method each light has, and why.

use std::sync::Arc;

use protocol::{
    limits::{MAX_NAME, MAX_SHADOWS},
    messages::{LightShadows, ShadowMethod, ToDisplay},
};

use super::{Asked, ShadowRays, Shadows, Visibility};
use crate::stage::Stage;

/// How a display wants the visibility of lights found.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// Error that [`ShadowMethod::Auto`] may make: root mean square over a light's penumbrae, as a share of the light in full
    /// view.
    pub error: f32,
    /// By index of the light; those past the end are [`ShadowMethod::Auto`].
    pub methods: Vec<ShadowMethod>,
}

impl Default for Wish {
    fn default() -> Self {
        Self {
            error: 0.02,
            methods: Vec::new(),
        }
    }
}

/// What a server is told about visibility by who starts it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadowOptions {
    /// How shadow rays are spent.
    pub rays: ShadowRays,
    /// The method of all lights, whatever displays wish; [`ShadowMethod::Auto`] leaves it to them.
    pub method: ShadowMethod,
}

struct Choice {
    visibility: Arc<dyn Visibility>,
    method: ShadowMethod,
    why: String,
}

/// The methods of a scene's lights.
pub struct Chosen {
    options: ShadowOptions,
    wish: Wish,
    lights: Vec<Choice>,
}

impl Chosen {
    /// Chooses, and prepares what the methods need.
    #[must_use]
    pub fn new(stage: &Stage, options: ShadowOptions, wish: Wish) -> Self {
        let rays: Arc<dyn Visibility> = Arc::new(options.rays);
        let lights = stage.emitters().iter().map(|_| Choice {
            visibility: Arc::clone(&rays),
            method: ShadowMethod::Rays,
            why: String::new(),
        });
        let lights = lights.collect();
        Self {
            options,
            wish,
            lights,
        }
    }

    /// The same for a scene that edits have changed.
    #[must_use]
    pub fn after(&self, stage: &Stage) -> Self {
        Self::new(stage, self.options, self.wish.clone())
    }

    /// Tells a display, in as many messages as it takes.
    pub fn told(&self) -> impl Iterator<Item = ToDisplay> {
        let lights = self.lights.chunks(MAX_SHADOWS).enumerate();
        lights.map(|(part, choices)| {
            let first = part * MAX_SHADOWS;
            let told = choices.iter().enumerate().map(|(i, choice)| LightShadows {
                light: (first + i) as u32,
                method: choice.method,
                why: shortened(&choice.why),
            });
            ToDisplay::Shadows {
                lights: told.collect(),
            }
        })
    }
}

fn shortened(text: &str) -> String {
    let end = (0..=MAX_NAME.min(text.len())).rev();
    let end = end.into_iter().find(|i| text.is_char_boundary(*i));
    text[..end.unwrap_or(0)].to_owned()
}

impl Visibility for Chosen {
    fn batch(&self) -> usize {
        let batches = self.lights.iter().map(|light| light.visibility.batch());
        batches.max().unwrap_or(1)
    }

    fn ask(&self, stage: &Stage, light: usize, asked: &mut [Asked], shadows: &mut Shadows) {
        self.lights[light]
            .visibility
            .ask(stage, light, asked, shadows);
    }
}
