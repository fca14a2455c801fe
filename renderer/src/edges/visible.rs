//! The parts of edges that can be seen.

use super::clip::ImageSegment;
use super::crossings::Crossings;

/// Parts of edges, as parallel arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct VisibleEdges {
    /// Index in the [`EdgeList`](super::list::EdgeList).
    pub edge: Vec<u32>,
    /// The whole edge in the picture.
    pub segment: Vec<ImageSegment>,
    /// The part that is seen, 0..1 along the segment in image space.
    pub range: Vec<[f64; 2]>,
}

impl VisibleEdges {
    /// How many parts there are.
    pub fn len(&self) -> usize {
        self.edge.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.edge.is_empty()
    }

    /// Forgets all parts and keeps the memory.
    pub fn clear(&mut self) {
        self.edge.clear();
        self.segment.clear();
        self.range.clear();
    }

    /// Adds a part of an edge.
    pub fn push(&mut self, edge: u32, segment: ImageSegment, range: [f64; 2]) {
        self.edge.push(edge);
        self.segment.push(segment);
        self.range.push(range);
    }

    /// Adds all parts of others of the same list.
    pub fn extend(&mut self, others: &Self) {
        self.edge.extend_from_slice(&others.edge);
        self.segment.extend_from_slice(&others.segment);
        self.range.extend_from_slice(&others.range);
    }

    /// Records the crossings of all parts, those with lines through the middle of pixels too if `half` is set. Parts of
    /// one edge that touch cross each line once.
    pub fn draw(&self, half: bool, out: &mut Crossings) {
        for (segment, range) in self.segment.iter().zip(&self.range) {
            out.draw_part(segment, *range, half);
        }
    }
}
