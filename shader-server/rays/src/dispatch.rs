//! The same traversal compiled for plain machines and for AVX2, chosen when the program runs.
//!
//! The two give the same bits: neither reorders nor fuses floating-point operations.

#[cfg(target_arch = "x86_64")]
use crate::kernel::Avx2;
use crate::{
    Ray, Region,
    kernel::Plain,
    region::touches,
    traverse::{Query, Stack, run},
    world::World,
};

/// Instructions that traversal uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Level {
    Plain,
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Level {
    /// The best that this machine has.
    pub(crate) fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if Avx2::detect().is_some() {
            return Self::Avx2;
        }
        Self::Plain
    }
}

/// Runs a query; the ray must be valid.
#[inline]
pub(crate) fn query<Q: Query>(world: &World, ray: &Ray, t_max: f32, stack: &mut Stack, q: &mut Q) {
    match world.level {
        Level::Plain => run::<Plain, _>(world, ray, t_max, stack, q),
        #[cfg(target_arch = "x86_64")]
        #[expect(
            unsafe_code,
            reason = "only Level::detect makes Avx2, after asking the processor"
        )]
        Level::Avx2 => unsafe { run_avx2(world, ray, t_max, stack, q) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<Q: Query>(world: &World, ray: &Ray, t_max: f32, stack: &mut Stack, q: &mut Q) {
    run::<Avx2, _>(world, ray, t_max, stack, q);
}

/// Whether an accepted face may reach into a region.
#[inline]
pub(crate) fn region_touched(
    world: &World,
    region: &Region,
    stack: &mut Stack,
    accept: &mut impl FnMut(u32, u32) -> bool,
) -> bool {
    match world.level {
        Level::Plain => touches(world, region, stack, accept),
        #[cfg(target_arch = "x86_64")]
        #[expect(
            unsafe_code,
            reason = "only Level::detect makes Avx2, after asking the processor"
        )]
        Level::Avx2 => unsafe { touches_avx2(world, region, stack, accept) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn touches_avx2(
    world: &World,
    region: &Region,
    stack: &mut Stack,
    accept: &mut impl FnMut(u32, u32) -> bool,
) -> bool {
    touches(world, region, stack, accept)
}
