use super::*;
use crate::progress::Progress;
use crate::scene::ResolutionOptions;
use crate::store::cameras::working_cameras;
use crate::store::import::load_scene;
use semvs_formats::Limits;
use std::path::PathBuf;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6").join(name)
}

/// The settings of the bundled reference outputs.
const RESOLUTION: ResolutionOptions = ResolutionOptions { level: 1, min: 160, max: 2560 };

fn facade() -> LoadedScene {
    load_scene(&fixture("scene.mvs"), &fixture(""), &Limits::default(), &Progress::silent()).unwrap()
}

#[test]
fn a_densified_scene_equals_openmvs_to_the_byte() {
    let reference = fixture("openmvs-2.3.0/post7/scene_dense.mvs");
    let stored = load_scene(&reference, &fixture(""), &Limits::default(), &Progress::silent()).unwrap();
    let neighbors: Vec<ViewNeighbors> = stored
        .scene
        .views
        .iter()
        .map(|v| ViewNeighbors { all: v.neighbors.clone(), avg_depth: v.avg_depth, ..Default::default() })
        .collect();
    let loaded = facade();
    let cameras = working_cameras(&loaded, &RESOLUTION, true, &Progress::silent()).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("new/folder/scene_dense.mvs");
    write_interface(&path, &interface_archive(&loaded, &cameras, &neighbors)).unwrap();
    assert!(std::fs::read(path).unwrap() == std::fs::read(reference).unwrap(), "bytes differ");
}

#[test]
fn cameras_of_no_processed_view_keep_what_they_had() {
    let mut loaded = facade();
    let spare = loaded.archive.platforms[0].cameras[0].clone();
    loaded.archive.platforms[0].cameras.extend([spare.clone(), spare]);
    loaded.archive.images[5].camera = 1;
    let mut cameras = working_cameras(&loaded, &RESOLUTION, true, &Progress::silent()).unwrap();
    cameras[5] = None;
    let archive = interface_archive(&loaded, &cameras, &[]);
    let sizes: Vec<_> = archive.platforms[0].cameras.iter().map(|c| (c.width, c.height)).collect();
    assert_eq!(sizes, [(200, 150), (400, 300), (0, 0)]);
    let focal: Vec<_> = archive.platforms[0].cameras.iter().map(|c| c.k[0].round()).collect();
    assert_eq!(focal, [167.0, 333.0, 1.0]);
}

#[test]
fn names_are_made_relative_to_the_working_folder() {
    let folder = std::fs::canonicalize(fixture("images")).unwrap();
    let search =
        SearchPath { working_folder: folder.clone(), scene_folder: folder.parent().unwrap().to_owned() };
    let name = |stored: &str| String::from_utf8(export_name(stored.as_bytes(), &search)).unwrap();
    assert_eq!(name("0003.jpg"), "0003.jpg");
    assert_eq!(name(folder.join("0003.jpg").to_str().unwrap()), "0003.jpg");
    assert_eq!(name("images\\0003.jpg"), "0003.jpg", "found beside the scene");
    assert_eq!(name("labels/0003_l.png"), "../labels/0003_l.png");
    assert_eq!(name("nowhere/x.jpg"), "nowhere/x.jpg");
    assert_eq!(name(""), "");
    assert_eq!(export_name(b"\xff\xfe.jpg", &search), b"\xff\xfe.jpg");
}
