//! Which method each light has, and why.

use std::sync::Arc;

use penumbra::Sampling;
use protocol::{
    limits::{MAX_NAME, MAX_SHADOWS},
    messages::{LightMove, LightShadows, ObjectMove, SHADOW_ERROR, ShadowMethod, ToDisplay},
};

use rays::Bounds;

use super::{
    Asked, ShadowRays, Shadows, Visibility,
    automatic::Terms,
    casting::{Blockers, Casting},
    mapping::{self, Mapping},
};
use crate::{lights::Shape, stage::Stage};

/// How a display wants the visibility of lights found.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// Samples are to be the same on every machine and in every run.
    pub steady: bool,
    /// Error that [`ShadowMethod::Auto`] may make: root mean square over a light's penumbrae, as a share of the light in full
    /// view.
    pub error: f32,
    /// By index of the light; those past the end are [`ShadowMethod::Auto`].
    pub methods: Vec<ShadowMethod>,
}

impl Default for Wish {
    fn default() -> Self {
        Self {
            steady: false,
            error: SHADOW_ERROR,
            methods: Vec::new(),
        }
    }
}

/// Lights for which methods are tried, and memory that their preparations may fill together, bytes. Both bound what a scene of
/// very many lights costs before its first sample.
const MOST_TRIED: usize = 32;
const MOST_BYTES: usize = 512 << 20;

/// What a server is told about visibility by who starts it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadowOptions {
    /// How shadow rays are spent.
    pub rays: ShadowRays,
    /// The method of all lights, whatever displays wish; [`ShadowMethod::Auto`] leaves it to them.
    pub method: ShadowMethod,
    /// Samples are to be the same on every machine and in every run: nothing is chosen by what it costs here and now.
    pub steady: bool,
}

/// One light's method.
#[derive(Clone)]
pub(super) enum Way {
    Rays(ShadowRays),
    Casting(Arc<Casting>),
    Maps(Arc<Mapping>),
}

#[derive(Clone)]
pub(super) struct Choice {
    pub(super) way: Way,
    pub(super) why: String,
}

/// The methods of a scene's lights.
pub struct Chosen {
    options: ShadowOptions,
    wish: Wish,
    /// Made when the first light asks for them.
    blockers: Option<Blockers>,
    lights: Vec<Choice>,
}

impl Chosen {
    /// Chooses, and prepares what the methods need. In parallel on the current rayon pool.
    #[must_use]
    pub fn new(stage: &Stage, options: ShadowOptions, wish: Wish) -> Self {
        let mut chosen = Self {
            options,
            wish,
            blockers: None,
            lights: Vec::new(),
        };
        for light in 0..stage.emitters().len() {
            let choice = chosen.choose(stage, light);
            chosen.lights.push(choice);
        }
        chosen
    }

    /// The same after an edit, from what the stage was before to what it is: only what moved is prepared anew.
    #[must_use]
    pub fn after(
        &self,
        (before, stage): (&Stage, &Stage),
        objects: &[ObjectMove],
        lights: &[LightMove],
    ) -> Self {
        let bounds = |stage: &Stage, object| stage.world().instance_bounds(object);
        let changed = |light: usize| lights.iter().any(|change| change.light as usize == light);
        // Lights that block are in each other's way.
        let lights_moved = lights.iter().filter_map(|change| {
            match &stage.emitters()[change.light as usize].shape {
                Shape::Polygon(polygon) => Some(polygon.instance),
                Shape::Point(_) | Shape::Segment(..) => None,
            }
        });
        let objects_moved: Vec<u32> = objects.iter().map(|change| change.object).collect();
        let (mut moved, known) = (objects_moved.clone(), objects_moved.len());
        moved.extend(lights_moved);
        let places: Vec<Bounds> = moved
            .iter()
            .flat_map(|instance| [bounds(before, *instance), bounds(stage, *instance)])
            .collect();
        let blockers_changed = moved.len() > known;
        let mut chosen = Self {
            options: self.options,
            wish: self.wish.clone(),
            blockers: self.blockers.clone(),
            lights: Vec::with_capacity(self.lights.len()),
        };
        for (light, choice) in self.lights.iter().enumerate() {
            let way = match &choice.way {
                Way::Rays(rays) => Way::Rays(*rays),
                Way::Casting(casting) if changed(light) || blockers_changed => {
                    chosen.cast_again(stage, light, casting)
                }
                Way::Casting(casting) => {
                    Way::Casting(Arc::new(casting.after(stage, &objects_moved)))
                }
                Way::Maps(maps) if changed(light) => chosen.map_again(stage, light, maps),
                Way::Maps(maps) => Way::Maps(Arc::new(maps.after(stage, &places))),
            };
            let why = choice.why.clone();
            chosen.lights.push(Choice { way, why });
        }
        chosen
    }

    /// Casting as before for a light or among blockers that are not as before.
    fn cast_again(&mut self, stage: &Stage, light: usize, before: &Casting) -> Way {
        let blockers = self.blockers.get_or_insert_with(|| Blockers::new(stage));
        let emitter = &stage.emitters()[light];
        let casting = Casting::new(stage, blockers, emitter, before.sampling());
        casting.map_or(Way::Rays(self.options.rays), |casting| {
            Way::Casting(Arc::new(casting))
        })
    }

    /// Maps as before for a light that is not as before.
    fn map_again(&self, stage: &Stage, light: usize, before: &Mapping) -> Way {
        let emitter = &stage.emitters()[light];
        match Mapping::new(stage, emitter, before.options()) {
            Ok(Some(maps)) => Way::Maps(Arc::new(maps)),
            Ok(None) | Err(_) => Way::Rays(self.options.rays),
        }
    }

    fn choose(&mut self, stage: &Stage, light: usize) -> Choice {
        let wished = self.wish.methods.get(light).copied().unwrap_or_default();
        let (wanted, by) = match self.options.method {
            ShadowMethod::Auto => (wished, "wished for"),
            forced => (forced, "the server's setting"),
        };
        match wanted {
            ShadowMethod::Auto => self.automatic(stage, light),
            ShadowMethod::Rays => self.rays(by),
            ShadowMethod::Penumbra => self.casting(stage, light, by),
            ShadowMethod::SoftMap => self.mapping(stage, light, by),
        }
    }

    fn automatic(&mut self, stage: &Stage, light: usize) -> Choice {
        if matches!(stage.emitters()[light].shape, Shape::Point(_)) {
            return self.rays("a ray tells all of a point");
        }
        if light >= MOST_TRIED {
            return self.rays("lights are too many to try each");
        }
        let filled: usize = self.lights.iter().map(|choice| choice.way.bytes()).sum();
        let terms = Terms {
            stage,
            rays: self.options.rays,
            error: f64::from(self.wish.error),
            most_bytes: MOST_BYTES.saturating_sub(filled),
            steady: self.options.steady || self.wish.steady,
        };
        terms.choose(light, &mut self.blockers)
    }

    fn rays(&self, why: &str) -> Choice {
        Choice {
            way: Way::Rays(self.options.rays),
            why: why.to_owned(),
        }
    }

    fn casting(&mut self, stage: &Stage, light: usize, by: &str) -> Choice {
        let emitter = &stage.emitters()[light];
        if matches!(emitter.shape, Shape::Point(_)) {
            return self.rays("a point has no penumbra to cast");
        }
        let blockers = self.blockers.get_or_insert_with(|| Blockers::new(stage));
        let sampling = Sampling::default();
        let casting = Casting::new(stage, blockers, emitter, sampling);
        match casting {
            Ok(casting) => Choice {
                why: format!(
                    "{by}; {} samples in {} sets, {:.1} MB",
                    sampling.samples,
                    sampling.sets,
                    casting.bytes() as f64 * 1e-6
                ),
                way: Way::Casting(Arc::new(casting)),
            },
            Err(error) => self.rays(&format!("penumbrae cannot be cast: {error}")),
        }
    }

    fn mapping(&self, stage: &Stage, light: usize, by: &str) -> Choice {
        let emitter = &stage.emitters()[light];
        match Mapping::new(stage, emitter, &mapping::OPTIONS) {
            Ok(Some(maps)) => {
                let stats = maps.stats();
                Choice {
                    why: format!(
                        "{by}; {} samples on {} lines, {:.1} MB",
                        stats.samples,
                        stats.lights,
                        stats.bytes as f64 * 1e-6
                    ),
                    way: Way::Maps(Arc::new(maps)),
                }
            }
            Ok(None) => self.rays("a point has no length to be sampled along"),
            Err(error) => self.rays(&format!("there are no maps: {error}")),
        }
    }

    /// Tells a display, in as many messages as it takes.
    pub fn told(&self) -> impl Iterator<Item = ToDisplay> {
        let lights = self.lights.chunks(MAX_SHADOWS).enumerate();
        lights.map(|(part, choices)| {
            let first = part * MAX_SHADOWS;
            let told = choices.iter().enumerate().map(|(i, choice)| LightShadows {
                light: (first + i) as u32,
                method: choice.way.method(),
                why: shortened(&choice.why),
            });
            ToDisplay::Shadows {
                lights: told.collect(),
            }
        })
    }

    /// The method of a light.
    #[must_use]
    pub fn method(&self, light: usize) -> ShadowMethod {
        self.lights[light].way.method()
    }
}

impl Way {
    pub(super) fn method(&self) -> ShadowMethod {
        match self {
            Self::Rays(_) => ShadowMethod::Rays,
            Self::Casting(_) => ShadowMethod::Penumbra,
            Self::Maps(_) => ShadowMethod::SoftMap,
        }
    }

    /// Memory of what is prepared.
    pub(super) fn bytes(&self) -> usize {
        match self {
            Self::Rays(_) => 0,
            Self::Casting(casting) => casting.bytes(),
            Self::Maps(maps) => maps.stats().bytes,
        }
    }

    pub(super) fn visibility(&self) -> &dyn Visibility {
        match self {
            Self::Rays(rays) => rays,
            Self::Casting(casting) => &**casting,
            Self::Maps(maps) => &**maps,
        }
    }
}

fn shortened(text: &str) -> String {
    let end = (0..=text.len().min(MAX_NAME)).rfind(|end| text.is_char_boundary(*end));
    text[..end.unwrap_or(0)].to_owned()
}

impl Visibility for Chosen {
    fn batch(&self) -> usize {
        let batches = self
            .lights
            .iter()
            .map(|light| light.way.visibility().batch());
        batches.max().unwrap_or(1)
    }

    fn ask(&self, stage: &Stage, light: usize, asked: &mut [Asked], shadows: &mut Shadows) {
        self.lights[light]
            .way
            .visibility()
            .ask(stage, light, asked, shadows);
    }
}
