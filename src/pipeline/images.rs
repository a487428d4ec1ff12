//! The photographs at working size, decoded when they are needed and kept within a budget.

use super::memory_plan::MemoryPlan;
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::progress::{Progress, Stage};
use crate::scene::{
    ColorImage, GrayImage, ResolutionOptions, ViewIndex, gray_from_color, resize_gray, resize_nearest,
};
use crate::stereo::SourceTexels;
use crate::store::byte_cache::ByteCache;
use crate::store::images::load_working_color;
use crate::store::import::LoadedScene;
use rayon::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// The photographs of a scene's views.
#[derive(Debug)]
pub(super) struct Images {
    paths: Vec<PathBuf>,
    colors: ByteCache<ViewIndex, ColorImage>,
    texels: ByteCache<SourceKey, SourceTexels>,
}

/// What decides the texels of a source: its view, the bits of the factor that it is resized by, how often it is halved.
type SourceKey = (ViewIndex, u32, u32);

impl Images {
    /// The photographs of all views; nothing is read yet.
    pub(super) fn new(loaded: &LoadedScene, memory: &MemoryPlan) -> Self {
        let views = 0..loaded.scene.views.len();
        Images {
            paths: views.map(|i| loaded.image_path(ViewIndex(i as u32))).collect(),
            colors: ByteCache::new(memory.colors),
            texels: ByteCache::new(memory.texels),
        }
    }

    /// The file of a view.
    pub(super) fn path(&self, view: ViewIndex) -> &PathBuf {
        &self.paths[view.index()]
    }

    /// The colours of a view at exactly `size`.
    ///
    /// # Errors
    /// The file cannot be decoded or has another shape.
    pub(super) fn color(&self, view: ViewIndex, size: Size) -> Result<Arc<ColorImage>> {
        let image = self.colors.get_or_load(view, || {
            let mut image = load_working_color(self.path(view), &at_longest(size))?;
            if differs_by_rounding(image.size(), size) {
                image = resize_nearest(&image, size);
            }
            let bytes = size_of_val(image.data());
            Ok((image, bytes))
        })?;
        self.require_size(view, image.size(), size)?;
        Ok(image)
    }

    /// The luma of a view at exactly `size`.
    ///
    /// # Errors
    /// As [`Images::color`].
    pub(super) fn gray(&self, view: ViewIndex, size: Size) -> Result<Arc<GrayImage>> {
        Ok(Arc::new(gray_from_color(&*self.color(view, size)?)))
    }

    /// A view at `scale` times `size`, and halved up to `halvings` times, as others are matched with it.
    ///
    /// # Errors
    /// As [`Images::color`].
    pub(super) fn texels(
        &self,
        view: ViewIndex,
        size: Size,
        scale: f32,
        halvings: u32,
    ) -> Result<Arc<SourceTexels>> {
        self.texels.get_or_load((view, scale.to_bits(), halvings), || {
            let gray = self.gray(view, size)?;
            let texels = match scale == 1.0 {
                true => SourceTexels::new(&gray, halvings),
                false => SourceTexels::new(&resize_gray(&gray, f64::from(scale)), halvings),
            };
            let bytes = texels.bytes();
            Ok((texels, bytes))
        })
    }

    /// Keeps no more of what only estimation needs: texels.
    pub(super) fn finish_matching(&self) {
        self.texels.set_budget(0);
    }

    fn require_size(&self, view: ViewIndex, found: Size, wanted: Size) -> Result<()> {
        if found == wanted {
            return Ok(());
        }
        Err(Error::content(self.path(view), format!("scales to {found} pixels, {wanted} are needed")))
    }

    /// Decodes the photograph of every view that has a camera, in parallel, and returns what is wrong with those
    /// that cannot be used.
    pub(super) fn check(&self, cameras: &[Option<Camera>], progress: &Progress) -> Vec<(ViewIndex, Error)> {
        let used: Vec<(ViewIndex, Size)> = cameras
            .iter()
            .enumerate()
            .filter_map(|(i, camera)| camera.as_ref().map(|c| (ViewIndex(i as u32), c.size())))
            .collect();
        let steps = progress.start(Stage::PrepareImages, used.len());
        let results: Vec<Option<(ViewIndex, Error)>> = used
            .into_par_iter()
            .with_max_len(1)
            .map(|(view, size)| {
                progress.check().ok()?;
                let failed = self.color(view, size).err().map(|error| (view, error));
                steps.step();
                failed
            })
            .collect();
        results.into_iter().flatten().collect()
    }
}

/// Whether two sizes are one, rounded by different rules, as those of COLMAP's maps.
fn differs_by_rounding(a: Size, b: Size) -> bool {
    a != b && a.width.abs_diff(b.width) <= 1 && a.height.abs_diff(b.height) <= 1
}

/// The resolution at which an image gets `size`.
fn at_longest(size: Size) -> ResolutionOptions {
    ResolutionOptions { level: 0, max: size.longest(), ..ResolutionOptions::default() }
}
