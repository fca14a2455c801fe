//! Chains: linked tori along a curve, checked not to touch.

use glam::DVec3;
use protocol::scene::Affine;
use serde::Deserialize;

use super::builder::Builder;
use super::limits::{counts, less, positive};
use super::params::{across, around};
use super::{Made, MeshCopy, round};

/// A chain's shape. Its links are at equal distances along a Catmull-Rom spline through `keys`, turned in turn by `roll`
/// one way and the other about the curve.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ChainSpec {
    /// Points that the links' middles follow, metres.
    pub(crate) keys: Vec<[f32; 3]>,
    /// Joins the last link to the first.
    #[serde(default)]
    pub(crate) closed: bool,
    /// How many links.
    pub(crate) links: u32,
    /// Radius of a link's ring, metres.
    pub(crate) major: f32,
    /// Radius of its tube, metres.
    pub(crate) minor: f32,
    /// Degrees, 45 turns each link a quarter against the next.
    #[serde(default = "roll")]
    pub(crate) roll: f32,
    #[serde(default = "around")]
    pub(crate) around: u32,
    #[serde(default = "across")]
    pub(crate) across: u32,
}

fn roll() -> f32 {
    45.0
}

/// A torus' centre line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ring {
    pub(crate) centre: DVec3,
    /// Along the chain, in the ring's plane.
    pub(crate) along: DVec3,
    /// Unit normal of the ring's plane.
    pub(crate) axis: DVec3,
    pub(crate) radius: f64,
}

/// Makes one torus and a copy for each link.
///
/// # Errors
/// What is wrong with which parameter; which links touch or hang on nothing.
pub(super) fn chain(spec: &ChainSpec) -> Result<Made, String> {
    positive("minor", spec.minor)?;
    less("twice minor", 2.0 * spec.minor, "major", spec.major)?;
    counts(&[
        ("around", spec.around, 3),
        ("across", spec.across, 3),
        ("links", spec.links, 2),
    ])?;
    if spec.links > 4096 {
        return Err(format!("links = {} must be at most 4096", spec.links));
    }
    if !spec.roll.is_finite() || !spec.keys.iter().flatten().all(|x| x.is_finite()) {
        return Err("roll and keys must be finite".into());
    }
    let least = if spec.closed { 3 } else { 2 };
    if spec.keys.len() < least || spec.keys.len() > 4096 {
        return Err(format!("keys must be {least} to 4096 points"));
    }
    let rings = rings(spec)?;
    check_links(spec, &rings)?;
    let mut b = Builder::default();
    round::torus(&mut b, spec.major, spec.minor, spec.around, spec.across);
    let copies = rings.iter().enumerate().map(|(i, ring)| MeshCopy {
        name: Some((i + 1).to_string()),
        mesh: 0,
        transform: ring.transform(),
    });
    Ok(Made {
        copies: copies.collect(),
        meshes: vec![b.finish()],
    })
}

impl Ring {
    /// From a torus about the y axis to this one.
    fn transform(&self) -> Affine {
        let (x, y) = (self.along, self.axis);
        let z = x.cross(y);
        std::array::from_fn(|r| [x[r], y[r], z[r], self.centre[r]].map(|v| v as f32 + 0.0))
    }

    fn at(&self, turn: f64) -> DVec3 {
        let (sin, cos) = turn.sin_cos();
        let across = self.along.cross(self.axis);
        self.centre + (self.along * cos + across * sin) * self.radius
    }

    fn distance_to(&self, p: DVec3) -> f64 {
        let d = p - self.centre;
        let up = d.dot(self.axis);
        let out = (d.length_squared() - up * up).max(0.0).sqrt();
        up.hypot(out - self.radius)
    }

    /// Least distance between two circles: the best of many starts, then refined between its neighbours.
    pub(crate) fn distance(&self, other: &Self) -> f64 {
        const STARTS: i32 = 180;
        let step = std::f64::consts::TAU / f64::from(STARTS);
        let far = |turn: f64| other.distance_to(self.at(turn));
        let mut least = f64::INFINITY;
        let mut best = 0.0;
        for i in 0..STARTS {
            let d = far(f64::from(i) * step);
            if d < least {
                (least, best) = (d, f64::from(i) * step);
            }
        }
        let (mut low, mut high) = (best - step, best + step);
        for _ in 0..40 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if far(a) < far(b) { high = b } else { low = a }
        }
        least.min(far(0.5 * (low + high)))
    }

    /// True if the other circle passes through this one's disc an odd number of times.
    pub(crate) fn is_linked(&self, other: &Self) -> bool {
        const STEPS: i32 = 360;
        let height = |i: i32| {
            let p = other.at(f64::from(i) / f64::from(STEPS) * std::f64::consts::TAU);
            (p, (p - self.centre).dot(self.axis))
        };
        let mut passes = 0;
        for i in 0..STEPS {
            let ((p, a), (q, b)) = (height(i), height(i + 1));
            if (a < 0.0) != (b < 0.0) {
                let hit = p.lerp(q, a / (a - b));
                passes += i32::from((hit - self.centre).length() < self.radius);
            }
        }
        passes % 2 == 1
    }
}

/// The links' centre lines.
fn rings(spec: &ChainSpec) -> Result<Vec<Ring>, String> {
    let curve = polyline(&spec.keys, spec.closed);
    let mut lengths = vec![0.0];
    for w in curve.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + (w[1] - w[0]).length());
    }
    let total = lengths[lengths.len() - 1];
    if total <= 0.0 {
        return Err("keys must not all be one point".into());
    }
    let gaps = if spec.closed {
        spec.links
    } else {
        spec.links - 1
    };
    let mut side = DVec3::ZERO;
    let mut rings = Vec::with_capacity(spec.links as usize);
    for i in 0..spec.links {
        let s = total * f64::from(i) / f64::from(gaps);
        let k = lengths
            .partition_point(|l| *l <= s)
            .clamp(1, curve.len() - 1);
        let span = lengths[k] - lengths[k - 1];
        let along = (curve[k] - curve[k - 1]).normalize_or(DVec3::X);
        let centre = curve[k - 1].lerp(
            curve[k],
            if span > 0.0 {
                (s - lengths[k - 1]) / span
            } else {
                0.0
            },
        );
        // The sideways direction is carried along with as little turning as can be.
        let start = if i == 0 { along.cross(DVec3::Y) } else { side };
        side = (start - along * start.dot(along)).normalize_or(along.any_orthonormal_vector());
        let up = side.cross(along);
        let sign = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let (sin, cos) = (sign * f64::from(spec.roll).to_radians()).sin_cos();
        rings.push(Ring {
            centre,
            along,
            axis: up * cos + side * sin,
            radius: f64::from(spec.major),
        });
    }
    Ok(rings)
}

/// Points close together on the spline through `keys`.
fn polyline(keys: &[[f32; 3]], closed: bool) -> Vec<DVec3> {
    const STEPS: u32 = 64;
    let points: Vec<DVec3> = keys
        .iter()
        .map(|k| DVec3::from_array(k.map(f64::from)))
        .collect();
    let n = points.len();
    let at = |i: isize| match (closed, i) {
        (true, i) => points[i.rem_euclid(n as isize) as usize],
        (false, -1) => points[0] * 2.0 - points[1],
        (false, i) if i as usize == n => points[n - 1] * 2.0 - points[n - 2],
        (false, i) => points[i as usize],
    };
    let spans = if closed { n } else { n - 1 } as isize;
    let mut curve = vec![points[0]];
    for i in 0..spans {
        let (a, b, c, d) = (at(i - 1), at(i), at(i + 1), at(i + 2));
        for step in 1..=STEPS {
            let u = f64::from(step) / f64::from(STEPS);
            let cube = (d - a) * 0.5 + (b - c) * 1.5;
            let square = a - b * 2.5 + c * 2.0 - d * 0.5;
            curve.push(b + ((c - a) * 0.5 + (square + cube * u) * u) * u);
        }
    }
    curve
}

/// How far a link's facets may bulge beyond its round tube: chords cut across the inner side of the ring.
pub(crate) fn bulge(major: f32, minor: f32, around: u32) -> f64 {
    f64::from(major - minor) * (1.0 - (std::f64::consts::PI / f64::from(around)).cos())
}

fn check_links(spec: &ChainSpec, rings: &[Ring]) -> Result<(), String> {
    let clearance = 2.0 * (f64::from(spec.minor) + bulge(spec.major, spec.minor, spec.around));
    let n = rings.len();
    for i in 0..n {
        for j in i + 1..n {
            let next = j == i + 1 || spec.closed && n > 2 && i == 0 && j == n - 1;
            if next && !rings[i].is_linked(&rings[j]) {
                return Err(format!(
                    "links {} and {} are not linked, {:.3} apart; use more links or a shorter curve",
                    i + 1,
                    j + 1,
                    (rings[i].centre - rings[j].centre).length()
                ));
            }
            if (rings[i].centre - rings[j].centre).length() > 2.0 * rings[i].radius + clearance {
                continue;
            }
            let gap = rings[i].distance(&rings[j]) - clearance;
            if gap <= 0.0 {
                return Err(format!(
                    "links {} and {} pass {:.4} into each other; use fewer or thinner links, or a \
                     smoother curve",
                    i + 1,
                    j + 1,
                    -gap
                ));
            }
        }
    }
    Ok(())
}
