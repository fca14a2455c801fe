//! Rejecting points that are seen through gaps in a nearer surface.

use super::around::Verdict;
use super::between::Between;
use super::{PixelSamples, PointCache};
use crate::epi::Epi;

/// A point that may be hidden.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suspect {
    /// Its slot in the cache.
    pub point: u32,
    /// Where it is in the image, pixels.
    pub image_px: [f32; 2],
    /// Depth along the line of sight, metres.
    pub depth: f32,
}

/// Takes away the points that are well behind their neighbours: the Render Cache's own way (2002, "Depth cull"), which loses
/// those of surfaces beside nearer ones, too.
pub fn cull_by_depth(pixels: &mut PixelSamples, between: &Between) {
    for (has, behind) in pixels.has.iter_mut().zip(&between.suspects) {
        *has &= !behind;
    }
}

/// Takes away the points that are hidden, and has the cache note what became of those that were unsure: it trusts visible ones
/// for a while, hidden ones grow old. `between` has looked at these pixels; `epi` has the frame's edges, where they are known,
/// and `focal_px` is the view's. Where neighbours do not know, `front` says how deep the surface is that hides a point, if one
/// does, metres; what it says helps with the neighbours.
pub fn cull(
    pixels: &mut PixelSamples,
    between: &mut Between,
    cache: &mut PointCache,
    (epi, focal_px): (Option<&Epi>, f32),
    mut front: impl FnMut(&Suspect) -> Option<f32>,
) {
    let (grid, px) = (pixels.grid, 1.0 / focal_px);
    for word in 0..grid.plane_words() {
        let (y, first) = (word / grid.words, word % grid.words * 64);
        let mut hidden = between.hidden[word];
        let (vouched, doubtful) = (between.vouched[word], pixels.doubtful[word]);
        let mut left = between.unsure[word] & !hidden & !vouched;
        // Of those that are merely suspected the time of trust goes on.
        for_each_bit(vouched & doubtful, |bit| {
            let known = cache.vouch(pixels.point[grid.at(first + bit, y)]);
            left |= u64::from(!known) << bit;
        });
        for_each_bit(left, |bit| {
            let (x, at) = (first + bit, grid.at(first + bit, y));
            let (place, depth) = ([pixels.x[at], pixels.y[at]], pixels.depth[at]);
            let suspect = Suspect {
                point: pixels.point[at],
                image_px: [x as f32 + place[0], y as f32 + place[1]],
                depth,
            };
            let verdict = epi.map_or(Verdict::Unknown, |epi| {
                between.ask(epi, (x, y), place, 1.0 / depth, px)
            });
            let seen = match verdict {
                Verdict::Hidden => false,
                Verdict::Visible if cache.vouch(suspect.point) => {
                    between.learn((x, y), 1.0 / depth);
                    true
                }
                Verdict::Visible | Verdict::Unknown => {
                    let before = front(&suspect);
                    between.learn((x, y), 1.0 / before.unwrap_or(depth));
                    if before.is_none() {
                        cache.trust(suspect.point);
                    }
                    before.is_none()
                }
            };
            hidden |= u64::from(!seen) << bit;
        });
        for_each_bit(hidden, |bit| {
            cache.hide(pixels.point[grid.at(first + bit, y)]);
        });
        pixels.has[word] &= !hidden;
    }
}

fn for_each_bit(mut bits: u64, mut visit: impl FnMut(usize)) {
    while bits != 0 {
        visit(bits.trailing_zeros() as usize);
        bits &= bits - 1;
    }
}

#[cfg(test)]
mod tests {
    use fearless_simd::Level;
    use protocol::messages::Sample;

    use super::*;
    use crate::epi::code::Places;
    use crate::epi::grid::Grid;

    const FOCAL_PX: f32 = 100.0;

    /// A wall at depth 2 in every pixel of a strip but one, where a point at depth 6 shows through; all doubtful or none.
    fn wall(doubtful: bool) -> (PixelSamples, PointCache) {
        let grid = Grid::new(80, 5);
        let (mut pixels, mut cache) = (PixelSamples::new(grid), PointCache::new(400));
        for (x, y) in (0..5).flat_map(|y| (0..80).map(move |x| (x, y))) {
            let sample = Sample {
                id: 0,
                position: [0.0; 3],
                object: 0,
                radiance: [0.0; 3],
                flags: 0,
            };
            let (at, (word, bit)) = (grid.at(x, y), grid.bit(x, y));
            pixels.point[at] = cache.insert(&sample, None).unwrap();
            pixels.depth[at] = if (x, y) == (70, 2) { 6.0 } else { 2.0 };
            pixels.has[word] |= 1 << bit;
            pixels.doubtful[word] |= u64::from(doubtful) << bit;
        }
        (pixels, cache)
    }

    #[test]
    fn by_depth_alone_goes_what_is_behind_its_neighbours() {
        let (mut pixels, _) = wall(true);
        let mut between = Between::new(pixels.grid);
        between.find(Level::new(), &pixels, None, FOCAL_PX);
        cull_by_depth(&mut pixels, &between);
        assert!(!pixels.has_sample(70, 2) && pixels.visible() == 399);
    }

    #[test]
    fn without_edges_all_that_is_unsure_is_asked_about() {
        let (mut pixels, mut cache) = wall(false);
        let mut between = Between::new(pixels.grid);
        between.find(Level::new(), &pixels, None, FOCAL_PX);
        let mut asked = Vec::new();
        cull(
            &mut pixels,
            &mut between,
            &mut cache,
            (None, FOCAL_PX),
            |p| {
                asked.push((p.point, p.image_px, p.depth));
                Some(2.0)
            },
        );
        assert_eq!(asked, [(2 * 80 + 70, [70.5, 2.5], 6.0)]);
        assert!(!pixels.has_sample(70, 2) && pixels.visible() == 399);
        assert!(!cache.is_seen(2 * 80 + 70) && cache.is_seen(2 * 80 + 69));

        let (mut pixels, mut cache) = wall(true);
        between.find(Level::new(), &pixels, None, FOCAL_PX);
        let mut asked = 0;
        cull(
            &mut pixels,
            &mut between,
            &mut cache,
            (None, FOCAL_PX),
            |_| {
                asked += 1;
                None
            },
        );
        assert_eq!((asked, pixels.visible()), (400, 400));
    }

    #[test]
    fn where_no_edge_passes_a_few_answers_do_for_all() {
        let (mut pixels, mut cache) = wall(true);
        let none = Epi::new(80, 5, Places::Bits8);
        let mut between = Between::new(pixels.grid);
        between.find(Level::new(), &pixels, Some(&none), FOCAL_PX);
        let mut asked = 0;
        cull(
            &mut pixels,
            &mut between,
            &mut cache,
            (Some(&none), FOCAL_PX),
            |p| {
                asked += 1;
                (p.depth > 3.0).then_some(2.0)
            },
        );
        // The rim is two pixels wide at both sides.
        assert!(asked > 4 * 5 && asked < 4 * 5 + 40, "{asked}");
        assert!(!pixels.has_sample(70, 2) && pixels.visible() == 399);
    }
}
