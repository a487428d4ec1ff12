//! A scene with its depth maps and cloud as a COLMAP workspace.

use super::export::{image_files, names_below_common_folder};
use super::import::row;
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::progress::Progress;
use crate::report::{OutputReport, RunReport};
use crate::store::archive::same_place;
use crate::store::atomic::{create_folder, write_file};
use crate::store::cameras::cameras_at_image_size;
use crate::store::colmap::{has_maps, model_from_scene, write_configs, write_fused, write_maps, write_model};
use crate::store::depth_store::{DepthStore, Existing};
use crate::store::import::{LoadedScene, load_scene};
use rayon::prelude::*;
use semvs_formats::colmap::{Encoding, Model};
use semvs_formats::{Limits, ply};
use std::fs::File;
use std::path::{Path, PathBuf};

/// `export --to colmap`.
#[derive(Clone, Debug)]
pub struct ExportColmapJob {
    /// A `.mvs` file or a COLMAP workspace.
    pub scene: PathBuf,
    /// First place of images named by the scene.
    pub working_folder: PathBuf,
    /// The workspace to write; the one that the scene is gets maps only.
    pub output: PathBuf,
    /// Encoding of the sparse model.
    pub encoding: Encoding,
    /// Folder of depth maps to write as those of COLMAP's geometric pass.
    pub depth_maps: Option<PathBuf>,
    /// Cloud with view lists to write as `fused.ply`.
    pub cloud: Option<PathBuf>,
    /// Copy the images into the workspace.
    pub copy_images: bool,
}

/// Writes the workspace: `sparse/`, and as the job asks `stereo/`, `fused.ply` with `fused.ply.vis`, `images/`.
///
/// # Errors
/// Unreadable files; a place that cannot be written or holds files of COLMAP.
pub fn export_colmap(job: &ExportColmapJob, progress: &Progress) -> Result<RunReport> {
    let loaded = load_scene(&job.scene, &job.working_folder, &Limits::default(), progress)?;
    let is_host = loaded.workspace.is_some() && same_place(&job.output, &job.scene);
    let cameras = cameras_at_image_size(&loaded, false, progress)?;
    let files = image_files(&loaded);
    let names = match &loaded.workspace {
        Some(workspace) => {
            let prefix = workspace.image_prefix(&workspace.root);
            let name =
                |view: &crate::scene::View| view.name.strip_prefix(&prefix).unwrap_or(&view.name).to_owned();
            loaded.scene.views.iter().map(name).collect()
        }
        None => names_below_common_folder(&files),
    };
    spare(job, is_host, &names)?;
    let mut outputs = Vec::new();
    let model = model_from_scene(&loaded.scene, &cameras, &names, &loaded.archive.points);
    if !is_host {
        let sparse = job.output.join("sparse");
        write_model(&sparse, &model, job.encoding)?;
        outputs.push(row(&sparse, "sparse model", Some(model.points.len() as u64)));
    }
    if let Some(folder) = &job.depth_maps {
        outputs.extend(export_maps(job, folder, &loaded, &cameras, &names, progress)?);
    }
    if let Some(cloud) = &job.cloud {
        outputs.push(export_cloud(&job.output.join("fused.ply"), cloud, &cameras)?);
    }
    if job.copy_images && !is_host {
        outputs.push(copy_images(&job.output.join("images"), &files, &names, &cameras)?);
    } else if !is_host {
        progress.warn(format!(
            "the images are not copied; COLMAP looks for them in {} (--copy-images)",
            job.output.join("images").display()
        ));
    }
    Ok(RunReport { outputs, ..RunReport::default() })
}

/// Refuses to write over files of COLMAP.
fn spare(job: &ExportColmapJob, is_host: bool, names: &[String]) -> Result<()> {
    let sparse = job.output.join("sparse");
    if !is_host && (Model::encoding_in(&sparse).is_some() || Model::encoding_in(&job.output).is_some()) {
        let what = "a COLMAP model is here already: choose another folder, or give this one as the scene to add maps";
        return Err(Error::content(&job.output, what));
    }
    if is_host && job.depth_maps.is_none() && job.cloud.is_none() {
        let what =
            "--output: this is the input; choose another folder, or give --depth-maps to add maps to it";
        return Err(Error::content(&job.output, what));
    }
    let stereo = job.output.join("stereo");
    if job.depth_maps.is_some() && has_maps(&stereo, names) {
        let what = "depth maps of COLMAP's geometric pass are here; move them away or choose another folder";
        return Err(Error::content(&stereo.join("depth_maps"), what));
    }
    let fused = job.output.join("fused.ply");
    if job.cloud.is_some() && fused.exists() {
        return Err(Error::content(&fused, "the file exists; move it away or choose another folder"));
    }
    Ok(())
}

fn export_maps(
    job: &ExportColmapJob,
    folder: &Path,
    loaded: &LoadedScene,
    cameras: &[Option<Camera>],
    names: &[String],
    progress: &Progress,
) -> Result<Vec<OutputReport>> {
    let store = DepthStore::new(folder, loaded.search.clone(), 0, Limits::default());
    let stereo = job.output.join("stereo");
    let views = &loaded.scene.views;
    let written = (0..views.len()).into_par_iter().map(|i| {
        let (Some(full), Some(header)) = (&cameras[i], store.header(views[i].id)?) else { return Ok(false) };
        let at = full.scaled_per_axis(crate::geometry::Size::new(header.width, header.height));
        match store.existing(views[i].id, &at) {
            Existing::Usable => {}
            Existing::Absent => return Ok(false),
            Existing::Unusable(why) => return Err(Error::invalid(why)),
        }
        write_maps(&stereo, &names[i], &*store.read(views[i].id)?)?;
        Ok(true)
    });
    let written: Vec<bool> = written.collect::<Result<_>>()?;
    let used: Vec<&str> =
        names.iter().zip(&written).filter(|(_, written)| **written).map(|(n, _)| n.as_str()).collect();
    if used.is_empty() {
        return Err(Error::content(folder, "no depth map of the scene's images (depthNNNN.dmap) is here"));
    }
    if used.len() < cameras.iter().flatten().count() {
        progress.warn(format!("{}: {} images have no depth map", folder.display(), names.len() - used.len()));
    }
    create_folder(&stereo.join("consistency_graphs"))?;
    write_configs(&stereo, &used)?;
    let maps = stereo.join("depth_maps/*.geometric.bin");
    Ok(vec![row(&maps, &format!("{} depth maps", used.len()), None)])
}

fn export_cloud(path: &Path, cloud: &Path, cameras: &[Option<Camera>]) -> Result<OutputReport> {
    let file = File::open(cloud).map_err(|e| Error::io(cloud, "open", e))?;
    let points = ply::read_cloud(file, &Limits::default()).map_err(|e| Error::format(cloud, e))?;
    if points.is_empty() || !points.has_views() {
        let what = "a cloud with view_indices is needed: densify with --ply-layout openmvs";
        return Err(Error::content(cloud, what));
    }
    if let Some(bad) = points.views.images.iter().find(|&&i| i as usize >= cameras.len()) {
        let what = format!("a point is seen by image {bad}, the scene has {} images", cameras.len());
        return Err(Error::content(cloud, what));
    }
    let mut next = 0;
    let place = |camera: &Option<Camera>| {
        camera.as_ref().map(|_| {
            next += 1;
            next - 1
        })
    };
    let place_of: Vec<Option<u32>> = cameras.iter().map(place).collect();
    let count = points.len() as u64;
    write_fused(path, points, &place_of)?;
    Ok(row(path, "dense cloud", Some(count)))
}

fn copy_images(
    folder: &Path,
    files: &[PathBuf],
    names: &[String],
    cameras: &[Option<Camera>],
) -> Result<OutputReport> {
    for ((file, name), _) in files.iter().zip(names).zip(cameras).filter(|(_, camera)| camera.is_some()) {
        let target = folder.join(name);
        if !same_place(file, &target) {
            let bytes = std::fs::read(file).map_err(|e| Error::io(file, "read", e))?;
            write_file(&target, &bytes)?;
        }
    }
    Ok(row(folder, "images", None))
}
