//! Visibility by soft shadow maps: traced once for a light, asked by every receiver.

use rays::Bounds;
use soft_maps::{BuildError, Light, Options, Receiver, SoftMaps, Stats, Transition};

use super::{Asked, Shadows, Visibility};
use crate::{
    lights::{Emitter, Shape},
    stage::Stage,
};

/// Maps that take a second or so to trace and some ten megabytes a light.
pub(super) const OPTIONS: Options = Options {
    samples: 2,
    max_samples: 5,
    texel_angle: 0.006,
    max_texels: 1 << 17,
    bias: 1.,
    refinements: 5,
    transition: Transition::Rational,
    receivers: None,
};

/// Soft shadow maps of one light.
#[derive(Clone)]
pub(super) struct Mapping {
    maps: SoftMaps,
    options: Options,
}

impl Mapping {
    /// Maps of `light`; nothing of a point, which has no length to be sampled along.
    ///
    /// # Errors
    /// The light has a coordinate that is not finite, or is a polygon without area.
    pub(super) fn new(
        stage: &Stage,
        light: &Emitter,
        options: &Options,
    ) -> Result<Option<Self>, BuildError> {
        let Some(light) = mapped(light) else {
            return Ok(None);
        };
        let maps = SoftMaps::build(stage.world(), &light, options)?;
        Ok(Some(Self {
            maps,
            options: options.clone(),
        }))
    }

    /// The same where nothing but objects has moved: from and to the boxes `moved`.
    pub(super) fn after(&self, stage: &Stage, moved: &[Bounds]) -> Self {
        let mut next = self.clone();
        next.maps.update(stage.world(), moved);
        next
    }

    /// How they are made.
    pub(super) fn options(&self) -> &Options {
        &self.options
    }

    /// What the maps hold.
    pub(super) fn stats(&self) -> Stats {
        self.maps.stats()
    }
}

/// The light as maps take it; nothing for a point.
pub(super) fn mapped(light: &Emitter) -> Option<Light> {
    match &light.shape {
        Shape::Point(_) => None,
        Shape::Segment(from, to) => Some(Light::Segment([from.as_vec3(), to.as_vec3()])),
        Shape::Polygon(polygon) => Some(Light::Polygon {
            vertices: polygon.vertices.iter().map(|v| v.as_vec3()).collect(),
            instance: Some(polygon.instance),
        }),
    }
}

impl Visibility for Mapping {
    fn batch(&self) -> usize {
        1
    }

    fn ask(&self, _stage: &Stage, _light: usize, asked: &mut [Asked], shadows: &mut Shadows) {
        for asked in asked {
            let at = &asked.receiver;
            let seen = self.maps.fraction(&Receiver {
                position: at.position.as_vec3(),
                normal: at.normal.as_vec3(),
                face_normal: at.face_normal,
            });
            asked.seen = seen.share;
            let blockers = seen.blockers.into_iter().flatten();
            shadows
                .met
                .extend(blockers.map(|blocker| (at.instance, blocker)));
        }
    }
}
