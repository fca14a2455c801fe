//! Crops to look at, where the picture has most edges and where the method errs most.

use image::RgbImage;

use super::still::kept_frames;
use super::{Lab, Section};
use crate::compare::{Crop, render_crop};
use crate::metrics::{FlipMap, edge_mask};
use crate::picture::Picture;
use crate::report::cases::Case;
use crate::report::lab::{MeasureError, or_missing};
use crate::report::page::Block;
use crate::report::runner::{Job, Method, Write};

pub(super) const SECTION: Section = Section {
    name: "pictures",
    title: "Pictures",
    share: 5,
    measure,
};

/// Width and height of a crop, pixels.
const CROP_PX: u32 = 64;
const SCALE: u32 = 4;
/// The still frame that is shown: 10 frames of 2 % of the pixels each.
const FRAME: u32 = 9;

fn measure(lab: &mut Lab) -> Vec<Block> {
    let mut blocks = Vec::new();
    for case in lab.cases.clone() {
        let crops = crops(lab, &case);
        let crops = or_missing(&mut blocks, &case.name, crops);
        blocks.extend(crops.into_iter().flatten());
    }
    blocks
}

fn crops(lab: &mut Lab, case: &Case) -> Result<Vec<Block>, MeasureError> {
    let reference = lab.still_reference(case)?;
    let frames = lab.settings.still_frames;
    let keep = kept_frames(frames);
    let sparse = |lab: &mut Lab, method| -> Result<Picture, MeasureError> {
        let job = lab.still_job(case, method, frames)?;
        Ok(lab.run(&job, &keep)?.picture(FRAME)?)
    };
    let ours = sparse(lab, Method::EdgeAndPoint)?;
    let points = sparse(lab, Method::PointsOnly)?;
    let full = Job {
        write: Write::Last,
        ..lab.still_job(case, Method::Full, 1)?
    };
    let full = lab.run(&full, &[0])?.picture(0)?;
    let map = FlipMap::between(&ours, &reference)?;
    let edges: Vec<f32> = edge_mask(&reference)
        .iter()
        .map(|e| f32::from(u8::from(*e)))
        .collect();
    let panels = [
        ours.to_srgb8(),
        points.to_srgb8(),
        full.to_srgb8(),
        reference.to_srgb8(),
        map.to_magma(),
    ];
    let mut blocks = vec![Block::Picture {
        caption: format!("{}: edge-and-point after {} frames.", case.name, FRAME + 1),
        picture: panels[0].clone(),
    }];
    for (what, weights) in [
        ("most edges", edges.as_slice()),
        ("the largest error", map.values()),
    ] {
        let origin_px = heaviest_block(weights, reference.size_px());
        blocks.extend(crop_block(case, what, &panels, origin_px));
    }
    Ok(blocks)
}

fn crop_block(case: &Case, what: &str, panels: &[RgbImage], origin_px: [u32; 2]) -> Option<Block> {
    let size_px = [
        CROP_PX.min(panels[0].width()),
        CROP_PX.min(panels[0].height()),
    ];
    let picture = render_crop(
        panels,
        Crop {
            origin_px,
            size_px,
            scale: SCALE,
        },
    )
    .ok()?;
    let caption = format!(
        "{}, where it has {what} (pixel {}, {}): edge-and-point, points-only, full, reference, FLIP map of the first.",
        case.name, origin_px[0], origin_px[1],
    );
    Some(Block::Picture { picture, caption })
}

/// Upper left pixel of the block, on a grid of half blocks, with the largest sum of `weights`.
fn heaviest_block(weights: &[f32], [width, height]: [u32; 2]) -> [u32; 2] {
    let starts = |length: u32| (0..=length.saturating_sub(CROP_PX)).step_by(CROP_PX as usize / 2);
    let sum = |x: u32, y: u32| -> f64 {
        let rows = y..(y + CROP_PX).min(height);
        let row = |y: u32| {
            let start = (y * width + x) as usize;
            let end = (y * width + (x + CROP_PX).min(width)) as usize;
            weights[start..end]
                .iter()
                .map(|w| f64::from(*w))
                .sum::<f64>()
        };
        rows.map(row).sum()
    };
    starts(height)
        .flat_map(|y| starts(width).map(move |x| [x, y]))
        .max_by(|a, b| sum(a[0], a[1]).total_cmp(&sum(b[0], b[1])))
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heaviest_block_holds_the_weight() {
        let mut weights = vec![0.0; 200 * 130];
        weights[100 * 200 + 150] = 1.0;
        let [x, y] = heaviest_block(&weights, [200, 130]);
        assert!(
            (x..x + CROP_PX).contains(&150) && (y..y + CROP_PX).contains(&100),
            "{x} {y}"
        );
        assert_eq!(heaviest_block(&[1.0; 9], [3, 3]), [0, 0]);
    }
}
