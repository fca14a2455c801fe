//! Several ways to do the same work, timed in turns so that whatever else the machine does falls on all of them alike.

use std::hint::black_box;
use std::time::Instant;

use rays::Ray;

use crate::report::stats::median;

/// Rays traced in one go: a small part of a millisecond, so that hardly any go is interrupted.
const CHUNK: usize = 1024;

/// One way to trace rays; returns how many hit.
pub type Way<'a> = Box<dyn FnMut(&[Ray]) -> usize + 'a>;

/// Millions of rays a second by each way: for each chunk of rays the median over `rounds`, summed over chunks.
///
/// At any moment the ways are at different chunks, so that none finds in the cache what another has just used.
pub fn rates(ways: &mut [Way<'_>], rays: &[Ray], rounds: usize) -> Vec<f64> {
    let chunks: Vec<&[Ray]> = rays.chunks(CHUNK).collect();
    let mut seconds = vec![vec![Vec::with_capacity(rounds); chunks.len()]; ways.len()];
    let apart = chunks.len().div_ceil(ways.len().max(1));
    for _ in 0..rounds {
        for turn in 0..chunks.len() {
            for (i, way) in ways.iter_mut().enumerate() {
                let chunk = (turn + i * apart) % chunks.len();
                let start = Instant::now();
                black_box(way(black_box(chunks[chunk])));
                seconds[i][chunk].push(start.elapsed().as_secs_f64());
            }
        }
    }
    let total = |times: &[Vec<f64>]| times.iter().map(|t| median(t.iter().copied())).sum::<f64>();
    let rate = |times: &Vec<Vec<f64>>| rays.len() as f64 / total(times) / 1e6;
    seconds.iter().map(rate).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn slower_ways_have_lower_rates_and_all_rays_are_traced() {
        let rays = vec![
            Ray {
                origin: Vec3::ZERO,
                direction: Vec3::X
            };
            3 * CHUNK + 5
        ];
        let mut traced = 0;
        let work = |rays: &[Ray], times: u32| {
            let mut sum = 0.;
            for ray in rays {
                for _ in 0..times {
                    sum += black_box(ray.direction.x);
                }
            }
            sum as usize
        };
        let mut ways: Vec<Way<'_>> = vec![
            Box::new(|rays| {
                traced += rays.len();
                work(rays, 10)
            }),
            Box::new(|rays| work(rays, 200)),
        ];
        let rates = rates(&mut ways, &rays, 3);
        drop(ways);
        assert_eq!(traced, 3 * rays.len());
        assert!(rates[0] > 4. * rates[1] && rates[1] > 0., "{rates:?}");
    }
}
