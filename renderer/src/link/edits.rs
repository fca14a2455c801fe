//! What has moved since the scene was sent.

use std::collections::BTreeMap;

use protocol::limits::MAX_MOVES;
use protocol::messages::{LightMove, ObjectMove};
use protocol::scene::{Affine, Light, Scene};
use protocol::session::SceneSize;
use protocol::validate::{Problem, ValueError, validate_light, validate_transform};

/// Lights in one message: with the most vertices each, they and [`MAX_MOVES`] objects fit a frame.
const LIGHTS_A_MESSAGE: usize = 256;

/// The newest place of everything that moved, with the epoch in which it last did.
///
/// A server is told of all changes since the epoch it knows at once, so that one that lags, or comes late, is sent no
/// more than it needs.
#[derive(Clone, Debug)]
pub(super) struct Edits {
    epoch: u32,
    objects: BTreeMap<u32, (u32, Affine)>,
    lights: BTreeMap<u32, (u32, Light)>,
    size: SceneSize,
    kinds: Vec<std::mem::Discriminant<Light>>,
}

impl Edits {
    pub(super) fn new(scene: &Scene) -> Self {
        Self {
            epoch: 0,
            objects: BTreeMap::new(),
            lights: BTreeMap::new(),
            size: SceneSize::from(scene),
            kinds: scene.lights.iter().map(std::mem::discriminant).collect(),
        }
    }

    pub(super) fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Begins a new epoch. Nothing changes if a value is not allowed.
    pub(super) fn add(
        &mut self,
        objects: &[ObjectMove],
        lights: &[LightMove],
    ) -> Result<u32, ValueError> {
        let wrong = |place: String, problem| ValueError { place, problem };
        for (i, moved) in objects.iter().enumerate() {
            let len = self.size.objects;
            if moved.object as usize >= len {
                let problem = Problem::Index {
                    index: moved.object,
                    len,
                };
                return Err(wrong(format!("objects[{i}].object"), problem));
            }
            validate_transform(&moved.transform)
                .map_err(|problem| wrong(format!("objects[{i}].transform"), problem))?;
        }
        for (i, moved) in lights.iter().enumerate() {
            validate_light(&moved.value).map_err(|e| e.inside(&format!("lights[{i}].value")))?;
            if self.kinds.get(moved.light as usize) != Some(&std::mem::discriminant(&moved.value)) {
                let problem = Problem::Other("there is no such light of this kind");
                return Err(wrong(format!("lights[{i}].light"), problem));
            }
        }
        self.epoch += 1;
        for moved in objects {
            self.objects
                .insert(moved.object, (self.epoch, moved.transform));
        }
        for moved in lights {
            self.lights
                .insert(moved.light, (self.epoch, moved.value.clone()));
        }
        Ok(self.epoch)
    }

    /// Everything that moved after this epoch, in parts that fit a message; one empty part if nothing did.
    pub(super) fn since(&self, epoch: u32) -> Vec<(Vec<ObjectMove>, Vec<LightMove>)> {
        let objects: Vec<_> = self
            .objects
            .iter()
            .filter(|(_, (at, _))| *at > epoch)
            .map(|(&object, &(_, transform))| ObjectMove { object, transform })
            .collect();
        let lights: Vec<_> = self
            .lights
            .iter()
            .filter(|(_, (at, _))| *at > epoch)
            .map(|(&light, (_, value))| LightMove {
                light,
                value: value.clone(),
            })
            .collect();
        let mut objects = objects.chunks(MAX_MOVES);
        let mut lights = lights.chunks(LIGHTS_A_MESSAGE);
        let mut parts = Vec::new();
        loop {
            match (objects.next(), lights.next()) {
                (None, None) if !parts.is_empty() => return parts,
                (o, l) => parts.push((o.unwrap_or(&[]).to_vec(), l.unwrap_or(&[]).to_vec())),
            }
        }
    }

    /// The scene as it is now.
    pub(super) fn applied(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        for (&i, (_, transform)) in &self.objects {
            scene.objects[i as usize].transform = *transform;
        }
        for (&i, (_, light)) in &self.lights {
            scene.lights[i as usize] = light.clone();
        }
        scene
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::scene;
    use super::*;

    fn moved(object: u32, x: f32) -> ObjectMove {
        let transform = [
            [1.0, 0.0, 0.0, x],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
        ];
        ObjectMove { object, transform }
    }

    #[test]
    fn a_late_server_is_told_only_the_newest_places() {
        let scene = scene(3);
        let mut edits = Edits::new(&scene);
        edits.add(&[moved(0, 1.0), moved(1, 1.0)], &[]).unwrap();
        edits.add(&[moved(0, 2.0)], &[]).unwrap();
        assert_eq!(
            edits.since(0),
            [(vec![moved(0, 2.0), moved(1, 1.0)], vec![])]
        );
        assert_eq!(edits.since(1), [(vec![moved(0, 2.0)], vec![])]);
        assert_eq!(edits.since(2), [(vec![], vec![])]);
        assert_eq!(
            edits.applied(&scene).objects[0].transform,
            moved(0, 2.0).transform
        );
    }

    #[test]
    fn long_lists_are_split() {
        let scene = scene(MAX_MOVES + 5);
        let mut edits = Edits::new(&scene);
        let all: Vec<_> = (0..MAX_MOVES as u32 + 5).map(|i| moved(i, 1.0)).collect();
        edits.add(&all, &[]).unwrap();
        let lengths: Vec<_> = edits.since(0).iter().map(|part| part.0.len()).collect();
        assert_eq!(lengths, [MAX_MOVES, 5]);
    }

    #[test]
    fn bad_edits_change_nothing() {
        let mut edits = Edits::new(&scene(1));
        assert_eq!(
            edits.add(&[moved(1, 0.0)], &[]).unwrap_err().place,
            "objects[0].object"
        );
        assert!(edits.add(&[moved(0, f32::NAN)], &[]).is_err());
        let value = Light::Linear {
            from: [0.0; 3],
            to: [1.0; 3],
            intensity: [1.0; 3],
        };
        let error = edits
            .add(&[], &[LightMove { light: 0, value }])
            .unwrap_err();
        assert_eq!(error.place, "lights[0].light");
        assert_eq!(edits.epoch(), 0);
    }
}
