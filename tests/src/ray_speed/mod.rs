//! The `ray-speed` command: this project's rays against Embree's, the same rays and triangles in one run on one thread.

pub mod embree;
pub mod race;
pub mod sets;

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Parser;
use rays::{Hit, Ray, World};
use scenes::SceneError;

use embree::{Embree, EmbreeError, EmbreeScene, PACKET};
use race::{Way, rates};
use sets::{Flat, Question, RaySet, Subject};

/// Distances that differ by more than this share are different hits.
const SAME_DISTANCE: f32 = 1e-4;

/// Races rays from the eye, off surfaces and to a light against Embree, on one thread.
#[derive(Debug, Parser)]
#[command(name = "ray-speed", version)]
pub struct Args {
    /// Scene files, mesh files or names of built-in scenes.
    #[arg(required = true)]
    pub scenes: Vec<String>,
    /// Embree 4's shared library; without it this project's rays run alone.
    #[arg(long, value_name = "FILE")]
    pub embree: Option<PathBuf>,
    /// Width and height of the picture whose pixels send rays.
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=4096))]
    pub size: u32,
    /// How often each way runs; medians count.
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u16).range(1..))]
    pub rounds: u16,
}

/// Why nothing was measured.
#[derive(Debug, thiserror::Error)]
pub enum SpeedError {
    /// A scene cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// Embree was named but cannot be used.
    #[error(transparent)]
    Embree(#[from] EmbreeError),
    /// The standard output is closed or full.
    #[error("cannot write the result: {0}")]
    Output(#[from] io::Error),
}

/// What one kind of rays gave. Rates are in millions of rays a second.
#[derive(Clone, Debug)]
pub struct Line {
    /// The kind of rays.
    pub name: &'static str,
    /// How many.
    pub rays: usize,
    /// Share that hit.
    pub hit_share: f64,
    /// One by one, all triangles in one tree.
    pub ours: f64,
    /// One by one, a tree an object below a tree over objects.
    pub two_levels: f64,
    /// By packets of eight, of one level and of two; coherent rays only.
    pub packets: Option<[f64; 2]>,
    /// Embree, where it is present.
    pub embree: Option<EmbreeLine>,
}

/// What Embree gave for the same rays and one tree.
#[derive(Clone, Debug)]
pub struct EmbreeLine {
    /// One by one, default mode, which is not watertight.
    pub single: f64,
    /// One by one, robust mode, which is.
    pub robust: f64,
    /// By packets of eight, default mode; coherent rays only.
    pub packets: Option<f64>,
    /// How many rays have another answer than in robust mode.
    pub differing: usize,
}

/// Measures every kind of rays.
///
/// # Errors
/// [`EmbreeError`] when Embree refuses the scene.
pub fn measure(
    subject: &Subject,
    embree: Option<&Embree>,
    rounds: usize,
) -> Result<Vec<Line>, EmbreeError> {
    let scenes = match embree {
        Some(embree) => {
            let Flat { positions, faces } = &subject.flat;
            let scene = |robust| embree.scene(positions, faces, robust);
            Some([scene(false)?, scene(true)?])
        }
        None => None,
    };
    let sets = subject.sets.iter();
    Ok(sets
        .map(|set| line(subject, set, scenes.as_ref(), rounds))
        .collect())
}

fn line(
    subject: &Subject,
    set: &RaySet,
    embree: Option<&[EmbreeScene<'_>; 2]>,
    rounds: usize,
) -> Line {
    let mut ways = vec![
        ours(&subject.one_level, set),
        ours(&subject.two_levels, set),
    ];
    if set.coherent {
        ways.push(our_packets(&subject.one_level, set));
        ways.push(our_packets(&subject.two_levels, set));
    }
    let own = ways.len();
    if let Some([default, robust]) = embree {
        ways.extend([theirs(default, set), theirs(robust, set)]);
        ways.extend(set.coherent.then(|| their_packets(default, set)));
    }
    let hits = ways[0](&set.rays);
    let rates = rates(&mut ways, &set.rays, rounds);
    Line {
        name: set.name,
        rays: set.rays.len(),
        hit_share: hits as f64 / set.rays.len() as f64,
        ours: rates[0],
        two_levels: rates[1],
        packets: set.coherent.then(|| [rates[2], rates[3]]),
        embree: embree.map(|[_, robust]| EmbreeLine {
            single: rates[own],
            robust: rates[own + 1],
            packets: rates.get(own + 2).copied(),
            differing: differing(&subject.one_level, robust, set),
        }),
    }
}

fn ours<'a>(world: &'a World, set: &RaySet) -> Way<'a> {
    let t_max = set.t_max;
    match set.question {
        Question::Closest => {
            Box::new(move |rays| count(rays, |ray| world.closest(ray, t_max).is_some()))
        }
        Question::Any => {
            Box::new(move |rays| count(rays, |ray| world.occluder(ray, t_max).is_some()))
        }
    }
}

fn our_packets<'a>(world: &'a World, set: &RaySet) -> Way<'a> {
    let t_max = set.t_max;
    match set.question {
        Question::Closest => {
            let mut hits = Vec::new();
            Box::new(move |rays| {
                world.closest_each(rays, t_max, &mut hits);
                hits.iter().flatten().count()
            })
        }
        Question::Any => {
            let mut found = Vec::new();
            Box::new(move |rays| {
                world.occluder_each(rays, t_max, |_, _, _| true, &mut found);
                found.iter().flatten().count()
            })
        }
    }
}

fn theirs<'a>(scene: &'a EmbreeScene<'_>, set: &RaySet) -> Way<'a> {
    let t_max = set.t_max;
    match set.question {
        Question::Closest => {
            Box::new(move |rays| count(rays, |ray| scene.closest(ray, t_max).is_some()))
        }
        Question::Any => Box::new(move |rays| count(rays, |ray| scene.blocked(ray, t_max))),
    }
}

fn their_packets<'a>(scene: &'a EmbreeScene<'_>, set: &RaySet) -> Way<'a> {
    let t_max = set.t_max;
    match set.question {
        Question::Closest => Box::new(move |rays| {
            let packets = rays.chunks(PACKET);
            let hits = |packet: &[Ray]| {
                scene
                    .closest_of_packet(packet, t_max)
                    .iter()
                    .flatten()
                    .count()
            };
            packets.map(hits).sum()
        }),
        Question::Any => Box::new(move |rays| {
            let packets = rays.chunks(PACKET);
            packets
                .map(|p| scene.blocked_of_packet(p, t_max).count_ones() as usize)
                .sum()
        }),
    }
}

fn count(rays: &[Ray], hits: impl Fn(&Ray) -> bool) -> usize {
    rays.iter().filter(|ray| hits(ray)).count()
}

/// How many rays hit in one and miss in the other, or hit at another distance.
fn differing(world: &World, embree: &EmbreeScene<'_>, set: &RaySet) -> usize {
    let differs = |ray: &Ray| match set.question {
        Question::Any => world.occluder(ray, set.t_max).is_some() != embree.blocked(ray, set.t_max),
        Question::Closest => {
            let t = world.closest(ray, set.t_max).map(|hit: Hit| hit.t);
            match (t, embree.closest(ray, set.t_max)) {
                (Some(a), Some(b)) => (a - b.t).abs() > SAME_DISTANCE * a.max(b.t),
                (a, b) => a.is_some() != b.is_some(),
            }
        }
    };
    count(&set.rays, differs)
}

/// Measures and prints a table.
///
/// # Errors
/// [`SpeedError`] when a scene cannot be opened, Embree not be loaded, or `out` not be written.
pub fn run(args: &Args, out: &mut impl Write) -> Result<(), SpeedError> {
    let embree = args.embree.as_deref().map(Embree::load).transpose()?;
    if embree.is_none() {
        writeln!(
            out,
            "Embree's library is not given (--embree FILE): left out"
        )?;
    }
    for name in &args.scenes {
        let subject = Subject::new(&scenes::open(name)?, args.size);
        writeln!(
            out,
            "{name}: {} triangles, tree built in {:.0} ms, {} objects; Mrays/s (ratio to Embree's single rays)",
            subject.flat.faces.len(),
            subject.build_s * 1e3,
            subject.two_levels.len(),
        )?;
        for line in measure(&subject, embree.as_ref(), args.rounds.into())? {
            write_line(&line, out)?;
        }
    }
    Ok(())
}

fn write_line(line: &Line, out: &mut impl Write) -> io::Result<()> {
    let against = |rate: f64| match &line.embree {
        Some(embree) => format!("{rate:.2} ({:.2})", rate / embree.single),
        None => format!("{rate:.2}"),
    };
    let hit = 100. * line.hit_share;
    write!(out, "  {:<26} {hit:3.0} % hit", line.name)?;
    write!(out, "  one level {}", against(line.ours))?;
    write!(out, "  two {}", against(line.two_levels))?;
    if let Some([one, two]) = line.packets {
        write!(
            out,
            "  packets {}, two levels {}",
            against(one),
            against(two)
        )?;
    }
    if let Some(embree) = &line.embree {
        write!(out, "  Embree {:.2}", embree.single)?;
        write!(out, "  robust {}", against(embree.robust))?;
        if let Some(packets) = embree.packets {
            write!(out, "  packets {}", against(packets))?;
        }
        let differing = embree.differing;
        write!(out, "  {differing} of {} answers differ", line.rays)?;
    }
    writeln!(out)
}
