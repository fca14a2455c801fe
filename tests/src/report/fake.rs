//! A stand-in for the renderer: a disc whose error falls with the samples taken.

use std::cell::RefCell;
use std::fs;
use std::path::Path;
use std::time::Instant;

use super::runner::{Job, Method, Render, Run, RunError, Shadows, Write};
use super::stats;

/// Remembers the jobs it was given; fails those of method `fails`.
#[derive(Default)]
pub(super) struct Fake {
    pub(super) jobs: RefCell<Vec<Job>>,
    pub(super) fails: Option<Method>,
}

impl Render for Fake {
    fn render(&self, job: &Job, folder: &Path, _deadline: Instant) -> Result<Run, RunError> {
        self.jobs.borrow_mut().push(job.clone());
        if self.fails == Some(job.method) {
            return Err(RunError::Failed {
                args: "render".to_owned(),
                status: "exit status: 2".to_owned(),
                stderr: "no such method".to_owned(),
            });
        }
        let mut lines = String::new();
        for frame in 0..job.frames {
            lines += &line(job, frame);
            let written = match job.write {
                Write::All => true,
                Write::Last => frame + 1 == job.frames,
                Write::None => false,
                Write::Every(n) => frame % n == 0,
            };
            if written {
                let path = folder.join(format!("frame-{frame:04}.exr"));
                disc(job, frame).save(path).unwrap();
            }
        }
        fs::write(folder.join("stats.jsonl"), &lines)?;
        let frames = stats::parse(&lines).unwrap();
        Ok(Run {
            folder: folder.to_owned(),
            frames,
            wall_ms: 1.0,
        })
    }
}

fn line(job: &Job, frame: u32) -> String {
    let samples = job.samples_per_frame;
    format!(
        "{{\"frame\":{frame},\"total_ms\":4.5,\"stage_ms\":{{\"drain\":0.5,\"reach\":0.25}},\"wait_ms\":10,\
         \"silhouette_edges\":321,\"pixels\":{{\"empty\":1,\"simple\":2,\"complex\":3}},\"samples_new\":{samples}}}\n"
    )
}

fn disc(job: &Job, frame: u32) -> image::Rgb32FImage {
    let [width, height] = job.size_px;
    let error = match job.method {
        Method::EdgeAndPoint => 0.1,
        Method::NoComplex => 0.12,
        Method::PointsOnly => 0.3,
        Method::Full => 0.05,
        Method::Reference(spp) => 0.01 / spp as f32,
    } / (frame + 1) as f32;
    let error = match job.shadows {
        Shadows::Off => 1.5 * error,
        Shadows::All => 2.0 * error,
        Shadows::Chosen | Shadows::Narrower(_) => error,
    };
    image::ImageBuffer::from_fn(width, height, |x, y| {
        let (dx, dy) = (
            x as f32 - width as f32 / 2.0,
            y as f32 - height as f32 / 2.0,
        );
        let value = if dx.hypot(dy) < height as f32 / 4.0 {
            0.6 - error
        } else {
            0.2 + error
        };
        image::Rgb([value; 3])
    })
}
