//! Which models the display chose, what that saves and what error it allows: the text of `--explain`.

use std::fmt;

use protocol::messages::{LightShadows, ShadowMethod};
use protocol::scene::{Light, Model, Scene};
use serde::Serialize;

use crate::config::{Choices, ShadowEdges};
use crate::frame::{Display, Effort, SPARSEST_PX};
use crate::shadows::light::ShadowLight;
use crate::shadows::store::Known;
use crate::shadows::worth::{Tally, Worth};

/// What a light is to the shadow edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightKind {
    /// All vertices in one place: shadows are hard.
    Point,
    /// All vertices on a line.
    Linear,
    /// A polygon.
    Area,
}

/// What a light's shadow edges are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightModel {
    /// There are none.
    NoEdges,
    /// Where light turns to shadow at once.
    Hard,
    /// The shadow edges of the light's middle.
    Middle,
    /// Where penumbrae begin and where they end.
    Boundaries,
}

/// What is known of one light.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LightFacts {
    /// What it is.
    pub kind: LightKind,
    /// What was chosen for it.
    pub model: LightModel,
    /// What its samples have met.
    pub known: Known,
    /// What became of its edges in the last frame.
    pub tally: Tally,
}

/// What is known of a display and its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// What the scene asks to be shaded.
    pub shading: Model,
    /// How edges are made.
    pub choices: Choices,
    /// What shadow edges had to be worth in the last frame.
    pub worth: Worth,
    /// How often edges were worked on.
    pub effort: Effort,
    /// Segments along which objects pass through one another.
    pub creases: usize,
    /// By index in the scene.
    pub lights: Vec<LightFacts>,
    /// How a server finds the visibility of lights, by their index, as far as one said.
    pub shadows: Vec<LightShadows>,
}

impl Explanation {
    /// Of the frame that a display of this scene drew last, and of what a server said about lights.
    pub fn of(display: &Display, scene: &Scene, shadows: &[LightShadows]) -> Self {
        let stage = display.edge_stage();
        let choices = stage.choices();
        let told = shadows.to_vec();
        let shadows = stage.shadows().filter(|_| choices.edges());
        let lights = display.placed().lights().iter().enumerate();
        let lights = lights.map(|(index, light)| {
            let kind = kind_of(light);
            let with_edges = shadows.is_some();
            LightFacts {
                kind,
                model: model_of(kind, choices.shadow_edges, with_edges),
                known: shadows.map_or_else(Known::default, |s| s.known(index as u32)),
                tally: stage.tallies().get(index).copied().unwrap_or_default(),
            }
        });
        Self {
            shading: scene.shading.model,
            choices,
            worth: stage.worth(),
            effort: stage.effort(),
            creases: shadows.map_or(0, |s| s.meets().len()),
            lights: lights.collect(),
            shadows: told,
        }
    }
}

fn kind_of(light: &Light) -> LightKind {
    match ShadowLight::new(light).vertices().len() {
        0 | 1 => LightKind::Point,
        2 => LightKind::Linear,
        _ => LightKind::Area,
    }
}

fn model_of(kind: LightKind, which: ShadowEdges, with_edges: bool) -> LightModel {
    match (kind, which) {
        _ if !with_edges => LightModel::NoEdges,
        (_, ShadowEdges::Off) => LightModel::NoEdges,
        (LightKind::Point, _) => LightModel::Hard,
        (_, ShadowEdges::Chosen) => LightModel::Middle,
        (_, ShadowEdges::All) => LightModel::Boundaries,
    }
}

impl fmt::Display for Explanation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.tell_scene(f)?;
        for (index, light) in self.lights.iter().enumerate() {
            light.tell(index, self.worth, f)?;
            if let Some(told) = self.shadows.iter().find(|s| s.light as usize == index) {
                tell_shadows(told, f)?;
            }
        }
        Ok(())
    }
}

fn tell_shadows(told: &LightShadows, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let method = match told.method {
        ShadowMethod::Auto => "chosen by the server",
        ShadowMethod::Rays => "shadow rays",
        ShadowMethod::Penumbra => "penumbra casting",
        ShadowMethod::SoftMap => "soft shadow maps",
    };
    writeln!(f, "  visibility: {method}: {}", told.why)
}

impl Explanation {
    fn tell_scene(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shading = match self.shading {
            Model::Direct => "direct light: nothing is kept or computed for reflections",
            Model::Glossy => {
                "direct light and glossy reflection, 16 to 81 reflected rays a glossy sample; \
                              what is glossy is asked for again when seen from elsewhere"
            }
            Model::Global => {
                "direct and indirect light, 4 reflections, from irradiance records of 360 to 1440 rays each; \
                              the servers compute them once where they are first missed, and samples made without them are asked for again"
            }
        };
        writeln!(f, "scene: {} lights; {shading}", self.lights.len())?;
        if !self.choices.edges() {
            return writeln!(f, "edges: none, by --method: the Render Cache");
        }
        let Effort {
            frames,
            searches,
            judgements,
        } = self.effort;
        writeln!(
            f,
            "edges: searched for in {searches} of {frames} frames, shadow edges judged in {judgements}; \
             a frame in which nothing moves and nothing new is known searches for none"
        )?;
        writeln!(
            f,
            "intersection creases: {} segments, found once and again for what moves",
            self.creases
        )?;
        match self.choices.shadow_edges {
            ShadowEdges::Off => writeln!(
                f,
                "shadow edges: off: shadows are as sharp as samples are dense"
            ),
            ShadowEdges::All => writeln!(
                f,
                "shadow edges: all, whatever they are worth: wide penumbrae are cut into strips with few samples each"
            ),
            ShadowEdges::Chosen => writeln!(
                f,
                "shadow edges: chosen: penumbrae of at most {:.1} px ({} times the distance between samples, which counts \
                 for {SPARSEST_PX} px at most) that can change the picture by at least {} steps of 255 within a pixel's neighbourhood",
                self.worth.width_px, self.choices.shadow_width, self.worth.steps
            ),
        }
    }
}

impl LightFacts {
    fn tell(&self, index: usize, worth: Worth, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            LightKind::Point => "point",
            LightKind::Linear => "linear",
            LightKind::Area => "area",
        };
        let Known {
            blockers,
            receivers,
            events,
            edges,
        } = self.known;
        writeln!(
            f,
            "light {index}: {kind}; samples met {blockers} blockers and {receivers} receivers"
        )?;
        let (model, saves, error) = match self.model {
            LightModel::NoEdges => (
                "no shadow edges",
                "all work on them",
                "shadows blur or fray where samples are sparse; none in the long run",
            ),
            LightModel::Hard => (
                "hard shadow edges",
                "there is no penumbra: one vertex against the blocker's edges, none against its vertices",
                "none but rounding",
            ),
            LightModel::Middle => (
                "shadow edges of the light's middle",
                "one line in place of an umbral and a penumbral one, no events of its edges",
                "",
            ),
            LightModel::Boundaries => (
                "umbral and penumbral edges",
                "nothing",
                "penumbral edges are exact; umbral ones lack events of three edges",
            ),
        };
        writeln!(f, "  model: {model}: {events} events, {edges} edges")?;
        if self.model == LightModel::NoEdges {
            return writeln!(f, "  saves: {saves}\n  error: {error}");
        }
        let Tally {
            drawn,
            wide,
            dim,
            faint,
            cut,
        } = self.tally;
        writeln!(
            f,
            "  saves: {saves}; of {} edges {drawn} are drawn ({cut} of them in part), {wide} left out as too wide, {dim} as \
             too dim, {faint} as too faint",
            self.tally.all()
        )?;
        if self.model == LightModel::Middle {
            let off_px = 0.5 * worth.width_px;
            return writeln!(
                f,
                "  error: a line is at most about {off_px:.1} px off where the shadow begins or ends; without one, sharpness only"
            );
        }
        writeln!(f, "  error: {error}")
    }
}

#[cfg(test)]
#[path = "explain_tests.rs"]
mod tests;
