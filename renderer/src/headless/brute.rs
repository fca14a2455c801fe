//! What sparse sampling is compared against: every pixel shaded, once or many times.

use std::time::Instant;

use protocol::messages::SampleRequest;

use super::{Flight, Output, RenderError};
use crate::camera::View;
use crate::cli::RenderArgs;
use crate::config::Method;
use crate::epi::grid::Grid;
use crate::sampling::place::{PixelState, place};
use crate::servers::Servers;
use crate::stats::{FrameStats, Stage, StageMs};
use crate::tone::ToneMap;

/// Renders and writes one frame of `full` (one sample in the middle of each pixel) or `reference` (many jittered samples,
/// box-filtered).
pub(super) fn frame(
    flight: &mut Flight<'_>,
    frame: usize,
    args: &RenderArgs,
    servers: &mut Servers,
    output: &mut Output,
) -> Result<FrameStats, RenderError> {
    let grid = Grid::new(args.size.0 as usize, args.size.1 as usize);
    if let Some(edit) = flight.edit(frame) {
        servers.edit(&edit)?;
    }
    let view = View::new(&flight.camera(frame));
    let number = servers.set_view(&view.camera())?;
    let passes = if args.choices.method == Method::Full {
        1
    } else {
        args.spp
    };
    let mut rgb: [Vec<f32>; 3] = std::array::from_fn(|_| vec![0.0; grid.elements()]);
    let (mut requests, mut received) = (Vec::new(), Vec::new());
    let mut ms = StageMs::default();
    let mut taken = 0;
    let waiting = Instant::now();
    let mut drained = 0.0;
    for pass in 0..passes {
        requests.clear();
        for y in 0..grid.height {
            for x in 0..grid.width {
                let state = PixelState {
                    x,
                    y,
                    count: pass + 1,
                    region_centre: None,
                };
                let offset = if passes == 1 {
                    [0.5, 0.5]
                } else {
                    place(args.seed, state)
                };
                let serial = (frame as u64 * u64::from(passes) + u64::from(pass)) << 32;
                let id = serial | (y as u64) << 16 | x as u64;
                requests.push(SampleRequest {
                    id,
                    x: x as u16,
                    y: y as u16,
                    offset,
                });
            }
        }
        servers.request(number, &requests)?;
        received.clear();
        servers.wait_all(&mut received)?;
        let start = Instant::now();
        for r in &received {
            let at = grid.at(
                (r.sample.id & 0xffff) as usize,
                (r.sample.id >> 16 & 0xffff) as usize,
            );
            for (plane, value) in rgb.iter_mut().zip(r.sample.radiance) {
                plane[at] += value / passes as f32;
            }
        }
        taken += received.len();
        drained += start.elapsed().as_secs_f64() * 1e3;
    }
    *ms.of(Stage::Drain) = drained;
    let wait_ms = waiting.elapsed().as_secs_f64() * 1e3 - drained;
    let mut shown = Vec::new();
    ms.time(Stage::Present, || {
        ToneMap::new().map(grid, &rgb, &mut shown);
    });
    let stats = FrameStats {
        frame,
        total_ms: ms.total(),
        stage_ms: ms,
        samples_new: taken,
        samples_visible: taken.min(grid.width * grid.height),
        servers: servers.connected(),
        triples: servers.triples(),
        wait_ms,
        ..FrameStats::default()
    };
    output.frame(frame, grid, &rgb, &shown)?;
    output.stats(&stats)?;
    Ok(stats)
}
