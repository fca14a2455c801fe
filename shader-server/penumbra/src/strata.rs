//! Equal strata of a light's shape.

use std::f64::consts::TAU;

use glam::{DMat3, DVec3};

use crate::light::Shape;

/// A shape onto which the unit square or cube is mapped so that equal parts of it are equally large.
#[derive(Debug)]
pub(crate) enum Area {
    /// Corner and two sides.
    Parallelogram(DVec3, [DVec3; 2]),
    /// Triangles from the first corner, with the share of the area up to the end of each.
    Fan(Vec<DVec3>, Vec<f64>),
    Line(DVec3, DVec3),
    /// Corner and three sides.
    Box(DVec3, [DVec3; 3]),
    Ball(DVec3, f64),
}

impl Area {
    /// None if a number is not finite or there is no corner.
    pub(crate) fn new(shape: &Shape) -> Option<Self> {
        match shape {
            Shape::Polygon(corners) => Self::of_polygon(corners),
            Shape::Box { centre, half_axes } => {
                let corner = *centre - half_axes.iter().sum::<DVec3>();
                let finite = corner.is_finite() && half_axes.iter().all(|a| a.is_finite());
                finite.then(|| Self::Box(corner, half_axes.map(|a| 2. * a)))
            }
            Shape::Ball { centre, radius } => {
                (centre.is_finite() && radius.is_finite() && *radius >= 0.)
                    .then_some(Self::Ball(*centre, *radius))
            }
        }
    }

    fn of_polygon(corners: &[DVec3]) -> Option<Self> {
        let first = *corners.first()?;
        if !corners.iter().all(|c| c.is_finite()) {
            return None;
        }
        let size = corners.iter().map(|c| c.distance(first)).fold(0., f64::max);
        let mut shares = vec![0.];
        for pair in corners[1..].windows(2) {
            let area = (pair[0] - first).cross(pair[1] - first).length();
            shares.push(shares.last().copied().unwrap_or(0.) + area);
        }
        let total = shares.last().copied().unwrap_or(0.);
        if total <= 1e-12 * size * size {
            // The farthest two corners.
            let far = |from: DVec3| {
                let by = |a: &&DVec3, b: &&DVec3| a.distance(from).total_cmp(&b.distance(from));
                corners.iter().max_by(by).copied().unwrap_or(from)
            };
            let end = far(first);
            return Some(Self::Line(far(end), end));
        }
        if let &[a, b, c, d] = corners
            && ((a + c) - (b + d)).length() <= 1e-9 * size
        {
            return Some(Self::Parallelogram(a, [b - a, d - a]));
        }
        shares.iter_mut().for_each(|share| *share /= total);
        Some(Self::Fan(corners.to_vec(), shares))
    }

    pub(crate) fn is_planar(&self) -> bool {
        matches!(self, Self::Parallelogram(..) | Self::Fan(..))
    }

    /// How many coordinates of the unit cube matter.
    fn dimensions(&self) -> usize {
        match self {
            Self::Parallelogram(..) | Self::Fan(..) => 2,
            Self::Line(..) => 1,
            Self::Box(..) | Self::Ball(..) => 3,
        }
    }

    /// Rough size along each coordinate of the unit cube.
    fn extents(&self) -> [f64; 3] {
        match self {
            Self::Parallelogram(_, [x, y]) => [x.length(), y.length(), 0.],
            Self::Box(_, sides) => sides.map(DVec3::length),
            Self::Line(from, to) => [from.distance(*to), 0., 0.],
            Self::Fan(..) | Self::Ball(..) => [1.; 3],
        }
    }

    /// Origin of light space and rotation from world to it.
    pub(crate) fn frame(&self) -> (DVec3, DMat3) {
        let from_sides = |x: DVec3, y: DVec3| {
            let z = x.cross(y).normalize_or(DVec3::Z);
            let x = x.normalize_or(DVec3::X);
            DMat3::from_cols(x, z.cross(x), z).transpose()
        };
        match self {
            Self::Parallelogram(corner, [x, y]) => (*corner + 0.5 * (*x + *y), from_sides(*x, *y)),
            Self::Fan(corners, _) => {
                let middle = corners.iter().sum::<DVec3>() / corners.len() as f64;
                let normal = (1..corners.len() - 1)
                    .map(|i| (corners[i] - corners[0]).cross(corners[i + 1] - corners[0]))
                    .sum::<DVec3>();
                let longest = (0..corners.len())
                    .map(|i| corners[(i + 1) % corners.len()] - corners[i])
                    .max_by(|a, b| a.length().total_cmp(&b.length()));
                let x = longest.unwrap_or(DVec3::X);
                (middle, from_sides(x, normal.cross(x)))
            }
            Self::Line(from, to) => (from.midpoint(*to), DMat3::IDENTITY),
            Self::Box(corner, [x, y, z]) => (*corner + 0.5 * (*x + *y + *z), from_sides(*x, *y)),
            Self::Ball(centre, _) => (*centre, DMat3::IDENTITY),
        }
    }

    /// The place that a place in the unit cube stands for.
    pub(crate) fn at(&self, [x, y, z]: [f64; 3]) -> DVec3 {
        match self {
            Self::Parallelogram(corner, sides) => *corner + x * sides[0] + y * sides[1],
            Self::Fan(corners, shares) => {
                let last = shares.len() - 2;
                let i = shares[1..].partition_point(|share| *share < x).min(last);
                let share = (shares[i + 1] - shares[i]).max(f64::MIN_POSITIVE);
                let along = ((x - shares[i]) / share).clamp(0., 1.);
                let rim = corners[i + 1].lerp(corners[i + 2], along);
                corners[0].lerp(rim, y.sqrt())
            }
            Self::Line(from, to) => from.lerp(*to, x),
            Self::Box(corner, sides) => *corner + x * sides[0] + y * sides[1] + z * sides[2],
            Self::Ball(centre, radius) => {
                let height = 1. - 2. * y;
                let ring = (1. - height * height).max(0.).sqrt();
                let (sin, cos) = (TAU * z).sin_cos();
                *centre + *radius * x.cbrt() * DVec3::new(ring * cos, height, ring * sin)
            }
        }
    }
}

/// Strata of a group along each side of a flat light.
const FLAT: [u32; 3] = [8, 4, 1];

/// How the unit cube is cut into groups, and groups into strata.
#[derive(Debug)]
pub(crate) struct Grid {
    groups: [u32; 3],
    cells: [u32; 3],
}

impl Grid {
    /// The cut whose strata are least drawn out.
    pub(crate) fn new(groups: u32, area: &Area) -> Self {
        let extents = area.extents();
        let cells = match area.dimensions() {
            1 => [32, 1, 1],
            2 => FLAT,
            _ => [4, 4, 2],
        };
        let mut best = (f64::INFINITY, [groups, 1, 1]);
        for x in (1..=groups).filter(|x| groups.is_multiple_of(*x)) {
            for y in (1..=groups / x).filter(|y| (groups / x).is_multiple_of(*y)) {
                let cut = [x, y, groups / (x * y)];
                let sides = (0..area.dimensions())
                    .map(|i| extents[i].max(1e-9) / f64::from(cut[i] * cells[i]));
                let (low, high) = sides.fold((f64::INFINITY, 0.), |(low, high): (f64, f64), s| {
                    (low.min(s), high.max(s))
                });
                let used = area.dimensions();
                if cut[used..].iter().all(|c| *c == 1) && high / low < best.0 {
                    best = (high / low, cut);
                }
            }
        }
        Self {
            groups: best.1,
            cells,
        }
    }

    /// A place in a stratum of the unit cube.
    pub(crate) fn jittered(&self, group: usize, sample: usize, seed: u64) -> [f64; 3] {
        let (mut group, mut cell) = (group as u32, sample as u32);
        let mut bits = mixed(seed ^ (u64::from(group) << 40 | u64::from(cell) << 24));
        if self.cells == FLAT {
            // Each sixteen are a square of their own.
            cell = cell % 4 + 4 * (cell / 16) + 8 * (cell / 4 % 4);
        }
        std::array::from_fn(|axis| {
            let (groups, cells) = (self.groups[axis], self.cells[axis]);
            let index = group % groups * cells + cell % cells;
            group /= groups;
            cell /= cells;
            bits = mixed(bits);
            let jitter = (bits >> 11) as f64 / (1u64 << 53) as f64;
            (f64::from(index) + jitter) / f64::from(groups * cells)
        })
    }
}

/// Well-mixed bits (splitmix64, Steele, Lea and Flood 2014).
pub(crate) fn mixed(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
