//! Depth maps as pictures.

use super::record::with_threads;
use crate::error::{Error, Result};
use crate::geometry::Size;
use crate::progress::{Progress, Stage};
use crate::report::{Ramp, confidence_picture, depth_picture, depth_scale, label_overlay, normal_picture};
use crate::scene::{ColorImage, DepthEstimate, ResolutionOptions, ViewIndex};
use crate::store::atomic::create_folder;
use crate::store::depth_store::{read_depth_header, read_depth_map};
use crate::store::drawing::{put_text, text_width, write_picture};
use crate::store::images::{image_size, load_working_color};
use crate::store::labels::{LabelRequest, LabelSources, LabelStore};
use crate::store::paths::SearchPath;
use crate::store::run_folder::depth_maps_in;
use rayon::prelude::*;
use semvs_formats::Limits;
use std::path::{Path, PathBuf};

/// `preview`.
#[derive(Clone, Debug)]
pub struct PreviewJob {
    /// A depth map, or a folder of them.
    pub maps: PathBuf,
    /// Folder to write; `None`: that of the depth maps.
    pub output: Option<PathBuf>,
    /// First place of the images that the depth maps name; the second is their folder.
    pub working_folder: Option<PathBuf>,
    /// Label maps to lay over the photographs.
    pub labels: Option<LabelSources>,
    /// Depths of the two ends of the ramp; `None`: those of all maps together, but for outliers.
    pub scale: Option<(f32, f32)>,
    /// Threads; 0 = all of the machine.
    pub max_threads: usize,
}

/// Pictures that were written.
#[derive(Clone, Debug, PartialEq)]
pub struct Previews {
    /// The files.
    pub files: Vec<PathBuf>,
    /// Depths of the two ends of the ramp.
    pub scale: (f32, f32),
}

/// Depths of a map that the common scale is taken from.
const SCALE_SAMPLE: usize = 1 << 16;

/// Writes for every depth map `NAME.depth.png`, `NAME.normal.png`, `NAME.confidence.png` and `NAME.labels.png`, as far as
/// there is something to show, and `depth-scale.png`, which says what the colours of the depths mean: the same in all.
///
/// # Errors
/// No depth map is there, one cannot be read, label maps are asked for and cannot be used, or a place cannot be written.
pub fn preview(job: &PreviewJob, progress: &Progress) -> Result<Previews> {
    with_threads(job.max_threads, || run(job, progress))
}

fn run(job: &PreviewJob, progress: &Progress) -> Result<Previews> {
    if let Some((low, high)) = job.scale
        && !(low >= 0.0 && high > low && high.is_finite())
    {
        return Err(Error::invalid(format!(
            "--depth-range {low},{high}: give two depths, the smaller first"
        )));
    }
    let maps = match job.maps.is_dir() {
        true => depth_maps_in(&job.maps)?,
        false => vec![job.maps.clone()],
    };
    if maps.is_empty() {
        return Err(Error::content(&job.maps, "no depth map (.dmap) is in this folder"));
    }
    let sources = maps.iter().map(|path| Source::new(path, job)).collect::<Result<Vec<Source>>>()?;
    let labels = job.labels.as_ref().map(|labels| open_labels(labels, &sources, progress)).transpose()?;
    let scale = match job.scale {
        Some(scale) => scale,
        None => common_scale(&maps)?,
    };
    let folder = match &job.output {
        Some(folder) => folder.clone(),
        None if job.maps.is_dir() => job.maps.clone(),
        None => job.maps.parent().unwrap_or(Path::new("")).to_owned(),
    };
    if !folder.as_os_str().is_empty() {
        create_folder(&folder)?;
    }
    let steps = progress.start(Stage::DrawViews, maps.len());
    let draw = |(i, source): (usize, &Source)| -> Result<Vec<PathBuf>> {
        progress.check()?;
        let files = source.draw(ViewIndex(i as u32), &folder, scale, labels.as_ref());
        steps.step();
        files
    };
    let written: Vec<Vec<PathBuf>> = sources.par_iter().enumerate().map(draw).collect::<Result<_>>()?;
    let legend = folder.join("depth-scale.png");
    write_picture(&legend, &scale_picture(scale))?;
    Ok(Previews { files: written.into_iter().flatten().chain([legend]).collect(), scale })
}

/// A depth map and its image.
struct Source {
    path: PathBuf,
    image: PathBuf,
    size: Option<Size>,
}

impl Source {
    fn new(path: &Path, job: &PreviewJob) -> Result<Self> {
        let header = read_depth_header(path, Limits::default())?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let first = job.working_folder.as_deref().unwrap_or(folder);
        let image = SearchPath::new(first, path).find(&String::from_utf8_lossy(&header.image_name));
        let size = image_size(&image).ok();
        Ok(Source { path: path.to_owned(), image, size })
    }

    fn draw(
        &self,
        view: ViewIndex,
        folder: &Path,
        scale: (f32, f32),
        labels: Option<&LabelStore>,
    ) -> Result<Vec<PathBuf>> {
        let map = read_depth_map(&self.path, Limits::default())?;
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let mut pictures = vec![("depth", depth_picture(&map.depth, scale))];
        if let Some(normals) = &map.normal {
            pictures.push(("normal", normal_picture(normals, &map.depth)));
        }
        if let Some(confidence) = &map.confidence {
            pictures.push(("confidence", confidence_picture(confidence, &map.depth)));
        }
        if let Some(labels) = labels.filter(|labels| labels.file(view).is_some()) {
            pictures.push(("labels", self.overlay(view, &map, labels)?));
        }
        let file = |(what, picture): (&str, ColorImage)| -> Result<PathBuf> {
            let path = folder.join(format!("{stem}.{what}.png"));
            write_picture(&path, &picture)?;
            Ok(path)
        };
        pictures.into_iter().map(file).collect()
    }

    fn overlay(&self, view: ViewIndex, map: &DepthEstimate, labels: &LabelStore) -> Result<ColorImage> {
        let size = map.depth.size();
        let at = ResolutionOptions { level: 0, max: size.longest(), ..ResolutionOptions::default() };
        let photograph = load_working_color(&self.image, &at)?;
        Ok(label_overlay(&*labels.load(view, size)?, labels.table(), &photograph))
    }
}

fn open_labels(sources: &LabelSources, maps: &[Source], progress: &Progress) -> Result<LabelStore> {
    let request = |(i, map): (usize, &Source)| LabelRequest {
        view: ViewIndex(i as u32),
        image: map.image.clone(),
        mask: None,
        size: map.size,
    };
    let requests: Vec<LabelRequest> = maps.iter().enumerate().map(request).collect();
    LabelStore::open(sources, &requests, Limits::default(), progress)
}

fn common_scale(maps: &[PathBuf]) -> Result<(f32, f32)> {
    let sample = |path: &PathBuf| -> Result<Vec<f32>> {
        let map = read_depth_map(path, Limits::default())?;
        let step = map.depth.data().len().div_ceil(SCALE_SAMPLE).max(1);
        Ok(map.depth.data().iter().copied().step_by(step).filter(|d| *d > 0.0).collect())
    };
    let samples: Vec<Vec<f32>> = maps.par_iter().map(sample).collect::<Result<_>>()?;
    Ok(depth_scale(&mut samples.concat()))
}

/// The ramp of depths with the depths of its ends.
fn scale_picture(scale: (f32, f32)) -> ColorImage {
    const WIDTH: usize = 480;
    const BAR: usize = 24;
    const MARGIN: usize = 8;
    let size = Size::new((WIDTH + 2 * MARGIN) as u32, (BAR + 20 + 3 * MARGIN) as u32);
    let mut picture = ColorImage::filled(size, [255; 3]);
    for x in 0..WIDTH {
        let color = Ramp::DEPTH.at(x as f32 / (WIDTH - 1) as f32);
        (0..BAR).for_each(|y| picture[(MARGIN + x, MARGIN + y)] = color);
    }
    let number = |v: f32| {
        let digits = 3usize.saturating_sub(v.abs().log10().max(0.0) as usize);
        if v != 0.0 && !(1e-2..1e6).contains(&v) { format!("{v:.2e}") } else { format!("{v:.digits$}") }
    };
    let (low, high) = (number(scale.0), number(scale.1));
    put_text(&mut picture, MARGIN, BAR + 2 * MARGIN, &low);
    put_text(&mut picture, MARGIN + WIDTH - text_width(&high).min(WIDTH / 2), BAR + 2 * MARGIN, &high);
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_has_its_ramp_and_its_numbers() {
        for scale in [(0.0, 1.0), (3.25, 12345.678), (1e-6, 2e-6), (0.0, 3e8)] {
            let picture = scale_picture(scale);
            assert_eq!(picture[(8, 10)], Ramp::DEPTH.at(0.0));
            assert_eq!(picture[(487, 10)], Ramp::DEPTH.at(1.0));
            let dark = picture.data()[40 * picture.width()..].iter().filter(|p| p[0] < 100).count();
            assert!(dark > 50, "{dark}");
        }
    }
}
