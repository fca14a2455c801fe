//! The same traversal compiled for plain machines and for vector instructions, chosen when the program runs.
//!
//! All give the same bits: none reorders or fuses floating-point operations.

use fearless_simd::dispatch;

use crate::{
    Occluder, Ray, Region,
    kernel::{Plain, Vector},
    node::WIDTH,
    packet::{Asked, run_together},
    query::{Any, Closest},
    region::touches,
    traverse::{Entry, run},
    world::World,
};

/// Instructions that traversal uses.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Level {
    /// One lane after another.
    Plain,
    /// Those of a level.
    Vector(fearless_simd::Level),
}

/// Runs `$run` with the kernel of a level.
macro_rules! at_level {
    ($level:expr, $kernel:ident => $run:expr) => {
        match $level {
            Level::Plain => {
                let $kernel = Plain;
                $run
            }
            Level::Vector(level) => dispatch!(level, simd => {
                let $kernel = Vector(simd);
                $run
            }),
        }
    };
}

/// Whether something is wanted as an occluder, by instance and face.
type Accept<'a> = &'a mut dyn FnMut(u32, u32) -> bool;

/// The closest hit; the ray must be valid.
pub(crate) fn closest(world: &World, ray: &Ray, t_max: f32, stack: &mut [Entry]) -> Closest {
    at_level!(world.level, kernel => {
        let mut query = Closest::within(t_max);
        run(kernel, world, ray, t_max, stack, &mut query);
        query
    })
}

/// Any hit; the ray must be valid.
pub(crate) fn any(
    world: &World,
    ray: &Ray,
    t_max: f32,
    query: &mut Any<Accept<'_>>,
    stack: &mut [Entry],
) {
    at_level!(world.level, kernel => run(kernel, world, ray, t_max, stack, query));
}

/// The closest hit of each ray.
pub(crate) fn closest_each(
    world: &World,
    rays: &[Ray],
    t_max: f32,
    stack: &mut [Entry],
    mut take: impl FnMut(&Closest),
) {
    let take: &mut dyn FnMut(&Closest) = &mut take;
    at_level!(world.level, kernel => {
        for rays in rays.chunks(WIDTH) {
            let mut asked = Asked::new([Closest::within(t_max); WIDTH]);
            run_together(kernel, world, rays, t_max, &mut asked, stack);
            for query in &asked.queries[..rays.len()] {
                take(query);
            }
        }
    });
}

/// Any hit of each ray; `accept` gets the ray's index, the instance and the face.
pub(crate) fn any_each(
    world: &World,
    rays: &[Ray],
    t_max: f32,
    accept: &dyn Fn(usize, u32, u32) -> bool,
    stack: &mut [Entry],
    mut take: impl FnMut(Option<Occluder>),
) {
    let take: &mut dyn FnMut(Option<Occluder>) = &mut take;
    at_level!(world.level, kernel => {
        for (chunk, rays) in rays.chunks(WIDTH).enumerate() {
            let queries = std::array::from_fn(|ray| Any {
                accept: move |instance, face| accept(chunk * WIDTH + ray, instance, face),
                found: None,
                recent: None,
            });
            let mut asked = Asked::new(queries);
            run_together(kernel, world, rays, t_max, &mut asked, stack);
            for query in &asked.queries[..rays.len()] {
                take(query.found);
            }
        }
    });
}

/// Whether an accepted face may reach into a region.
pub(crate) fn region_touched(
    world: &World,
    region: &Region,
    stack: &mut [Entry],
    accept: Accept<'_>,
) -> bool {
    match world.level {
        Level::Plain => touches(world, region, stack, accept),
        Level::Vector(level) => dispatch!(level, _ => touches(world, region, stack, accept)),
    }
}
