//! Where labels go in a chart, so that they hide neither points nor one another. All in pixels, y down.

/// Half the side of a point's mark.
const MARK: i32 = 5;
/// Width of a digit and height of a line of labels.
const DIGIT: i32 = 7;
const LINE: i32 = 11;
/// How far apart marks stand for a line, so that no label fits between them.
const LINE_STEP: i32 = 6;
/// Height of a legend's row, and its width.
const LEGEND_ROW: i32 = 17;
const LEGEND_WIDTH: i32 = 210;

/// Offsets of a label's upper left corner from its point, best first: beside it, above, below, then further out.
const OFFSETS: [(i32, i32); 14] = [
    (7, -5),
    (-14, -5),
    (-3, -17),
    (-3, 7),
    (7, -16),
    (-14, -16),
    (7, 6),
    (-14, 6),
    (17, -5),
    (-24, -5),
    (-3, -28),
    (-3, 18),
    (17, -18),
    (-24, 17),
];

/// A rectangle: left, top, right, bottom.
type Rectangle = (i32, i32, i32, i32);

fn overlap(a: Rectangle, b: Rectangle) -> bool {
    a.0 < b.2 && b.0 < a.2 && a.1 < b.3 && b.1 < a.3
}

fn mark(&(x, y): &(i32, i32)) -> Rectangle {
    (x - MARK, y - MARK, x + MARK, y + MARK)
}

fn label(&(x, y): &(i32, i32), (dx, dy): (i32, i32), digits: i32) -> Rectangle {
    (x + dx, y + dy, x + dx + DIGIT * digits, y + dy + LINE)
}

/// Marks that stand for the lines through these points.
pub(super) fn along(points: &[(i32, i32)]) -> Vec<(i32, i32)> {
    let mut marks = Vec::new();
    for pair in points.windows(2) {
        let [(x, y), (to_x, to_y)] = [pair[0], pair[1]];
        let steps = ((to_x - x).abs().max((to_y - y).abs()) / LINE_STEP).max(1);
        marks.extend((0..steps).map(|k| (x + (to_x - x) * k / steps, y + (to_y - y) * k / steps)));
    }
    marks
}

/// For each of `points`, numbered from 1, the offset of its number that meets the fewest numbers before it and marks.
/// `marks` are all points drawn, these among them.
pub(super) fn offsets(points: &[(i32, i32)], marks: &[(i32, i32)]) -> Vec<(i32, i32)> {
    let mut taken: Vec<Rectangle> = marks.iter().map(mark).collect();
    let mut offsets = Vec::with_capacity(points.len());
    for (i, point) in points.iter().enumerate() {
        let digits = (i + 1).to_string().len() as i32;
        let met = |offset: &(i32, i32)| {
            let own = label(point, *offset, digits);
            taken.iter().filter(|other| overlap(own, **other)).count()
        };
        let best = OFFSETS.into_iter().min_by_key(met).unwrap_or_default();
        taken.push(label(point, best, digits));
        offsets.push(best);
    }
    offsets
}

/// A corner of the plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Corner {
    LowerLeft,
    UpperRight,
    LowerRight,
    UpperLeft,
}

/// The corner in which a legend of so many rows hides the fewest marks.
pub(super) fn legend(plot: (i32, i32, i32, i32), rows: usize, marks: &[(i32, i32)]) -> Corner {
    let (left, top, right, bottom) = plot;
    let (width, height) = (LEGEND_WIDTH, LEGEND_ROW * rows as i32 + 10);
    let corners = [
        (
            Corner::LowerLeft,
            (left, bottom - height, left + width, bottom),
        ),
        (
            Corner::UpperRight,
            (right - width, top, right, top + height),
        ),
        (
            Corner::LowerRight,
            (right - width, bottom - height, right, bottom),
        ),
        (Corner::UpperLeft, (left, top, left + width, top + height)),
    ];
    let hidden =
        |(_, area): &(Corner, Rectangle)| marks.iter().filter(|m| overlap(mark(m), *area)).count();
    let best = corners.into_iter().min_by_key(hidden);
    best.map_or(Corner::LowerLeft, |(corner, _)| corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lone_point_has_its_number_to_the_right() {
        assert_eq!(offsets(&[(50, 50)], &[(50, 50)]), [OFFSETS[0]]);
    }

    #[test]
    fn numbers_of_close_points_hide_neither_marks_nor_one_another() {
        let points = [
            (100, 100),
            (108, 102),
            (116, 99),
            (112, 110),
            (300, 20),
            (309, 25),
        ];
        let lines = [(92, 101), (124, 97), (305, 30)];
        let marks: Vec<_> = points.iter().chain(&lines).copied().collect();
        let offsets = offsets(&points, &marks);
        let labels: Vec<_> = points
            .iter()
            .zip(&offsets)
            .map(|(p, o)| label(p, *o, 1))
            .collect();
        for (i, own) in labels.iter().enumerate() {
            assert!(
                marks.iter().all(|m| !overlap(*own, mark(m))),
                "{i}: {own:?}"
            );
            assert!(
                labels[..i].iter().all(|other| !overlap(*own, *other)),
                "{i}: {own:?}"
            );
        }
    }

    #[test]
    fn a_number_keeps_off_a_line() {
        let line = along(&[(0, 100), (200, 96)]);
        assert!(line.len() > 30 && line.iter().all(|(_, y)| (96..=100).contains(y)));
        let point = (100, 98);
        let marks: Vec<_> = line.iter().copied().chain([point]).collect();
        let own = label(&point, offsets(&[point], &marks)[0], 1);
        assert!(marks.iter().all(|m| !overlap(own, mark(m))), "{own:?}");
        assert!(along(&[point]).is_empty());
    }

    #[test]
    fn a_legend_goes_where_there_is_nothing() {
        let plot = (60, 30, 740, 400);
        assert_eq!(legend(plot, 4, &[]), Corner::LowerLeft);
        assert_eq!(legend(plot, 4, &[(80, 380)]), Corner::UpperRight);
        let marks = [(80, 380), (700, 50), (100, 50)];
        assert_eq!(legend(plot, 4, &marks), Corner::LowerRight);
    }
}
