//! Charts of a run.

use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::prelude::*;

use super::drive::Driven;

const SIZE_PX: (u32, u32) = (900, 640);
const DISPLAY: RGBColor = RGBColor(0, 114, 178);
const SERVERS: [RGBColor; 2] = [RGBColor(213, 94, 0), RGBColor(0, 158, 115)];
const QUIET: RGBColor = RGBColor(150, 150, 150);

type Line = (String, RGBColor, Vec<(f64, f64)>);

/// Memory above, frame times below, over the minutes.
pub(super) fn svg(quiet: Option<&Driven>, soak: &Driven) -> anyhow::Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE_PX).into_drawing_area();
        area.fill(&WHITE).map_err(|e| anyhow!("{e}"))?;
        let (above, below) = area.split_vertically(SIZE_PX.1 / 2);
        panel(&above, "Resident memory, MiB", memory(quiet, soak))?;
        panel(
            &below,
            "Longest frame of each second, ms",
            frames(quiet, soak),
        )?;
        area.present().map_err(|e| anyhow!("{e}"))?;
    }
    Ok(text)
}

fn memory(quiet: Option<&Driven>, soak: &Driven) -> Vec<Line> {
    let line = |driven: &Driven, of: &dyn Fn(&super::drive::Memory) -> u64| {
        let point = |m: &super::drive::Memory| (m.at.as_secs_f64() / 60.0, of(m) as f64 / 1024.0);
        // A server that is down has none.
        driven
            .memory
            .iter()
            .map(point)
            .filter(|p| p.1 > 0.0)
            .collect::<Vec<_>>()
    };
    let mut lines = vec![("display".to_owned(), DISPLAY, line(soak, &|m| m.display))];
    for (index, colour) in SERVERS.into_iter().enumerate() {
        let name = format!("server {}", index + 1);
        lines.push((name, colour, line(soak, &|m| m.servers[index])));
    }
    if let Some(quiet) = quiet {
        lines.push((
            "display, no kills".into(),
            QUIET,
            line(quiet, &|m| m.display),
        ));
    }
    lines
}

fn frames(quiet: Option<&Driven>, soak: &Driven) -> Vec<Line> {
    let longest = |driven: &Driven| {
        let mut seconds: Vec<f64> = Vec::new();
        for (at, ms) in &driven.frames {
            let second = at.as_secs() as usize;
            seconds.resize(seconds.len().max(second + 1), 0.0);
            seconds[second] = seconds[second].max(*ms);
        }
        let minute = |second| second as f64 / 60.0;
        seconds
            .iter()
            .enumerate()
            .map(|(second, ms)| (minute(second), *ms))
            .collect::<Vec<_>>()
    };
    let mut lines = vec![("with kills".to_owned(), DISPLAY, longest(soak))];
    if let Some(quiet) = quiet {
        lines.push(("no kills".to_owned(), QUIET, longest(quiet)));
    }
    lines
}

fn panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    title: &str,
    lines: Vec<Line>,
) -> anyhow::Result<()> {
    let fail = |error: &dyn std::fmt::Display| anyhow!("cannot draw {title:?}: {error}");
    let all = || lines.iter().flat_map(|line| &line.2);
    let right = all().map(|p| p.0).fold(0.01, f64::max);
    let top = all().map(|p| p.1).fold(0.01, f64::max) * 1.1;
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 16))
        .margin(10)
        .x_label_area_size(30)
        .y_label_area_size(50)
        .build_cartesian_2d(0.0..right, 0.0..top)
        .map_err(|e| fail(&e))?;
    chart
        .configure_mesh()
        .x_desc("minutes")
        .draw()
        .map_err(|e| fail(&e))?;
    for (name, colour, points) in lines {
        chart
            .draw_series(LineSeries::new(points, &colour))
            .map_err(|e| fail(&e))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
    }
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.8))
        .draw()
        .map_err(|e| fail(&e))
}
