//! Maps of a light, kept from batch to batch.

use rayon::prelude::*;
use rays::{Bounds, World};

use crate::{
    BuildError, Light, Options, Receiver,
    light::Linear,
    linear::{Found, LinearMaps},
};

/// What a receiver sees of a light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Share of the light's unoccluded irradiance that arrives, in [0, 1]; 0 where the unoccluded light gives nothing.
    pub share: f32,
    /// Whether the samples are too few to know: part of the light between them may be seen, or hidden, that none sees.
    pub flagged: bool,
    /// Instances that hide samples of the light from the receiver, the first two found.
    pub blockers: [Option<u32>; 2],
}

/// What maps came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Linear lights: 1, or the edges of a polygon.
    pub lights: usize,
    /// Samples on all of them.
    pub samples: usize,
    /// Texels of all samples.
    pub texels: usize,
    /// Depth discontinuities of all samples.
    pub edges: usize,
    /// Texels with a skin, and places tried in penumbrae that no texel sees.
    pub penumbral: u64,
    /// Of those, where samples are too few.
    pub undersampled: u64,
    /// Texels that a neighbour does not see although no skin covers them.
    pub unexplained: u64,
    /// Rows traced since the maps were built, all samples together.
    pub traced_rows: u64,
    /// Memory, bytes.
    pub bytes: usize,
}

/// The soft shadow maps of one light.
///
/// Lookups take `&self` and may run on any number of threads. Results are the same for any number of them.
#[derive(Clone, Debug)]
pub struct SoftMaps {
    light: Vec<Linear>,
    options: Options,
    maps: Vec<LinearMaps>,
}

impl SoftMaps {
    /// Traces the depth maps of `light` and draws their visibility channels.
    ///
    /// # Errors
    /// The light makes no sense.
    pub fn build(world: &World, light: &Light, options: &Options) -> Result<Self, BuildError> {
        let light = light.linear()?;
        let maps = light.iter().map(|l| LinearMaps::build(world, l, options));
        Ok(Self {
            maps: maps.collect(),
            options: options.clone(),
            light,
        })
    }

    /// Brings the maps up to date after something moved: `moved` are the boxes, world space, where it was and where it is in
    /// `world`. Only half planes around the light that meet one of them are traced again; all are if the world has outgrown
    /// the maps.
    pub fn update(&mut self, world: &World, moved: &[Bounds]) {
        for (light, maps) in self.light.iter().zip(&mut self.maps) {
            if !maps.update(world, moved) {
                *maps = LinearMaps::build(world, light, &self.options);
            }
        }
    }

    /// What `receiver` sees of the light. A receiver outside the maps sees all of it.
    #[must_use]
    pub fn fraction(&self, receiver: &Receiver) -> Seen {
        let mut total = Found::default();
        for maps in &self.maps {
            total.add(&maps.look(receiver));
        }
        let share = if total.all > 0. {
            (total.seen / total.all).clamp(0., 1.) as f32
        } else {
            0.
        };
        Seen {
            share,
            flagged: total.undersampled,
            blockers: total.blockers,
        }
    }

    /// [`fraction`](Self::fraction) of each of `receivers`, in order, into `seen`, whose contents are replaced.
    pub fn fractions(&self, receivers: &[Receiver], seen: &mut Vec<Seen>) {
        receivers
            .par_iter()
            .with_min_len(256)
            .map(|receiver| self.fraction(receiver))
            .collect_into_vec(seen);
    }

    /// What the maps hold, and what that takes.
    #[must_use]
    pub fn stats(&self) -> Stats {
        let mut stats = Stats {
            lights: self.maps.len(),
            ..Stats::default()
        };
        for maps in &self.maps {
            let total = maps.total();
            stats.samples += maps.samples.len();
            stats.texels += maps.texels();
            let rows = maps.samples.iter().flat_map(|sample| &sample.rows);
            stats.edges += rows.map(|row| row.edges.len()).sum::<usize>();
            stats.penumbral += u64::from(total.penumbral);
            stats.undersampled += u64::from(total.undersampled);
            stats.unexplained += u64::from(total.unexplained);
            stats.traced_rows += maps.traced_rows;
            stats.bytes += maps.bytes();
        }
        stats
    }

    /// Radians between rows and between columns, the coarsest of all samples.
    #[must_use]
    pub fn texel_angles(&self) -> [f32; 2] {
        let steps = self.maps.iter().map(LinearMaps::steps);
        steps.fold([0.; 2], |a, b| [a[0].max(b[0]), a[1].max(b[1])])
    }

    /// Visibility channels as the paper has them, for pictures and tests: for each linear light and each two neighbouring
    /// samples, by rows, the values of the first and the second sample's texels. Texels without a skin have 0.5.
    pub fn channels(&self) -> impl Iterator<Item = [Vec<f32>; 2]> + '_ {
        self.maps.iter().flat_map(|maps| {
            let rows = maps.samples.first().map_or(0, |sample| sample.rows.len());
            let pairs = 0..maps.pairs.len();
            pairs.flat_map(move |pair| (0..rows).map(move |row| maps.channel_values(pair, row)))
        })
    }
}

impl Found {
    fn add(&mut self, other: &Self) {
        self.seen += other.seen;
        self.all += other.all;
        self.undersampled |= other.undersampled;
        for blocker in other.blockers {
            self.block(blocker);
        }
    }
}
