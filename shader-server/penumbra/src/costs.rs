//! What casting and rays cost, to take whichever is cheaper.

use std::time::Instant;

use rays::World;

use crate::{
    cast::{self, Counts, Scratch},
    caster::Caster,
    lanes::LANES,
    receivers::{Leaf, Point, Receivers, sort_into_leaves},
    shadow_rays,
};

/// Leaves that are cast and traced to find the costs.
const TRIED: usize = 48;

/// Time for each unit of work, nanoseconds of one thread.
///
/// Choices by the same costs are the same in every run; those by [`measured`](Self::measured) ones differ from run to run, and
/// with them the samples for which rays and casting break ties differently.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Costs {
    /// To try a polygon on a leaf, its share of the search for it included.
    pub polygon_ns: f64,
    /// To try a pair of receiver and polygon on all rows of samples.
    pub pair_ns: f64,
    /// To try the samples of a row.
    pub row_ns: f64,
    /// To trace a shadow ray.
    pub ray_ns: f64,
    /// Whether rays are traced eight together.
    pub packets: bool,
}

impl Costs {
    /// Medians on a 2.6 GHz AMD EPYC 9R14 with AVX-512, scenes of 73,000 to 1.27 million triangles.
    pub const TYPICAL: Self = Self {
        polygon_ns: 40.,
        pair_ns: 18.,
        row_ns: 9.,
        ray_ns: 75.,
        packets: true,
    };

    /// What casting takes, by its counts; nanoseconds of one thread.
    #[must_use]
    pub fn casting_ns(&self, counts: &Counts) -> f64 {
        counts.polygons as f64 * self.polygon_ns
            + counts.pairs as f64 * self.pair_ns
            + counts.rows as f64 * self.row_ns
    }

    /// Measures on a few leaves of `receivers`, spread over them, what casting and each way of tracing costs here and now.
    /// [`TYPICAL`](Self::TYPICAL) if none of them is in penumbra.
    #[must_use]
    pub fn measured(caster: &Caster, world: &World, receivers: &Receivers) -> Self {
        let light = caster.light();
        let mut points: Vec<Point> = (0..receivers.len())
            .map(|index| Point::new(light, receivers, index, |own| caster.key(own)))
            .filter(|point| point.may_see(light))
            .collect();
        sort_into_leaves(&mut points);
        let leaves = points.len().div_ceil(LANES);
        let step = leaves.div_ceil(TRIED).max(1);
        let mut costs = Self::TYPICAL;
        let mut scratch = Scratch::default();
        let (mut casting_s, mut modelled_ns) = (0., 0.);
        // Times of a ray weigh as much as casting took: where that is little, rays are not wanted whatever they cost.
        let mut rays_ns = [0f64; 2];
        for points in points.chunks(LANES).step_by(step) {
            let leaf = Leaf::new(points);
            let seconds = best(|| {
                scratch.counts = Counts::default();
                cast::cast(caster, &leaf, None, &mut scratch);
            });
            if scratch.counts.pairs == 0 {
                // Whoever is lit needs no rays whatever they cost.
                continue;
            }
            casting_s += seconds;
            modelled_ns += costs.casting_ns(&scratch.counts);
            for (packets, sum_ns) in [false, true].into_iter().zip(&mut rays_ns) {
                let traced_s = best(|| {
                    scratch.counts = Counts::default();
                    cast::begin(caster, &leaf, &mut scratch);
                    shadow_rays::trace(caster, world, (receivers, &leaf), packets, &mut scratch);
                });
                *sum_ns += seconds * 1e9 * traced_s / scratch.counts.rays.max(1) as f64;
            }
        }
        if modelled_ns > 0. {
            let scale = 1e9 * casting_s / modelled_ns;
            costs.polygon_ns *= scale;
            costs.pair_ns *= scale;
            costs.row_ns *= scale;
            costs.packets = rays_ns[1] < rays_ns[0];
            costs.ray_ns = rays_ns[0].min(rays_ns[1]) / casting_s;
        }
        costs
    }
}

/// The shorter of two times that `work` takes, seconds: the first finds memory cold, and either may be interrupted.
fn best(mut work: impl FnMut()) -> f64 {
    let mut time = || {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64()
    };
    time().min(time())
}
