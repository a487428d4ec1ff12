//! A scene: oriented photographs and what is known of the place.

use super::Camera;
use crate::error::Result;
use crate::progress::{Event, Listener, Progress, Stage};
use crate::scene::ViewIndex;
use crate::store::import::{LoadedScene, load_scene};
use semvs_formats::Limits;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Oriented photographs with the sparse points that they share. See the [crate's page](crate#read-a-scene).
#[derive(Clone, Debug)]
pub struct Scene {
    loaded: LoadedScene,
    warnings: Vec<String>,
}

/// One photograph of a [`Scene`].
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    scene: &'a LoadedScene,
    index: ViewIndex,
}

impl Scene {
    /// Reads an `.mvs` file of any kind, or COLMAP's undistorted workspace, which is a folder. Photographs are looked for
    /// in the scene's folder.
    ///
    /// # Errors
    /// [`Error`](crate::Error): not there, not a scene, damaged, impossible cameras, fewer than two photographs with a pose.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        let path = path.as_ref();
        let folder = if path.is_dir() { path } else { path.parent().unwrap_or(Path::new("")) };
        let warnings = Arc::new(Warnings::default());
        let progress = Progress::new(warnings.clone());
        let loaded = load_scene(path, folder, &Limits::default(), &progress)?;
        let warnings = warnings.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        Ok(Scene { loaded, warnings })
    }

    /// What was wrong with the scene and could be left out, one line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The photographs in the order of the file.
    pub fn views(&self) -> impl ExactSizeIterator<Item = View<'_>> {
        let scene = &self.loaded;
        (0..scene.scene.views.len()).map(move |i| View { scene, index: ViewIndex(i as u32) })
    }

    /// The sparse points, scene units.
    pub fn sparse_points(&self) -> impl Iterator<Item = [f64; 3]> {
        self.loaded.scene.tracks.iter().map(|(point, _)| point.map(f64::from))
    }
}

impl View<'_> {
    /// Number that names its depth map, `depthNNNN.dmap`.
    pub fn id(&self) -> u32 {
        self.view().id.0
    }

    /// The photograph as the scene names it.
    pub fn name(&self) -> &str {
        &self.view().name
    }

    /// The file of the photograph, be it there or not.
    pub fn photograph(&self) -> PathBuf {
        self.scene.image_path(self.index)
    }

    /// The camera for the photograph at its full size; `None` for a photograph without pose or of unknown size.
    pub fn camera(&self) -> Option<Camera> {
        let calibration = self.view().calibration.as_ref()?;
        Some(Camera(calibration.camera_at(calibration.size?)))
    }

    fn view(&self) -> &crate::scene::View {
        &self.scene.scene.views[self.index.index()]
    }
}

/// Keeps warnings.
#[derive(Debug, Default)]
struct Warnings(Mutex<Vec<String>>);

impl Listener for Warnings {
    fn event(&self, event: &Event) {
        if let Event::Warning(text) = event {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(text.clone());
        }
    }

    fn steps(&self, _: Stage, _: usize, _: usize) {}
}
