//! A display that changes its size or its choices while it runs.

use protocol::messages::Sample;
use protocol::scene::{Model, Scene, Shading};

use super::Display;
use crate::config::Choices;

impl Display {
    /// Starts over for pictures of this size made by these choices: costs no more than a few frames, because what was built
    /// from the scene stays. `keep_points` says whether the cache's points stay too, as far as there is room.
    /// Call [`Display::begin`] before the next samples.
    pub fn rebuild(&mut self, choices: Choices, width: u32, height: u32, keep_points: bool) {
        let nothing = Scene {
            shading: Shading {
                model: Model::Direct,
                ambient: [0.0; 3],
                background: [0.0; 3],
            },
            lights: Vec::new(),
            materials: Vec::new(),
            textures: Vec::new(),
            meshes: Vec::new(),
            objects: Vec::new(),
        };
        let mut fresh = Self::new(&nothing, choices, width, height, self.seed);
        std::mem::swap(&mut fresh.edges, &mut self.edges);
        std::mem::swap(&mut fresh.placed, &mut self.placed);
        std::mem::swap(&mut fresh.maps, &mut self.maps);
        fresh.make_room_for_maps();
        (fresh.epoch, fresh.late) = (self.epoch, self.late);
        fresh.edges.reshape(choices, fresh.grid);
        (fresh.plans, fresh.last_id) = (self.plans, self.last_id);
        fresh.pool = self.pool.take();
        if keep_points {
            fresh.copy_points(self);
        }
        *self = fresh;
    }

    /// An id for a request that this display does not plan itself: ids must grow over all that a link is asked.
    pub fn next_id(&mut self) -> u64 {
        self.last_id += 1;
        self.last_id
    }

    fn copy_points(&mut self, from: &Self) {
        let cache = &from.cache;
        for slot in 0..cache.capacity() {
            // A slot that is not in use has no `w`.
            if cache.w[slot].is_nan() {
                continue;
            }
            let sample = Sample {
                id: 0,
                position: [0, 1, 2].map(|axis| cache.position[axis][slot]),
                object: cache.info[slot].object,
                radiance: cache.rgb[slot],
                flags: cache.info[slot].flags,
            };
            if let Some(copy) = self.cache.insert(&sample, None) {
                self.cache.age[copy as usize] = cache.age[slot];
                self.cache.set_texel(copy, *cache.texel(slot as u32));
                self.due.clear(copy);
                if from.due.is_due(slot as u32) {
                    self.due.set(copy);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use protocol::messages::Camera;

    use super::*;
    use crate::camera::View;
    use crate::config::{Interpolation, Method};
    use crate::frame::{Received, Wanted};

    fn view(width: u32, height: u32) -> View {
        View::new(&Camera {
            eye: [0.6, 4.6, 8.0],
            target: [0.0, 1.05, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y: 40.0,
            width,
            height,
        })
    }

    /// Answers everything that is planned with a colour at a fixed depth.
    fn answers(view: &View, wanted: &Wanted) -> Vec<Received> {
        let answer = |r: &protocol::messages::SampleRequest| {
            let [x, y] = [r.x as f32 + r.offset[0], r.y as f32 + r.offset[1]];
            Received {
                view: 1,
                epoch: 0,
                sample: Sample {
                    id: r.id,
                    position: (view.eye + view.direction(x, y) * 9.0).into(),
                    object: 0,
                    radiance: [0.5, 0.25, 0.125],
                    flags: 0,
                },
                texel: None,
            }
        };
        wanted.here.iter().map(answer).collect()
    }

    #[test]
    fn points_edges_and_ids_outlive_a_change_of_size_and_method() {
        let scene = scenes::builtin("chains").unwrap().scene;
        // The answers lie on no surface of the scene, so that rays would find most of them hidden.
        let choices = Choices {
            point_culling: crate::config::PointCulling::None,
            ..Choices::default()
        };
        let mut display = Display::new(&scene, choices, 64, 48, 1);
        let mut wanted = Wanted::default();
        let small = view(64, 48);
        display.begin(&small, 1);
        display.plan_first(500, &mut wanted);
        display.receive(&answers(&small, &wanted), 1);
        display.draw(&small, 1);
        let before = display.take_stats(0);
        assert!(before.points > 400 && before.silhouette_edges > 0);

        let large = view(96, 80);
        display.rebuild(choices, 96, 80, true);
        display.begin(&large, 2);
        display.draw(&large, 2);
        let stats = display.take_stats(1);
        assert_eq!(stats.points, before.points);
        assert!(stats.samples_visible > 300 && stats.silhouette_edges > 0);
        assert!(stats.pixels.simple > 0);
        assert!(display.next_id() > wanted.here.iter().map(|r| r.id).max().unwrap());

        let points_only = Choices {
            method: Method::PointsOnly,
            interpolation: Interpolation::Paper,
            ..choices
        };
        display.rebuild(points_only, 96, 80, true);
        display.begin(&large, 2);
        display.draw(&large, 2);
        let stats = display.take_stats(2);
        assert_eq!((stats.pixels.simple, stats.pixels.complex), (0, 0));
        assert_eq!(stats.points, before.points);

        display.rebuild(choices, 96, 80, false);
        display.begin(&large, 2);
        display.draw(&large, 2);
        let stats = display.take_stats(3);
        assert!(stats.points == 0 && stats.pixels.simple > 0);
    }
}
