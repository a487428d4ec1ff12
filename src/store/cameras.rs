//! The cameras at working resolution, and which views can be used at all.

use super::images::image_size;
use super::import::LoadedScene;
use crate::error::{Error, Result};
use crate::geometry::{Camera, Size};
use crate::progress::Progress;
use crate::scene::{Calibration, ResolutionOptions, ViewIndex};
use rayon::prelude::*;

/// The camera of every view at the size at which its photograph is processed; `None` for uncalibrated images and for
/// those whose photograph is missing, unreadable or of another shape than the scene says, which a warning names.
/// Only the headers of the photographs are read.
///
/// # Errors
/// [`Error`] if fewer than two views can be used, or if `strict` and a photograph cannot.
pub fn working_cameras(
    loaded: &LoadedScene,
    resolution: &ResolutionOptions,
    strict: bool,
    progress: &Progress,
) -> Result<Vec<Option<Camera>>> {
    resolution.check()?;
    let views = &loaded.scene.views;
    let cameras: Vec<Option<Result<Camera>>> = (0..views.len())
        .into_par_iter()
        .map(|i| {
            let calibration = views[i].calibration.as_ref()?;
            Some(working_camera(loaded, ViewIndex(i as u32), calibration, resolution))
        })
        .collect();
    let mut usable = Vec::with_capacity(cameras.len());
    let mut first_problem = None;
    for (i, camera) in cameras.into_iter().enumerate() {
        usable.push(match camera {
            Some(Ok(camera)) => Some(camera),
            Some(Err(error)) if strict => return Err(error),
            Some(Err(error)) => {
                progress.warn(format!("{error}; view {i} is left out"));
                first_problem.get_or_insert(error.to_string());
                None
            }
            None => None,
        });
    }
    let count = usable.iter().flatten().count();
    if count < 2 {
        let what = format!(
            "{count} of its {} images can be used: at least two with a pose and a readable file are needed{}",
            views.len(),
            first_problem.map(|problem| format!("; {problem}")).unwrap_or_default()
        );
        return Err(Error::content(&loaded.path, what));
    }
    Ok(usable)
}

/// The camera of every view at the size of its photograph, as [`working_cameras`] gives them.
///
/// # Errors
/// Those of [`working_cameras`].
pub fn cameras_at_image_size(
    loaded: &LoadedScene,
    strict: bool,
    progress: &Progress,
) -> Result<Vec<Option<Camera>>> {
    let full = ResolutionOptions { level: 0, max: u32::MAX, ..ResolutionOptions::default() };
    working_cameras(loaded, &full, strict, progress)
}

fn working_camera(
    loaded: &LoadedScene,
    view: ViewIndex,
    calibration: &Calibration,
    resolution: &ResolutionOptions,
) -> Result<Camera> {
    let path = loaded.image_path(view);
    if !path.exists() {
        return Err(missing(loaded, view));
    }
    let size = image_size(&path)?;
    if let Some(stated) = calibration.size.filter(|&stated| !same_shape(stated, size)) {
        let what =
            format!("{size} pixels, but the scene says {stated}: was it rotated, cropped or replaced?");
        return Err(Error::content(&path, what));
    }
    let working = resolution.working_size(size);
    if working.width.min(working.height) < LEAST_SIDE {
        let what = format!(
            "its working size is {working} pixels, at least {LEAST_SIDE} each way are needed; use a lower \
             --resolution-level or a higher --max-resolution"
        );
        return Err(Error::content(&path, what));
    }
    Ok(calibration.camera_at(working))
}

/// Fewer pixels than this do not hold the window by which images are matched.
const LEAST_SIDE: u32 = 9;

/// The photograph is in neither of the places where it may be.
fn missing(loaded: &LoadedScene, view: ViewIndex) -> Error {
    let [first, second] = loaded.search.places(&loaded.scene.views[view.index()].name);
    if first == second {
        return Error::content(&first, "no such image; names are relative to the working folder (-w)");
    }
    let what =
        format!("no such image in the working folder (-w), nor beside the scene: {}", second.display());
    Error::content(&first, what)
}

/// The camera of a depth map of size `map`, of an image of size `full`: as [`Calibration::camera_at`], but where
/// `map` was rounded by another rule, each axis has a factor of its own. `None` if it is not the image's shape.
pub fn camera_of_map(calibration: &Calibration, full: Size, map: Size) -> Option<Camera> {
    let at = ResolutionOptions { level: 0, max: map.longest(), ..ResolutionOptions::default() };
    if at.working_size(full) == map {
        return Some(calibration.camera_at(map));
    }
    let fits = map.longest() <= full.longest() && same_shape(full, map);
    fits.then(|| calibration.camera_at(full).scaled_per_axis(map))
}

/// A photograph smaller than the scene says by more than this is another one, a thumbnail perhaps.
const MOST_REDUCED: f64 = 1.0 / 8.0;

/// Whether `file` is `stated` at another scale, given that either may have been rounded to whole pixels.
fn same_shape(stated: Size, file: Size) -> bool {
    let factor = f64::from(file.longest()) / f64::from(stated.longest());
    if factor < MOST_REDUCED {
        return false;
    }
    let tolerance = 0.5 * factor.max(1.0) + 1.0;
    let agrees = |s: u32, f: u32| (f64::from(s) * factor - f64::from(f)).abs() <= tolerance;
    agrees(stated.width, file.width) && agrees(stated.height, file.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_agree_up_to_rounding() {
        let size = Size::new;
        assert!(same_shape(size(640, 479), size(640, 479)));
        assert!(same_shape(size(80, 60), size(640, 479)));
        assert!(same_shape(size(640, 479), size(80, 60)));
        assert!(!same_shape(size(400, 300), size(40, 30)), "a thumbnail");
        assert!(!same_shape(size(400, 300), size(1, 1)));
        assert!(!same_shape(size(640, 479), size(479, 640)));
        assert!(!same_shape(size(640, 480), size(640, 470)));
        assert!(!same_shape(size(640, 480), size(600, 480)));
    }
}
