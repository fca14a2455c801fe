//! What is asked of a ray.

use crate::{
    Hit, Occluder,
    traverse::lanes,
    triangle::{Block, BlockHits},
};

/// What a query makes of hits.
pub(crate) trait Query {
    /// Whether nearer nodes are worth visiting first.
    const ORDERED: bool;

    /// A leaf to try before all others, as instance and block.
    fn first_try(&self) -> Option<(u32, u32)>;

    /// Takes the hits of one block of an instance, in lanes `hit`, shortening `t_max` if only nearer ones matter; returns
    /// whether the query is answered.
    fn take(
        &mut self,
        leaf: (u32, u32),
        block: &Block,
        hit: u32,
        hits: &BlockHits,
        t_max: &mut f32,
    ) -> bool;
}

/// The closest hit.
#[derive(Clone, Copy)]
pub(crate) struct Closest {
    best: Hit,
    /// What the weights in `best` are still to be divided by, which is done once.
    determinant: f32,
}

impl Closest {
    pub(crate) fn within(t_max: f32) -> Self {
        let best = Hit {
            t: t_max,
            instance: u32::MAX,
            face: u32::MAX,
            barycentric: [0.; 2],
        };
        Self {
            best,
            determinant: 1.,
        }
    }

    #[inline(always)]
    pub(crate) fn hit(&self) -> Option<Hit> {
        let scale = 1. / self.determinant;
        (self.best.instance != u32::MAX).then_some(Hit {
            barycentric: self.best.barycentric.map(|weight| weight * scale),
            ..self.best
        })
    }
}

impl Query for Closest {
    const ORDERED: bool = true;

    #[inline(always)]
    fn first_try(&self) -> Option<(u32, u32)> {
        None
    }

    #[inline(always)]
    fn take(
        &mut self,
        (instance, _): (u32, u32),
        block: &Block,
        hit: u32,
        hits: &BlockHits,
        t_max: &mut f32,
    ) -> bool {
        for lane in lanes(hit) {
            let (t, face) = (hits.t[lane], block.faces[lane]);
            let best = &self.best;
            if t < best.t || (t == best.t && (instance, face) < (best.instance, best.face)) {
                self.best = Hit {
                    t,
                    instance,
                    face,
                    barycentric: [hits.v[lane], hits.w[lane]],
                };
                self.determinant = hits.determinant[lane];
                *t_max = t;
            }
        }
        false
    }
}

/// The first hit met that is accepted.
pub(crate) struct Any<F> {
    /// Gets the instance and the face.
    pub(crate) accept: F,
    pub(crate) found: Option<Occluder>,
    /// Leaf of the last hit of a query like this, as instance and block.
    pub(crate) recent: Option<(u32, u32)>,
}

impl<F: FnMut(u32, u32) -> bool> Query for Any<F> {
    const ORDERED: bool = false;

    #[inline(always)]
    fn first_try(&self) -> Option<(u32, u32)> {
        self.recent
    }

    #[inline(always)]
    fn take(
        &mut self,
        leaf: (u32, u32),
        block: &Block,
        hit: u32,
        _: &BlockHits,
        _: &mut f32,
    ) -> bool {
        for lane in lanes(hit) {
            let (instance, face) = (leaf.0, block.faces[lane]);
            if (self.accept)(instance, face) {
                self.found = Some(Occluder { instance, face });
                self.recent = Some(leaf);
                return true;
            }
        }
        false
    }
}
