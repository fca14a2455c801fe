//! Depth discontinuities between two rows: outlines along the light, whose shadows are hard.
//!
//! Visibility between rows is interpolated; across such an outline it is not, but is that of the row on the same side.

use crate::discontinuity::is_step;

/// Fewest columns of a seam: outlines that cross rows more steeply are those of the rows themselves.
const LEAST: usize = 3;

/// A run of columns in which one of two neighbouring rows is much nearer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seam {
    /// First column and last.
    pub(crate) columns: [u32; 2],
    /// Two columns a quarter of the run from its ends, which are often at corners.
    places: [u32; 2],
    /// Where the outline is at these, as share of the way from one row to the other.
    share: [f32; 2],
    /// Reciprocal distances of both rows at these.
    inverse: [[f32; 2]; 2],
}

/// Finds the seams between the second and the third of four rows, `step` radians apart.
pub(crate) fn find(rows: [&[f32]; 4], step: f32, seams: &mut Vec<Seam>) {
    let count = rows.iter().map(|row| row.len()).min().unwrap_or(0);
    let steps = |column: usize| {
        let at = |i: isize| rows[(i + 1) as usize][column];
        let near_low = at(0) > at(1);
        is_step(&at, 0, near_low, step).then_some(near_low)
    };
    let mut start = 0;
    let mut side = None;
    for column in 0..=count {
        let here = if column < count { steps(column) } else { None };
        if here != side {
            if side.is_some() && column - start >= LEAST {
                let last = column - 1;
                let inset = (last - start) / 4;
                let places = [start + inset, last - inset];
                seams.push(Seam {
                    columns: [start, last].map(|c| c as u32),
                    places: places.map(|c| c as u32),
                    share: [0.5; 2],
                    inverse: places.map(|c| [rows[1][c], rows[2][c]]),
                });
            }
            (start, side) = (column, here);
        }
    }
}

impl Seam {
    /// Finds where between its rows, the first of which is at `phi`, the outline is at both places, with `halvings` more
    /// distances each from `ask`, which takes a column and an angle.
    pub(crate) fn place(
        &mut self,
        phi: f32,
        step: f32,
        halvings: u32,
        ask: impl Fn(usize, f32) -> f32,
    ) {
        for end in 0..2 {
            let (mut low, mut high) = (0f32, 1f32);
            let [mut below, mut above] = self.inverse[end];
            for _ in 0..halvings {
                let middle = 0.5 * (low + high);
                let inverse = ask(self.places[end] as usize, phi + middle * step);
                if (inverse - below).abs() < (inverse - above).abs() {
                    (low, below) = (middle, inverse);
                } else {
                    (high, above) = (middle, inverse);
                }
            }
            self.share[end] = 0.5 * (low + high);
        }
    }
}

/// Which of two rows, 0 or 1, is on the same side of the seam, if there is one at `column`, as a point `share` of the way
/// from one to the other.
#[inline]
pub(crate) fn side(seams: &[Seam], column: usize, share: f32) -> Option<usize> {
    let after = seams.partition_point(|seam| (seam.columns[1] as usize) < column);
    let seam = seams.get(after)?;
    let [from, to] = seam.places.map(|c| c as f32);
    let along = (column as f32 - from) / (to - from).max(1.);
    let there = seam.share[0] + (seam.share[1] - seam.share[0]) * along;
    (column >= seam.columns[0] as usize).then(|| usize::from(share >= there))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_is_found_and_placed_at_its_slope() {
        // Nearer below a line that rises from 0.2 to 0.8 of the way between the rows.
        let outline = |column: usize| 0.2 + 0.6 * column as f32 / 20.;
        let distance = |column: usize, at: f32| if at < outline(column) { 1. } else { 0.3 };
        let row = |at: f32| (0..21).map(|c| distance(c, at)).collect::<Vec<f32>>();
        let rows = [row(-1.), row(0.), row(1.), row(2.)];
        let mut seams = Vec::new();
        find([&rows[0], &rows[1], &rows[2], &rows[3]], 0.01, &mut seams);
        assert_eq!(seams.len(), 1);
        seams[0].place(3., 0.01, 6, |column, phi| {
            distance(column, (phi - 3.) / 0.01)
        });
        for column in 0..21 {
            assert_eq!(side(&seams, column, outline(column) - 0.03), Some(0));
            assert_eq!(side(&seams, column, outline(column) + 0.03), Some(1));
        }
        assert_eq!(side(&seams, 21, 0.5), None);
        // A slope across rows is none.
        let slope: Vec<Vec<f32>> = (0..4).map(|r| vec![1. - 0.2 * r as f32; 9]).collect();
        seams.clear();
        find(
            [&slope[0], &slope[1], &slope[2], &slope[3]],
            0.01,
            &mut seams,
        );
        assert!(seams.is_empty());
    }
}
