//! Connected parts of a mesh and whether they are closed.

use rayon::prelude::*;

use crate::mesh::NONE;

/// A side of a face: its ends, lower index first; the face; whether the face runs from the lower end to the higher.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Side {
    pub(crate) ends: (u32, u32),
    pub(crate) face: u32,
    pub(crate) forward: bool,
}

impl Side {
    pub(crate) fn new(from: u32, to: u32, face: u32) -> Self {
        Self {
            ends: (from.min(to), from.max(to)),
            face,
            forward: from < to,
        }
    }
}

/// Sets that are joined.
#[derive(Clone, Debug)]
pub(crate) struct Joined(Vec<u32>);

impl Joined {
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    pub(crate) fn root(&mut self, mut item: u32) -> u32 {
        while self.0[item as usize] != item {
            let next = self.0[self.0[item as usize] as usize];
            self.0[item as usize] = next;
            item = next;
        }
        item
    }

    /// Joins `b` to `a`.
    pub(crate) fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.0[b as usize] = a;
    }
}

/// The shell of each face, and of each shell whether it is closed: along every edge as many faces run one way as the other.
pub(crate) fn shells(faces: &[[u32; 3]]) -> (Vec<u32>, Vec<bool>) {
    let mut sides: Vec<Side> = faces
        .par_iter()
        .enumerate()
        .flat_map_iter(|(face, corners)| {
            let valid = !corners.contains(&NONE);
            (0..3)
                .map(move |i| (corners[i], corners[(i + 1) % 3]))
                .filter(move |(from, to)| valid && from != to)
                .map(move |(from, to)| Side::new(from, to, face as u32))
        })
        .collect();
    sides.par_sort_unstable();
    let mut joined = Joined::new(faces.len());
    let runs = || sides.chunk_by(|a, b| a.ends == b.ends);
    for run in runs() {
        for side in &run[1..] {
            joined.join(run[0].face, side.face);
        }
    }
    let mut number = vec![NONE; faces.len()];
    let mut count = 0;
    let shell_of_face: Vec<u32> = (0..faces.len() as u32)
        .map(|face| {
            let slot = &mut number[joined.root(face) as usize];
            if *slot == NONE {
                *slot = count;
                count += 1;
            }
            *slot
        })
        .collect();
    let mut closed = vec![true; count as usize];
    for (face, corners) in faces.iter().enumerate() {
        if corners.contains(&NONE) {
            closed[shell_of_face[face] as usize] = false;
        }
    }
    for run in runs() {
        let forward = run.iter().filter(|side| side.forward).count();
        if 2 * forward != run.len() {
            closed[shell_of_face[run[0].face as usize] as usize] = false;
        }
    }
    (shell_of_face, closed)
}
