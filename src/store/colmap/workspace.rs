//! Where the parts of a COLMAP workspace are.

use crate::error::{Error, Result};
use semvs_formats::Limits;
use semvs_formats::colmap::{CameraModel, Model};
use std::path::{Path, PathBuf};

/// A COLMAP folder: an undistorted workspace (`images/`, `sparse/`, `stereo/`) or a sparse model with its images.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Workspace {
    /// The folder as given.
    pub root: PathBuf,
    /// The folder of the sparse model.
    pub sparse: PathBuf,
    /// The folder of the images.
    pub images: PathBuf,
}

/// Which pass of COLMAP's dense stage made a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pass {
    /// The final pass, which compares depth maps with each other.
    Geometric,
    /// The first pass.
    Photometric,
}

impl Pass {
    /// Both, the better one first.
    pub const ALL: [Pass; 2] = [Pass::Geometric, Pass::Photometric];

    /// The word in file names.
    pub fn name(self) -> &'static str {
        match self {
            Pass::Geometric => "geometric",
            Pass::Photometric => "photometric",
        }
    }
}

impl Workspace {
    /// The workspace at `root`: its model is in `sparse/`, `sparse/0/` or `root` itself. The images are in
    /// `images`, else in `root/images/`, or in the `images/` beside or above the model.
    ///
    /// # Errors
    /// [`Error::Content`] if there is no model or no folder of images.
    pub fn at(root: &Path, images: Option<&Path>) -> Result<Self> {
        let places = [root.join("sparse"), root.join("sparse/0"), root.to_owned()];
        let Some(sparse) = places.into_iter().find(|place| Model::encoding_in(place).is_some()) else {
            let what = "no COLMAP workspace: cameras, images and points3D as .bin or .txt are needed in it or in its \
                        sparse/ folder; give the output folder of `colmap image_undistorter`, or an .mvs file";
            return Err(Error::content(root, what));
        };
        let above = |levels: usize| {
            let folder = std::path::absolute(&sparse).ok()?;
            folder.ancestors().nth(levels).map(|folder| folder.join("images"))
        };
        let found = match images {
            Some(images) => Some(images.to_owned()).filter(|folder| folder.is_dir()),
            None => [Some(root.join("images")), above(1), above(2)]
                .into_iter()
                .flatten()
                .find(|folder| folder.is_dir()),
        };
        let Some(images) = found else {
            let what = match images {
                Some(images) => format!("{}: no such folder of images", images.display()),
                None => "no images/ folder in or beside it: give the output folder of `colmap image_undistorter`, or make a scene \
                         with semvs import --image-path DIR"
                    .to_owned(),
            };
            return Err(Error::content(root, what));
        };
        Ok(Workspace { root: root.to_owned(), sparse, images })
    }

    /// The sparse model, all of whose images have cameras without distortion.
    ///
    /// # Errors
    /// [`Error`] if it cannot be read; [`Error::Content`] naming the first camera that distorts.
    pub fn read_model(&self, limits: &Limits) -> Result<Model> {
        let model = Model::read(&self.sparse, limits).map_err(|e| Error::format(&self.sparse, e))?;
        let used = |id: u32| model.images.iter().any(|image| image.camera_id == id);
        let distorts =
            |model: CameraModel| !matches!(model, CameraModel::Pinhole | CameraModel::SimplePinhole);
        match model.cameras.iter().find(|camera| distorts(camera.model) && used(camera.id)) {
            Some(camera) => {
                let what = format!(
                    "camera {} is a {}: only images without distortion (PINHOLE, SIMPLE_PINHOLE) can be densified; run \
                     `colmap image_undistorter` and give its output folder",
                    camera.id,
                    camera.model.name()
                );
                Err(Error::content(&self.sparse, what))
            }
            None => Ok(model),
        }
    }

    /// The folder of the dense stage's files.
    pub fn stereo(&self) -> PathBuf {
        self.root.join("stereo")
    }

    /// Whether `path` is a file that COLMAP left in the workspace: anything but what is in a folder of its own, or
    /// what does not exist.
    pub fn owns(&self, path: &Path) -> bool {
        let (Ok(root), Ok(file)) = (self.root.canonicalize(), path.canonicalize()) else { return false };
        let Ok(within) = file.strip_prefix(&root) else { return false };
        let first = within.components().next().map(|part| part.as_os_str().to_string_lossy().into_owned());
        let folders = ["images", "sparse", "stereo"];
        let files = ["fused.ply", "fused.ply.vis", "meshed-poisson.ply", "meshed-delaunay.ply"];
        first.is_some_and(|first| folders.contains(&&*first) || files.contains(&&*first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facade() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6")
    }

    #[test]
    fn a_model_is_found_in_and_below_the_folder() {
        let dense = Workspace::at(&facade(), None).unwrap();
        assert_eq!(
            (dense.sparse.clone(), dense.images.clone()),
            (facade().join("sparse"), facade().join("images"))
        );
        let inner = Workspace::at(&facade().join("sparse"), None).unwrap();
        assert_eq!(inner.sparse, facade().join("sparse"));
        assert_eq!(inner.images, facade().join("images"));
        let two_up = Workspace::at(&facade().join("colmap-4.2/binary"), None).unwrap();
        assert_eq!(two_up.images, facade().join("images"), "as above sparse/0");
        let scratch = tempfile::tempdir().unwrap();
        for name in ["cameras.bin", "images.bin", "points3D.bin"] {
            std::fs::copy(two_up.sparse.join(name), scratch.path().join(name)).unwrap();
        }
        let alone = Workspace::at(scratch.path(), None).unwrap_err().to_string();
        assert!(alone.contains("no images/ folder"), "{alone}");
        assert!(Workspace::at(scratch.path(), Some(&facade().join("images"))).is_ok());
        let nothing = Workspace::at(&facade().join("labels"), None).unwrap_err();
        assert!(nothing.to_string().contains("no COLMAP workspace"), "{nothing}");
    }

    #[test]
    fn only_files_of_colmap_are_its_own() {
        let scratch = tempfile::tempdir().unwrap();
        let root = scratch.path();
        let workspace = Workspace { root: root.to_owned(), sparse: root.into(), images: root.into() };
        for name in ["fused.ply", "sparse/cameras.bin", "semvs/dense.ply", "mine.ply"] {
            std::fs::create_dir_all(root.join(name).parent().unwrap()).unwrap();
            std::fs::write(root.join(name), b"x").unwrap();
        }
        assert!(workspace.owns(&root.join("fused.ply")) && workspace.owns(&root.join("sparse/cameras.bin")));
        assert!(!workspace.owns(&root.join("semvs/dense.ply")) && !workspace.owns(&root.join("mine.ply")));
        assert!(!workspace.owns(&root.join("stereo/new.bin")), "not there yet");
    }

    #[test]
    fn distorted_cameras_are_refused_with_the_remedy() {
        let scratch = tempfile::tempdir().unwrap();
        for name in ["cameras.txt", "images.txt", "points3D.txt"] {
            let text = std::fs::read_to_string(facade().join("sparse").join(name)).unwrap();
            let text = text
                .replace("PINHOLE 400 300 333.3333333333333 333.3333333333333", "SIMPLE_RADIAL 400 300 333");
            std::fs::write(scratch.path().join(name), text).unwrap();
        }
        let text = std::fs::read_to_string(scratch.path().join("cameras.txt"))
            .unwrap()
            .replace("150.0", "150.0 0.1");
        std::fs::write(scratch.path().join("cameras.txt"), text).unwrap();
        let workspace = Workspace::at(scratch.path(), Some(&facade().join("images"))).unwrap();
        let error = workspace.read_model(&Limits::default()).unwrap_err().to_string();
        assert!(
            error.contains("camera 1 is a SIMPLE_RADIAL") && error.contains("image_undistorter"),
            "{error}"
        );
    }
}
