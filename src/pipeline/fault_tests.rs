//! Whole runs over media that fail: one clear error, nothing lost, and the next run ends as if nothing had been.

use super::densify::densify;
use super::filter_job::{AcrossViews, FilterJob};
use super::job::{DensifyJob, Outputs, RoiJob, SceneJob};
use crate::depth_filter::{DepthFilterOptions, UnbiasedFilterOptions};
use crate::error::{Error, Result};
use crate::fusion::FusionOptions;
use crate::progress::Progress;
use crate::scene::{NeighborOptions, ResolutionOptions, RoiEstimation};
use crate::stereo::{CpuLevel, StereoOptions};
use crate::store::faults::{Access, Fault, Kind};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The bundled scene in a folder of its own, with maps of 100×75 pixels.
struct Scene {
    folder: tempfile::TempDir,
}

impl Scene {
    fn new() -> Self {
        let scene = Scene { folder: tempfile::tempdir().unwrap() };
        let bundled = Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6");
        std::fs::copy(bundled.join("scene.mvs"), scene.path("scene.mvs")).unwrap();
        for folder in ["images", "out", "maps"] {
            std::fs::create_dir(scene.path(folder)).unwrap();
        }
        for entry in std::fs::read_dir(bundled.join("images")).unwrap().flatten() {
            std::fs::copy(entry.path(), scene.path("images").join(entry.file_name())).unwrap();
        }
        scene
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self) -> Result<()> {
        let input = SceneJob {
            scene: self.path("scene.mvs"),
            working_folder: self.path("maps"),
            pointcloud_file: None,
            view_neighbors_file: None,
            neighbors: NeighborOptions { number_views: 2, ..NeighborOptions::default() },
            roi: RoiJob { estimate: RoiEstimation::Off, border: 0.0, crop: true },
            tower: None,
            masks: None,
            labels: None,
            strict: true,
            like_openmvs: false,
            max_threads: 2,
            max_memory: None,
        };
        let across = AcrossViews::Unbiased(UnbiasedFilterOptions::default());
        let job = DensifyJob {
            input,
            resolution: ResolutionOptions { level: 2, min: 80, ..ResolutionOptions::default() },
            depth_maps: self.path("maps"),
            force: false,
            pictures: false,
            stereo: StereoOptions { levels: 0, iterations: 1, ..StereoOptions::default() },
            filter: FilterJob::from_bits(7, across, DepthFilterOptions::default()).unwrap(),
            depth_maps_only: false,
            remove_depth_maps: false,
            fusion: FusionOptions { number_views_fuse: 2, ..FusionOptions::default() },
            outputs: Outputs {
                scene: Some(self.path("out/cloud.mvs")),
                ..Outputs::of(self.path("out/cloud.ply"))
            },
        };
        densify(&job, CpuLevel::detect(), &Progress::silent()).map(drop)
    }

    /// All files but inputs.
    fn files(&self) -> BTreeMap<String, Vec<u8>> {
        let entries = ["maps", "out"].map(|folder| std::fs::read_dir(self.path(folder)).unwrap().flatten());
        let named = |path: PathBuf| (path.file_name().unwrap().to_string_lossy().into_owned(), path);
        let paths = entries.into_iter().flatten().map(|entry| named(entry.path()));
        paths.map(|(name, path)| (name, std::fs::read(path).unwrap())).collect()
    }

    fn clear(&self) {
        for name in self.files().into_keys() {
            let _ = std::fs::remove_file(self.path("maps").join(&name));
            let _ = std::fs::remove_file(self.path("out").join(&name));
        }
    }
}

/// What a run that nothing disturbs leaves.
fn undisturbed(scene: &Scene) -> BTreeMap<String, Vec<u8>> {
    scene.run().unwrap();
    let files = scene.files();
    assert_eq!(files.len(), 9, "six maps, their journal, the cloud, the scene: {:?}", files.keys());
    scene.clear();
    files
}

#[track_caller]
fn assert_same(found: &BTreeMap<String, Vec<u8>>, expected: &BTreeMap<String, Vec<u8>>, what: &str) {
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{what}");
    for (name, bytes) in expected {
        assert!(found[name] == *bytes, "{what}: {name} differs");
    }
}

#[test]
fn whichever_access_fails_nothing_is_lost_and_the_next_run_completes() {
    let scene = Scene::new();
    let expected = undisturbed(&scene);
    for access in [Access::Write, Access::Sync, Access::Rename, Access::Read] {
        for kind in [Kind::Full, Kind::Broken] {
            let mut struck = 0;
            for nth in [0, 1, 5, 8, 13, 17, 24, 29, 41, 55] {
                scene.clear();
                // What an earlier run has left.
                std::fs::write(scene.path("out/cloud.ply"), "from before").unwrap();
                let what = format!("{access:?} {nth} {kind:?}");
                let fault = Fault::inject(scene.folder.path(), access, kind, nth);
                let outcome = scene.run();
                let has_struck = fault.has_struck();
                drop(fault);
                let Err(error) = outcome else {
                    // The fault came after everything, or reads from memory sufficed.
                    assert_same(&scene.files(), &expected, &what);
                    break;
                };
                assert!(has_struck, "{what}: {error}");
                struck += 1;
                let said = error.to_string();
                let reason = if kind == Kind::Full { "o space left" } else { "nput/output error" };
                assert!(matches!(error, Error::Io { .. }) && said.contains(reason), "{what}: {said}");
                assert!(
                    said.contains(scene.folder.path().to_str().unwrap()),
                    "{what}: names no file: {said}"
                );
                let left = scene.files();
                let whole = |name: &String| left[name] == b"from before" || left[name] == expected[name];
                assert!(left.keys().filter(|name| *name == "cloud.ply").all(whole), "{what}");
                scene.run().unwrap();
                assert_same(&scene.files(), &expected, &what);
            }
            assert!(struck > 0 || access == Access::Read, "{access:?} {kind:?}");
        }
    }
}

#[test]
fn short_writes_change_nothing() {
    let scene = Scene::new();
    let expected = undisturbed(&scene);
    let _fault = Fault::inject(scene.folder.path(), Access::Write, Kind::Short, 0);
    scene.run().unwrap();
    assert_same(&scene.files(), &expected, "short writes");
}

#[test]
fn bytes_that_change_between_stages_are_noticed() {
    let scene = Scene::new();
    let expected = undisturbed(&scene);
    // Six maps a pass are renamed; these leave the first, the second, the third, and the filtered ones.
    let mut changed = 0;
    for nth in [7, 15, 20, 26] {
        for at in 0..7 {
            scene.clear();
            let fault = Fault::inject(scene.folder.path(), Access::Rename, Kind::Full, nth);
            assert!(scene.run().is_err());
            drop(fault);
            let Some((name, mut bytes)) = scene.files().into_iter().nth(at) else { break };
            let place = (bytes.len() * 3 / 5).min(bytes.len() - 1);
            bytes[place] ^= 0x10;
            std::fs::write(scene.path("maps").join(&name), bytes).unwrap();
            scene.run().unwrap();
            assert_same(&scene.files(), &expected, &format!("{name} changed after {nth} renames"));
            changed += 1;
        }
    }
    assert!(changed > 20);
}

#[test]
fn an_image_that_vanishes_before_fusion_is_named() {
    let scene = Scene::new();
    let expected = undisturbed(&scene);
    let fault = Fault::inject(&scene.path("out"), Access::Write, Kind::Full, 0);
    assert!(scene.run().is_err());
    drop(fault);
    let photograph = std::fs::read(scene.path("images/0005.jpg")).unwrap();
    std::fs::remove_file(scene.path("images/0005.jpg")).unwrap();
    let before = scene.files();
    let error = scene.run().unwrap_err().to_string();
    assert!(error.contains("0005.jpg"), "{error}");
    assert_same(&scene.files(), &before, "nothing was touched");
    std::fs::write(scene.path("images/0005.jpg"), photograph).unwrap();
    scene.run().unwrap();
    assert_same(&scene.files(), &expected, "the image is back");
}
