//! A light in its own coordinates: samples in groups, several sets of them.

use glam::{DMat3, DVec3, Vec3};

use crate::{
    lanes::{GROUP, LANES},
    strata::{self, Grid},
};

/// Most samples a set.
pub const MAX_SAMPLES: u32 = 1024;
/// Most sets.
pub const MAX_SETS: u32 = 8;

/// Why a light cannot be cast from.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LightError {
    /// A corner, an axis or a radius is not finite, or there is none.
    #[error("the light's shape has no finite corners")]
    Shape,
    /// Samples come in groups of 32.
    #[error("{0} samples: must be a multiple of 32, from 32 to 1024")]
    Samples(u32),
    /// At least one set, at most eight.
    #[error("{0} sample sets: must be 1 to 8")]
    Sets(u32),
}

/// Where light comes from. World space, metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// A planar convex polygon; it emits to the side from which its corners run anticlockwise. Corners all in one line or in
    /// one place make a line or a point that emits to all sides.
    Polygon(Vec<DVec3>),
    /// A parallelepiped of samples: its middle and half its three axes.
    Box {
        /// The middle.
        centre: DVec3,
        /// From the middle to the middle of three faces.
        half_axes: [DVec3; 3],
    },
    /// A ball of samples.
    Ball {
        /// The middle.
        centre: DVec3,
        /// Not negative.
        radius: f64,
    },
}

/// How a light is sampled: jittered on a grid of equal areas (or volumes), 32 neighbours a group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Samples a set: a multiple of 32, at most [`MAX_SAMPLES`].
    pub samples: u32,
    /// Different sets, at most [`MAX_SETS`]; a receiver uses one.
    pub sets: u32,
    /// Where the jitter starts.
    pub seed: u64,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            samples: 256,
            sets: 8,
            seed: 1,
        }
    }
}

/// An axis-aligned box in light space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Box3 {
    pub(crate) min: [f32; 3],
    pub(crate) max: [f32; 3],
}

impl Box3 {
    pub(crate) const EMPTY: Self = Self {
        min: [f32::INFINITY; 3],
        max: [f32::NEG_INFINITY; 3],
    };

    pub(crate) fn add(&mut self, point: [f32; 3]) {
        for (axis, place) in point.into_iter().enumerate() {
            self.min[axis] = self.min[axis].min(place);
            self.max[axis] = self.max[axis].max(place);
        }
    }

    pub(crate) fn union(mut self, other: &Self) -> Self {
        self.add(other.min);
        self.add(other.max);
        self
    }

    pub(crate) fn padded(mut self, by: f32) -> Self {
        self.min = self.min.map(|x| x - by);
        self.max = self.max.map(|x| x + by);
        self
    }

    pub(crate) fn half_area(&self) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|axis| (self.max[axis] - self.min[axis]).max(0.));
        x * y + y * z + z * x
    }

    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|axis| self.min[axis] <= other.max[axis] && other.min[axis] <= self.max[axis])
    }

    pub(crate) fn max_abs(&self) -> f32 {
        let all = self.min.iter().chain(&self.max);
        all.fold(0., |most: f32, x| most.max(x.abs()))
    }

    /// The eight corners.
    pub(crate) fn corners(&self) -> [[f32; 3]; 8] {
        std::array::from_fn(|corner| {
            std::array::from_fn(|axis| {
                if corner >> axis & 1 == 0 {
                    self.min[axis]
                } else {
                    self.max[axis]
                }
            })
        })
    }
}

/// Bounds of sixteen rows of samples in all sets, by coordinate.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct RowBounds {
    /// Axis, then low and high, then row. NaN where there is no row: such a one is never met.
    pub(crate) rows: [[[f32; LANES]; 2]; 3],
}

/// Sixteen neighbouring samples of a set.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(crate) struct SampleRow(pub(crate) [[f32; LANES]; 3]);

/// A light with its samples.
///
/// Light space has its origin in the light's middle; of a planar light, z is its normal and the light lies in z = 0.
#[derive(Clone, Debug)]
pub struct Light {
    shape: Shape,
    sampling: Sampling,
    origin: DVec3,
    /// World to light, rotation alone.
    rotation: DMat3,
    planar: bool,
    pub(crate) bounds: Box3,
    pub(crate) group_bounds: Vec<Box3>,
    pub(crate) row_bounds: Vec<RowBounds>,
    /// Set after set, two rows a group.
    pub(crate) rows: Vec<SampleRow>,
    /// The same in world space.
    places: Vec<Vec3>,
}

impl Light {
    /// Places the samples.
    ///
    /// # Errors
    /// [`LightError`] where the shape has nothing finite, or the numbers of samples or sets are out of range.
    pub fn new(shape: Shape, sampling: Sampling) -> Result<Self, LightError> {
        let Sampling { samples, sets, .. } = sampling;
        if samples == 0 || samples > MAX_SAMPLES || !samples.is_multiple_of(GROUP as u32) {
            return Err(LightError::Samples(samples));
        }
        if sets == 0 || sets > MAX_SETS {
            return Err(LightError::Sets(sets));
        }
        let area = strata::Area::new(&shape).ok_or(LightError::Shape)?;
        let (origin, rotation) = area.frame();
        let grid = Grid::new(samples / GROUP as u32, &area);
        let mut light = Self {
            planar: area.is_planar(),
            shape,
            sampling,
            origin,
            rotation,
            bounds: Box3::EMPTY,
            group_bounds: vec![Box3::EMPTY; (samples as usize) / GROUP],
            row_bounds: Vec::new(),
            rows: Vec::new(),
            places: Vec::new(),
        };
        for set in 0..sets {
            light.add_set(&area, &grid, set);
        }
        light.bound_rows();
        for set in 0..sets {
            for sample in 0..samples {
                let place = light.sample(set, sample).as_vec3();
                light.places.push(place);
            }
        }
        Ok(light)
    }

    fn add_set(&mut self, area: &strata::Area, grid: &Grid, set: u32) {
        for group in 0..self.groups() {
            let places: [[f32; 3]; GROUP] = std::array::from_fn(|i| {
                let unit = grid.jittered(group, i, u64::from(set) ^ self.sampling.seed << 3);
                let mut place = self.to_light(area.at(unit));
                if self.planar {
                    place[2] = 0.;
                }
                place
            });
            for place in places {
                self.group_bounds[group].add(place);
            }
            for half in places.as_chunks::<LANES>().0 {
                let row = |axis: usize| half.map(|place| place[axis]);
                self.rows.push(SampleRow([row(0), row(1), row(2)]));
            }
        }
    }

    fn bound_rows(&mut self) {
        for bounds in &self.group_bounds {
            self.bounds = self.bounds.union(bounds);
        }
        let every = self.rows_a_set();
        let mut bounds = vec![Box3::EMPTY; every];
        for (i, row) in self.rows.iter().enumerate() {
            for lane in 0..LANES {
                bounds[i % every].add(row.0.map(|values| values[lane]));
            }
        }
        for chunk in bounds.chunks(LANES) {
            let mut rows = [[[f32::NAN; LANES]; 2]; 3];
            for (lane, bounds) in chunk.iter().enumerate() {
                for (axis, row) in rows.iter_mut().enumerate() {
                    row[0][lane] = bounds.min[axis];
                    row[1][lane] = bounds.max[axis];
                }
            }
            self.row_bounds.push(RowBounds { rows });
        }
    }

    /// The shape it was made of.
    #[must_use]
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// How it is sampled.
    #[must_use]
    pub fn sampling(&self) -> Sampling {
        self.sampling
    }

    /// Whether it lies in a plane and emits to one side of it.
    #[must_use]
    pub fn is_planar(&self) -> bool {
        self.planar
    }

    /// Groups a set; each is a word of a mask.
    #[must_use]
    pub fn groups(&self) -> usize {
        self.sampling.samples as usize / GROUP
    }

    /// A sample in world space. A mask has its bit in word `sample / 32`, bit `sample % 32`.
    ///
    /// # Panics
    /// If there is no such set or sample.
    #[must_use]
    pub fn sample(&self, set: u32, sample: u32) -> DVec3 {
        self.to_world(self.local_sample(set, sample))
    }

    /// A sample in light space.
    pub(crate) fn local_sample(&self, set: u32, sample: u32) -> [f32; 3] {
        let (row, lane) = (sample as usize / LANES, sample as usize % LANES);
        let row = &self.rows[set as usize * self.rows_a_set() + row];
        row.0.map(|values| values[lane])
    }

    /// The samples of a set in world space.
    pub(crate) fn places(&self, set: u32) -> &[Vec3] {
        let samples = self.sampling.samples as usize;
        &self.places[set as usize * samples..][..samples]
    }

    /// The two rows of a group.
    #[inline(always)]
    pub(crate) fn group(&self, set: u32, group: usize) -> &[SampleRow] {
        let first = set as usize * self.rows_a_set() + 2 * group;
        &self.rows[first..first + 2]
    }

    /// A row of sixteen samples.
    #[inline(always)]
    pub(crate) fn row(&self, set: u32, row: usize) -> &SampleRow {
        &self.rows[set as usize * self.rows_a_set() + row]
    }

    pub(crate) fn rows_a_set(&self) -> usize {
        self.sampling.samples as usize / LANES
    }

    /// A point of world space in light space.
    pub(crate) fn to_light(&self, point: DVec3) -> [f32; 3] {
        (self.rotation * (point - self.origin)).as_vec3().to_array()
    }

    /// A direction of world space in light space.
    pub(crate) fn rotate(&self, direction: Vec3) -> [f32; 3] {
        (self.rotation * direction.as_dvec3()).as_vec3().to_array()
    }

    pub(crate) fn to_world(&self, point: [f32; 3]) -> DVec3 {
        self.rotation.transpose() * Vec3::from(point).as_dvec3() + self.origin
    }

    /// Which set the receiver of a pixel uses: neighbours differ, in no visible order.
    #[must_use]
    pub fn set_of_pixel(&self, x: u32, y: u32) -> u8 {
        (strata::mixed(u64::from(x) << 32 | u64::from(y)) % u64::from(self.sampling.sets)) as u8
    }
}
