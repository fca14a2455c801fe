//! Joining edges that share an end into chains, so that neighbours can share visibility tests.

/// No edge.
const NONE: u32 = u32::MAX;

/// An edge in a chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Link {
    /// Index among the edges that were joined.
    pub(super) edge: u32,
    /// The chain runs through it from its second end to its first.
    pub(super) reversed: bool,
}

/// Chains of edges. Every edge is in exactly one.
#[derive(Clone, Debug, Default)]
pub(super) struct Chains {
    links: Vec<Link>,
    starts: Vec<u32>,
    table: Vec<Meeting>,
    stamp: u32,
    visited: Vec<bool>,
}

/// Edges of one object at a vertex.
#[derive(Clone, Copy, Debug, Default)]
struct Meeting {
    stamp: u32,
    count: u32,
    edges: [u32; 2],
}

/// What joining needs to know of an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    /// Its ends meet the ends of others only within one object.
    pub(super) object: u32,
    /// Vertices at its ends.
    pub(super) vertices: [u32; 2],
    /// It may be joined at all.
    pub(super) free: bool,
}

impl Chains {
    /// Joins edges wherever exactly two meet. Edges of one object must follow each other.
    pub(super) fn join(&mut self, edges: &[Joint]) {
        self.links.clear();
        self.starts.clear();
        self.visited.clear();
        self.visited.resize(edges.len(), false);
        let mut start = 0;
        for run in edges.chunk_by(|a, b| a.object == b.object) {
            self.join_object(edges, start..start + run.len());
            start += run.len();
        }
        self.starts.push(self.links.len() as u32);
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// One of them.
    pub(super) fn get(&self, index: usize) -> &[Link] {
        &self.links[self.starts[index] as usize..self.starts[index + 1] as usize]
    }

    /// All of them.
    #[cfg(test)]
    fn iter(&self) -> impl Iterator<Item = &[Link]> {
        (0..self.len()).map(|index| self.get(index))
    }

    fn join_object(&mut self, edges: &[Joint], range: std::ops::Range<usize>) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.table.fill(Meeting::default());
            self.stamp = 1;
        }
        for i in range.clone().filter(|i| edges[*i].free) {
            for v in edges[i].vertices {
                self.meet(v, i as u32);
            }
        }
        for i in range {
            if self.visited[i] {
                continue;
            }
            let first = Link {
                edge: i as u32,
                reversed: false,
            };
            let link = if edges[i].free {
                self.first_of(edges, first)
            } else {
                first
            };
            self.starts.push(self.links.len() as u32);
            self.walk(edges, link);
        }
    }

    fn meet(&mut self, vertex: u32, edge: u32) {
        let vertex = vertex as usize;
        if self.table.len() <= vertex {
            self.table.resize(vertex + 1, Meeting::default());
        }
        let meeting = &mut self.table[vertex];
        if meeting.stamp != self.stamp {
            *meeting = Meeting {
                stamp: self.stamp,
                count: 0,
                edges: [NONE; 2],
            };
        }
        if let Some(slot) = meeting.edges.get_mut(meeting.count as usize) {
            *slot = edge;
        }
        meeting.count += 1;
    }

    /// The next edge, if exactly one other goes on from the end of this one.
    fn next(&self, edges: &[Joint], link: Link) -> Option<Link> {
        let joint = &edges[link.edge as usize];
        let end = joint.vertices[usize::from(!link.reversed)];
        let meeting = self
            .table
            .get(end as usize)
            .filter(|m| joint.free && m.stamp == self.stamp)?;
        if meeting.count != 2 || meeting.edges[0] == meeting.edges[1] {
            return None;
        }
        let edge = meeting.edges[usize::from(meeting.edges[0] == link.edge)];
        let reversed = edges[edge as usize].vertices[0] != end;
        Some(Link { edge, reversed })
    }

    /// Goes back to where the chain of an edge begins; round a loop, to the edge after it.
    fn first_of(&self, edges: &[Joint], from: Link) -> Link {
        let mut back = Link {
            reversed: !from.reversed,
            ..from
        };
        while let Some(next) = self.next(edges, back) {
            if next.edge == from.edge {
                break;
            }
            back = next;
        }
        Link {
            reversed: !back.reversed,
            ..back
        }
    }

    fn walk(&mut self, edges: &[Joint], from: Link) {
        let mut link = from;
        loop {
            self.visited[link.edge as usize] = true;
            self.links.push(link);
            match self.next(edges, link) {
                Some(next) if !self.visited[next.edge as usize] => link = next,
                _ => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 500, rng_seed: RngSeed::Fixed(3), failure_persistence: None, ..ProptestConfig::default()
        })]

        #[test]
        fn every_edge_is_in_one_chain_and_chains_hold_together(
            ends in prop::collection::vec((0_u32..9, 0_u32..9, any::<bool>()), 0..24),
            split in 0_usize..24,
        ) {
            let edges: Vec<Joint> = ends
                .iter()
                .enumerate()
                .map(|(i, (a, b, free))| Joint { object: u32::from(i >= split), vertices: [*a, *b], free: *free })
                .collect();
            let mut chains = Chains::default();
            for _ in 0..2 {
                chains.join(&edges);
                let mut seen = vec![0; edges.len()];
                for chain in chains.iter() {
                    for link in chain {
                        seen[link.edge as usize] += 1;
                    }
                    for pair in chain.windows(2) {
                        let [a, b] = [pair[0], pair[1]].map(|l| (edges[l.edge as usize], l.reversed));
                        prop_assert_eq!(a.0.vertices[usize::from(!a.1)], b.0.vertices[usize::from(b.1)]);
                        prop_assert!(a.0.object == b.0.object && a.0.free && b.0.free);
                    }
                }
                prop_assert!(seen.iter().all(|n| *n == 1));
            }
        }
    }

    #[test]
    fn a_path_is_one_chain() {
        let edges: Vec<Joint> = [[3, 2], [1, 2], [4, 3], [1, 0]]
            .map(|vertices| Joint {
                object: 0,
                vertices,
                free: true,
            })
            .to_vec();
        let mut chains = Chains::default();
        chains.join(&edges);
        assert_eq!(chains.iter().map(<[Link]>::len).collect::<Vec<_>>(), [4]);
    }
}
