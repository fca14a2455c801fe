//! What shines.

use glam::Vec3;

use crate::BuildError;

/// A light, world space, metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Light {
    /// A linear light by its ends: each piece of it shines alike in all directions.
    Segment([Vec3; 2]),
    /// A planar convex polygon, which shines on the side from which its vertices run anticlockwise. It is approximated by
    /// the linear lights of its edges, as the paper's section 4 does for a triangle.
    Polygon {
        /// Corners in order.
        vertices: Vec<Vec3>,
        /// Its own instance in the world, which blocks none of its light.
        instance: Option<u32>,
    },
}

/// A linear light as maps see it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear {
    pub(crate) ends: [Vec3; 2],
    /// Unit normal of the polygon that it is an edge of: it then shines by the cosine to this normal, on one side.
    pub(crate) facing: Option<Vec3>,
    /// Instance that blocks nothing.
    pub(crate) ignored: Option<u32>,
}

impl Light {
    /// The linear lights that stand for this one.
    pub(crate) fn linear(&self) -> Result<Vec<Linear>, BuildError> {
        match self {
            Self::Segment(ends) if ends.iter().all(|p| p.is_finite()) => Ok(vec![Linear {
                ends: *ends,
                facing: None,
                ignored: None,
            }]),
            Self::Segment(_) => Err(BuildError::NotFinite),
            Self::Polygon { vertices, instance } => {
                if !vertices.iter().all(|p| p.is_finite()) {
                    return Err(BuildError::NotFinite);
                }
                let normal = normal(vertices).ok_or(BuildError::NoArea)?;
                let next = vertices.iter().cycle().skip(1);
                let edges = vertices.iter().zip(next).filter(|(a, b)| a != b);
                Ok(edges
                    .map(|(a, b)| Linear {
                        ends: [*a, *b],
                        facing: Some(normal),
                        ignored: *instance,
                    })
                    .collect())
            }
        }
    }
}

impl Linear {
    /// Metres.
    pub(crate) fn length(&self) -> f32 {
        self.ends[0].distance(self.ends[1])
    }
}

/// Unit normal of a polygon, on the side from which it runs anticlockwise.
fn normal(vertices: &[Vec3]) -> Option<Vec3> {
    let first = vertices.first()?;
    let area: Vec3 = vertices
        .windows(2)
        .map(|pair| (pair[0] - first).cross(pair[1] - first))
        .sum();
    area.try_normalize()
}
