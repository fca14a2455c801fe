//! The `edge-accuracy` command: drawn edges against those that dense ray casting finds.

use std::io::{self, Write};
use std::path::PathBuf;
use std::time::Instant;

use clap::Parser;
use image::RgbImage;
use protocol::messages::Camera;
use rays::{Ray, World};
use renderer::camera::View;
use renderer::edges::by_rays::RaySettings;
use renderer::edges::crossings::Crossings;
use renderer::edges::depth::{DepthBuffer, DepthOffset};
use renderer::edges::finder::EdgeFinder;
use renderer::edges::list::EdgeList;
use renderer::edges::truth::{Score, Truth};
use renderer::edges::visibility::{EdgeDrawer, Hiding};
use renderer::edges::world::world_of;
use scenes::{CameraSpec, LoadedScene, SceneError};
use shader_server::StageError;

use crate::shadow_accuracy::{self, MapError, Report, Subject, write_map};

/// Steps of this share of the depth and more are edges.
const STEP: f32 = 0.002;

/// Measures how many of the edges in a picture are found and how many of those drawn are there, by way of hiding.
#[derive(Debug, Parser)]
#[command(name = "edge-accuracy", version)]
pub struct Args {
    /// Scene file (.toml), mesh file (.obj, .ply, .stl, .gltf, .glb), or the name of a built-in scene.
    pub scene: String,
    /// Width and height of the picture, pixels.
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub size: u32,
    /// Rays are cast along every N-th line of pixel boundaries.
    #[arg(long, default_value_t = 4, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub stride: u16,
    /// How often each way is timed; the shortest time counts.
    #[arg(long, default_value_t = 11, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub runs: u16,
    /// Measure the shadow edges that a display draws which has met all shadows in the picture, alone and with all others;
    /// lights that are not points are replaced by points at their middles.
    #[arg(long)]
    pub shadows: bool,
    /// Draw right (green), missed (red) and false (yellow) crossings of shadow edges into this picture.
    #[arg(long, value_name = "FILE", requires = "shadows")]
    pub map: Option<PathBuf>,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum AccuracyError {
    /// The scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene cannot be shaded.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The map was not written.
    #[error(transparent)]
    Map(#[from] MapError),
    /// The standard output is closed or full.
    #[error("cannot write the result: {0}")]
    Output(#[from] io::Error),
}

/// One way of hiding edges and how it did.
#[derive(Clone, Debug)]
pub struct Line {
    /// What hides edges.
    pub name: String,
    /// Against the rays.
    pub score: Score,
    /// Drawing time, ms.
    pub ms: f64,
    /// Rays cast to draw.
    pub rays: usize,
}

/// Measures and prints a table.
///
/// # Errors
/// If the scene cannot be opened or `out` not be written.
pub fn run(args: &Args, out: &mut impl Write) -> Result<(), AccuracyError> {
    let loaded = scenes::open(&args.scene)?;
    if args.shadows {
        return run_shadows(&loaded, args, out);
    }
    writeln!(out, "{:<30} recall  precision  time, ms  rays", "hidden by")?;
    for line in measure(&loaded, args) {
        let (recall, precision) = (line.score.recall(), line.score.precision());
        writeln!(
            out,
            "{:<30} {recall:.4}  {precision:<9.4}  {:<8.3}  {}",
            line.name, line.ms, line.rays
        )?;
    }
    Ok(())
}

fn view_of(camera: &CameraSpec, size_px: u32) -> View {
    View::new(&Camera {
        eye: camera.eye,
        target: camera.target,
        up: camera.up,
        fov_y: camera.fov_y,
        width: size_px,
        height: size_px,
    })
}

fn run_shadows(
    loaded: &LoadedScene,
    args: &Args,
    out: &mut impl Write,
) -> Result<(), AccuracyError> {
    let scene = shadow_accuracy::with_points(&loaded.scene);
    let subject = Subject {
        scene: &scene,
        view: &view_of(&loaded.camera, args.size),
        stride: args.stride.into(),
        step: STEP,
    };
    let mut map = args
        .map
        .is_some()
        .then(|| RgbImage::new(args.size, args.size));
    let report = shadow_accuracy::measure(subject, map.as_mut())?;
    write_shadows(&report, out)?;
    if let (Some(map), Some(path)) = (&map, &args.map) {
        write_map(map, path)?;
    }
    Ok(())
}

fn write_shadows(report: &Report, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{:<30} recall  precision  edges   drawn", "edges")?;
    let mut line = |name: String, score: Score| {
        let (recall, precision) = (score.recall(), score.precision());
        writeln!(
            out,
            "{name:<30} {recall:.4}  {precision:<9.4}  {:<6}  {}",
            score.steps, score.drawn
        )
    };
    for (light, score) in &report.shadows {
        line(format!("shadows of light {light}"), *score)?;
    }
    line("all edges together".to_owned(), report.together)?;
    let causes = report.causes;
    writeln!(
        out,
        "false crossings of shadow edges: {} in the light, {} in shadow, {} turned away from the light",
        causes.lit, causes.dark, causes.away
    )?;
    let [all, own] = report.ms;
    writeln!(
        out,
        "shadow edges of all pairs anew: {all:.1} ms; cut by each pair's own receivers alone: {own:.1} ms"
    )?;
    for ([x, y], missed, wrong) in &report.worst {
        writeln!(out, "near pixel {x}, {y}: {missed} missed, {wrong} false")?;
    }
    Ok(())
}

/// Every way of hiding, from the scene's own camera.
pub fn measure(loaded: &LoadedScene, args: &Args) -> Vec<Line> {
    let view = view_of(&loaded.camera, args.size);
    let world = world_of(&loaded.scene);
    let truth = Truth::new(&loaded.scene, &world, &view, args.stride.into(), STEP);
    let mut edges = EdgeList::default();
    EdgeFinder::new(&loaded.scene).find(&view, &mut edges);
    let mut crossings = Crossings::new(args.size as usize, args.size as usize);
    let mut line = |name: String, hiding: Hiding<'_>| {
        let mut drawer = EdgeDrawer::default();
        let mut ms = f64::INFINITY;
        for _ in 0..args.runs {
            edges.generation += 1;
            let start = Instant::now();
            drawer.draw(&view, &edges, hiding, true, &mut crossings);
            ms = ms.min(start.elapsed().as_secs_f64() * 1e3);
        }
        Line {
            name,
            score: truth.score(&crossings),
            ms,
            rays: drawer.rays(),
        }
    };
    let mut lines = vec![line("nothing".to_owned(), Hiding::None)];
    for (spacing_px, precision_px) in [(1.0, 0.25), (4.0, 0.25), (4.0, 0.5), (8.0, 0.25)] {
        let settings = RaySettings {
            spacing_px,
            precision_px,
            ..RaySettings::default()
        };
        let name = format!("rays {spacing_px} px apart, to {precision_px} px");
        lines.push(line(name, Hiding::Rays(&world, settings)));
    }
    for (name, settings) in [
        ("rays, while something moves", RaySettings::default()),
        ("rays, at rest", RaySettings::AT_REST),
    ] {
        lines.push(line(name.to_owned(), Hiding::Rays(&world, settings)));
    }
    for share in [0.02, 0.1, 0.3, 1.0] {
        let buffer = sparse_depth(&view, &world, share);
        let name = format!("points in {:.0} % of pixels", share * 100.0);
        let hiding = Hiding::Points(&buffer, DepthOffset::default());
        lines.push(line(name, hiding));
    }
    lines
}

/// Depth at the middle of a share of the pixels.
fn sparse_depth(view: &View, world: &World, share: f32) -> DepthBuffer {
    let (width, height) = (view.width as usize, view.height as usize);
    let mut state = 1_u32;
    let depth = (0..width * height)
        .map(|i| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            if (state >> 8) as f32 / (1 << 24) as f32 >= share {
                return f32::INFINITY;
            }
            let direction = view.direction((i % width) as f32 + 0.5, (i / width) as f32 + 0.5);
            let ray = Ray {
                origin: view.eye,
                direction,
            };
            world.closest(&ray, f32::INFINITY).map_or(1e30, |hit| hit.t)
        })
        .collect();
    DepthBuffer {
        width,
        height,
        depth,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_edges_cost_precision_and_rays_win_it_back() {
        let args = Args {
            scene: "chains".into(),
            size: 128,
            stride: 4,
            runs: 1,
            shadows: false,
            map: None,
        };
        let lines = measure(&scenes::open("chains").unwrap(), &args);
        let of = |name: &str| lines.iter().find(|l| l.name == name).unwrap().score;
        let (all, rays) = (of("nothing"), of("rays, while something moves"));
        assert!(all.recall() > 0.98, "{all:?}");
        assert!(rays.recall() > 0.9 && rays.precision() > 0.9, "{rays:?}");
        assert!(all.precision() < rays.precision(), "{all:?} {rays:?}");
    }
}
