//! Scenes that need not be sent again.

use std::sync::{Arc, Mutex, PoisonError};

use protocol::messages::Digest;

use crate::stage::Stage;

/// Scenes kept.
const KEPT: usize = 4;

/// The scenes used last, newest first.
#[derive(Default)]
pub(super) struct SceneCache {
    // A std mutex, since nothing is awaited while it is held.
    scenes: Mutex<Vec<(Digest, Arc<Stage>)>>,
}

impl SceneCache {
    /// All scenes held now.
    pub(super) fn snapshot(&self) -> Vec<(Digest, Arc<Stage>)> {
        self.scenes
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// Notes that a scene is in use.
    pub(super) fn touch(&self, digest: Digest, stage: &Arc<Stage>) {
        let mut scenes = self.scenes.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.retain(|(known, _)| *known != digest);
        scenes.insert(0, (digest, Arc::clone(stage)));
        scenes.truncate(KEPT);
    }
}
