//! A town as a drive needs it: to be driven in, and to be seen.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

use crate::{
    error::Result, scene::surroundings::Surroundings, sensors::rays::Standing, world::town::Town,
};

/// A town with its surfaces.
pub struct Stage {
    pub town: Town,
    pub surroundings: Surroundings,
    /// The same surfaces, ready for rays.
    pub standing: Standing,
}

impl Stage {
    pub fn new(town: Town) -> Stage {
        let surroundings = Surroundings::of(&town.map, &town.scenery);
        let standing = Standing::new(&surroundings);
        Stage { town, surroundings, standing }
    }
}

/// Towns that are built when they are first asked for, and then shared.
pub struct Stages {
    maps: Option<PathBuf>,
    stages: Vec<(String, Mutex<Option<Arc<Stage>>>)>,
}

impl Stages {
    /// Towns of a folder of OpenDRIVE files, or the package's own.
    pub fn new(maps: Option<&Path>, towns: &[String]) -> Stages {
        let stages = towns.iter().map(|town| (town.clone(), Mutex::default())).collect();
        Stages { maps: maps.map(Path::to_path_buf), stages }
    }

    /// A town by its name.
    ///
    /// # Errors
    ///
    /// As [`Town::open`].
    pub fn get(&self, name: &str) -> Result<Arc<Stage>> {
        let open = || Ok(Arc::new(Stage::new(Town::open(self.maps.as_deref(), name)?)));
        let Some((_, stage)) = self.stages.iter().find(|(town, _)| town == name) else {
            return open();
        };
        // Whoever panicked while building has left nothing half-built behind.
        let mut stage = stage.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(stage) = &*stage {
            return Ok(stage.clone());
        }
        let built = open()?;
        *stage = Some(built.clone());
        Ok(built)
    }
}
