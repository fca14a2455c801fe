//! Charts as inline SVG, drawn by plotters.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, Ranged, ValueFormatter};
use plotters::prelude::*;
use thiserror::Error;

use super::labels::{self, Corner};
use super::table::Table;

/// Colours that differ for colour-blind readers too (Okabe and Ito).
const PALETTE: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
];
const SIZE_PX: (u32, u32) = (760, 460);

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Points joined by a line.
    Line,
    /// Points with numbers beside them; [`Chart::named`] lists what they stand for.
    Named,
    /// A horizontal dashed line at the first point's height.
    Floor,
}

/// Some points of one colour.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name in the legend.
    pub label: String,
    /// How it is drawn.
    pub mark: Mark,
    /// x, y and, for [`Mark::Named`], a name.
    pub points: Vec<(f64, f64, String)>,
}

impl Series {
    /// A line through `points`.
    pub fn line(label: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let points = points
            .into_iter()
            .map(|(x, y)| (x, y, String::new()))
            .collect();
        Self {
            label: label.to_owned(),
            mark: Mark::Line,
            points,
        }
    }

    /// Points with names, not joined.
    pub fn named(label: &str, points: impl IntoIterator<Item = (f64, f64, String)>) -> Self {
        Self {
            label: label.to_owned(),
            mark: Mark::Named,
            points: points.into_iter().collect(),
        }
    }

    /// A horizontal line at `y`.
    pub fn floor(label: &str, y: f64) -> Self {
        Self {
            label: label.to_owned(),
            mark: Mark::Floor,
            points: vec![(0.0, y, String::new())],
        }
    }

    /// Points that a logarithmic chart can show.
    fn drawable(&self) -> Vec<&(f64, f64, String)> {
        let is_floor = self.mark == Mark::Floor;
        let fits = |v: f64| v.is_finite() && v > 0.0;
        self.points
            .iter()
            .filter(|(x, y, _)| (is_floor || fits(*x)) && fits(*y))
            .collect()
    }
}

/// A chart with two logarithmic axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Stem of the CSV file with its points.
    pub file: String,
    /// Its title.
    pub title: String,
    /// Horizontal axis, with unit.
    pub x_label: String,
    /// Vertical axis, with unit.
    pub y_label: String,
    /// What it shows.
    pub series: Vec<Series>,
}

/// The chart cannot be drawn.
#[derive(Debug, Error)]
#[error("cannot draw the chart {title:?}: {reason}")]
pub struct ChartError {
    title: String,
    reason: String,
}

impl Chart {
    /// An empty chart.
    pub fn new(file: &str, title: &str, x_label: &str, y_label: &str) -> Self {
        Self {
            file: file.to_owned(),
            title: title.to_owned(),
            x_label: x_label.to_owned(),
            y_label: y_label.to_owned(),
            series: Vec::new(),
        }
    }

    /// Names of the points that have any, in the order of their numbers from 1.
    pub fn named(&self) -> Vec<&str> {
        let named = self.series.iter().filter(|s| s.mark == Mark::Named);
        named
            .flat_map(Series::drawable)
            .map(|(_, _, name)| name.as_str())
            .collect()
    }

    /// The points as a table for CSV.
    pub fn to_table(&self) -> Table {
        let columns = ["series", &self.x_label, &self.y_label, "name"];
        let mut table = Table::new(&self.file, &self.title, &columns);
        for series in &self.series {
            for (x, y, name) in &series.points {
                let x = if series.mark == Mark::Floor {
                    String::new()
                } else {
                    x.to_string()
                };
                table.row([series.label.clone(), x, y.to_string(), name.clone()]);
            }
        }
        table
    }

    /// The chart as an SVG element. Points that are not positive have no place on it and are left out.
    ///
    /// # Errors
    /// [`ChartError`] when no point can be drawn or plotters fails.
    pub fn to_svg(&self) -> Result<String, ChartError> {
        let fail = |reason: String| ChartError {
            title: self.title.clone(),
            reason,
        };
        let on_x = self
            .series
            .iter()
            .filter(|s| s.mark != Mark::Floor)
            .flat_map(Series::drawable);
        let x_range =
            padded_range(on_x.map(|p| p.0)).ok_or_else(|| fail("no point is positive".into()))?;
        let all = self.series.iter().flat_map(Series::drawable);
        let y_range =
            padded_range(all.map(|p| p.1)).ok_or_else(|| fail("no point is positive".into()))?;
        let mut svg = String::new();
        self.draw(&mut svg, x_range, y_range)
            .map_err(|e| fail(e.to_string()))?;
        Ok(svg)
    }

    fn draw(
        &self,
        svg: &mut String,
        x_range: Range<f64>,
        y_range: Range<f64>,
    ) -> Result<(), Failure> {
        let root = SVGBackend::with_string(svg, SIZE_PX).into_drawing_area();
        root.fill(&WHITE)?;
        let ends = x_range.clone();
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 17))
            .margin(10)
            .x_label_area_size(42)
            .y_label_area_size(64)
            .build_cartesian_2d(LogAxis(x_range), LogAxis(y_range))?;
        chart
            .configure_mesh()
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .x_labels(12)
            .y_labels(12)
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(225, 225, 225))
            .draw()?;
        let mut marks: Vec<(i32, i32)> = Vec::new();
        for series in self.series.iter().filter(|s| s.mark != Mark::Floor) {
            let places = series.drawable().into_iter();
            let places: Vec<_> = places
                .map(|(x, y, _)| chart.backend_coord(&(*x, *y)))
                .collect();
            if series.mark == Mark::Line {
                marks.extend(labels::along(&places));
            }
            marks.extend(places);
        }
        for (series, colour) in self.series.iter().zip(PALETTE.iter().cycle()) {
            draw_series(&mut chart, series, *colour, &ends, &marks)?;
        }
        let (across, down) = chart.plotting_area().get_pixel_range();
        let plot = (across.start, down.start, across.end, down.end);
        let corner = match labels::legend(plot, self.series.len(), &marks) {
            Corner::LowerLeft => SeriesLabelPosition::LowerLeft,
            Corner::UpperRight => SeriesLabelPosition::UpperRight,
            Corner::LowerRight => SeriesLabelPosition::LowerRight,
            Corner::UpperLeft => SeriesLabelPosition::UpperLeft,
        };
        chart
            .configure_series_labels()
            .position(corner)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font(("sans-serif", 12))
            .draw()?;
        root.present()?;
        Ok(())
    }
}

/// A point of a chart, in its own units.
type Place = (f64, f64);

/// From a point to its label, pixels of the page.
type Offset = (i32, i32);

type Failure = DrawingAreaErrorKind<std::io::Error>;
type Plane<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogAxis, LogAxis>>;

fn draw_series(
    chart: &mut Plane,
    series: &Series,
    colour: RGBColor,
    x_range: &Range<f64>,
    marks: &[(i32, i32)],
) -> Result<(), Failure> {
    let places: Vec<(f64, f64)> = series.drawable().iter().map(|p| (p.0, p.1)).collect();
    let line = colour.stroke_width(2);
    let drawn = match series.mark {
        Mark::Line => {
            let dot = |place| Circle::new(place, 3, colour.filled());
            chart.draw_series(places.iter().copied().map(dot))?;
            chart.draw_series(LineSeries::new(places, line))?
        }
        Mark::Named => {
            let style = ("sans-serif", 11).into_font().color(&colour);
            let on_page: Vec<_> = places.iter().map(|at| chart.backend_coord(at)).collect();
            let offsets = labels::offsets(&on_page, marks);
            let text = |(i, (at, offset)): (usize, (Place, Offset))| {
                EmptyElement::at(at)
                    + TriangleMarker::new((0, 0), 5, colour.filled())
                    + Text::new((i + 1).to_string(), offset, style.clone())
            };
            chart.draw_series(places.into_iter().zip(offsets).enumerate().map(text))?
        }
        Mark::Floor => {
            let ends = places
                .into_iter()
                .flat_map(|(_, y)| [(x_range.start, y), (x_range.end, y)]);
            chart.draw_series(DashedLineSeries::new(ends, 6, 4, line))?
        }
    };
    let key = move |(x, y)| Rectangle::new([(x, y - 4), (x + 14, y + 4)], colour.filled());
    drawn.label(&series.label).legend(key);
    Ok(())
}

/// From a little below the least to a little above the greatest value; none without values.
fn padded_range(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    (high > 0.0).then(|| low / 1.3..high * 1.3)
}

/// A logarithmic axis with ticks at 1, 2 and 5 times the powers of ten, closer where it spans little.
struct LogAxis(Range<f64>);

impl Ranged for LogAxis {
    type FormatOption = plotters::coord::ranged1d::NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let span = (self.0.end / self.0.start).ln();
        let place = (value / self.0.start).ln() / span;
        limit.0 + (f64::from(limit.1 - limit.0) * place).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        let decades = self.0.start.log10().floor() as i32..=self.0.end.log10().ceil() as i32;
        let wide = (self.0.end / self.0.start).log10() > 4.0;
        let narrow = self.0.end / self.0.start < 4.0;
        let steps: &[f64] = match (wide, narrow) {
            (true, _) => &[1.0],
            (_, true) => &[
                1.0, 1.2, 1.4, 1.6, 1.8, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0,
            ],
            _ => &[1.0, 2.0, 5.0],
        };
        decades
            .flat_map(|d| steps.iter().map(move |s| s * 10.0_f64.powi(d)))
            .filter(|v| (self.0.start..=self.0.end).contains(v))
            .collect()
    }

    fn range(&self) -> Range<f64> {
        self.0.clone()
    }
}

impl ValueFormatter<f64> for LogAxis {
    fn format(value: &f64) -> String {
        let digits = (1.0 - value.log10().floor()).max(0.0) as usize;
        let text = format!("{value:.digits$}");
        match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(series: Vec<Series>) -> Chart {
        Chart {
            series,
            ..Chart::new("c", "Error & time", "ms", "FLIP")
        }
    }

    #[test]
    fn an_svg_holds_title_legend_and_names() {
        let svg = chart(vec![
            Series::line("ours", [(1.0, 0.1), (10.0, 0.01), (0.0, 0.5)]),
            Series::named("rivals", [(28.0, 0.159, "Mitsuba".to_owned())]),
            Series::floor("every pixel", 0.02),
        ])
        .to_svg()
        .unwrap();
        for part in [
            "<svg",
            "Error &amp; time",
            "ours",
            "rivals",
            "every pixel",
            "</svg>",
        ] {
            assert!(svg.contains(part), "{part} is missing in {svg}");
        }
    }

    #[test]
    fn named_points_are_numbered_as_they_are_listed() {
        let point = |x: f64, name: &str| (x, 0.1, name.to_owned());
        let chart = chart(vec![Series::named(
            "rivals",
            [
                point(28.0, "fast"),
                point(-1.0, "nowhere"),
                point(30.0, "slow"),
            ],
        )]);
        assert_eq!(chart.named(), ["fast", "slow"]);
        let svg = chart.to_svg().unwrap();
        assert!(svg.contains("\n2\n") || svg.contains(">2<"), "{svg}");
    }

    #[test]
    fn a_chart_without_points_is_an_error() {
        assert!(chart(vec![]).to_svg().is_err());
        assert!(
            chart(vec![Series::line("a", [(0.0, 1.0), (1.0, f64::NAN)])])
                .to_svg()
                .is_err()
        );
    }

    #[test]
    fn the_axis_is_logarithmic_and_its_labels_are_plain() {
        let axis = LogAxis(0.01..100.0);
        assert_eq!(axis.map(&1.0, (0, 400)), 200);
        assert_eq!(LogAxis::format(&0.005), "0.005");
        assert_eq!(LogAxis::format(&2000.0), "2000");
        assert_eq!(LogAxis(0.015..0.09).key_points(10), [0.02, 0.05]);
        assert_eq!(LogAxis::format(&1.25), "1.2");
        assert_eq!(LogAxis(0.75..1.3).key_points(10), [0.8, 0.9, 1.0, 1.2]);
    }
}
