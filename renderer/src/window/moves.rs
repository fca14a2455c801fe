//! Paths of objects and lights played in the window, one name after another.

use std::sync::Arc;

use protocol::scene::Scene;
use scenes::Motion;

use crate::frame::Edit;

/// What can be played, and what is.
pub(super) struct Moves {
    scene: Arc<Scene>,
    motions: Vec<Motion>,
    names: Vec<String>,
    playing: Option<(usize, f32)>,
}

impl Moves {
    /// The scene as it was loaded, and its paths.
    pub(super) fn new(scene: &Arc<Scene>, motions: &[Motion]) -> Self {
        let mut names: Vec<String> = Vec::new();
        for motion in motions {
            if !names.contains(&motion.name) {
                names.push(motion.name.clone());
            }
        }
        Self {
            scene: Arc::clone(scene),
            motions: motions.to_vec(),
            names,
            playing: None,
        }
    }

    /// Plays the next name's paths, from none to the first and from the last to none. Gives what puts back what was moved.
    pub(super) fn play_next(&mut self) -> Edit {
        let back = match self.playing {
            Some((name, _)) => self.at_rest(name),
            None => Edit::default(),
        };
        let next = self.playing.map_or(0, |(name, _)| name + 1);
        self.playing = (next < self.names.len()).then_some((next, 0.0));
        back
    }

    /// The name that is playing.
    pub(super) fn playing(&self) -> Option<&str> {
        self.playing.map(|(name, _)| &*self.names[name])
    }

    /// Whether there is nothing to play.
    pub(super) fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Goes on by this much time; gives where everything is then.
    pub(super) fn advance(&mut self, seconds: f32) -> Edit {
        let mut edit = Edit::default();
        if let Some((name, time)) = &mut self.playing {
            *time += seconds;
            for motion in self.motions.iter().filter(|m| m.name == self.names[*name]) {
                motion.place(&self.scene, *time, &mut edit.objects, &mut edit.lights);
            }
        }
        edit
    }

    fn at_rest(&self, name: usize) -> Edit {
        let mut edit = Edit::default();
        for motion in self.motions.iter().filter(|m| m.name == self.names[name]) {
            motion.place(&self.scene, 0.0, &mut edit.objects, &mut edit.lights);
        }
        for moved in &mut edit.objects {
            moved.transform = self.scene.objects[moved.object as usize].transform;
        }
        for moved in &mut edit.lights {
            moved.value = self.scene.lights[moved.light as usize].clone();
        }
        edit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_played_in_turn_and_everything_goes_back() {
        let loaded = scenes::builtin("chains").unwrap();
        let scene = Arc::new(loaded.scene);
        let mut moves = Moves::new(&scene, &loaded.motions);
        assert!(!moves.is_empty() && moves.advance(1.0).is_empty());
        for name in ["drag", "lamp", "switch"] {
            moves.play_next();
            assert_eq!(moves.playing(), Some(name));
            assert!(!moves.advance(1.0).is_empty());
        }
        let back = moves.play_next();
        assert_eq!(back.lights[0].value, scene.lights[0]);
        assert!(moves.playing().is_none() && moves.advance(1.0).is_empty());
        assert!(Moves::new(&scene, &[]).is_empty());
    }
}
