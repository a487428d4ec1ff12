//! Depth maps that OpenMVS wrote, held against the scene that they belong to.

use crate::common::{Scratch, facade6};
use semvs::internals::progress::Progress;
use semvs::internals::scene::{ImageId, ResolutionOptions};
use semvs::internals::store::cameras::working_cameras;
use semvs::internals::store::depth_store::{DepthStore, Existing};
use semvs::internals::store::import::load_scene;
use semvs::internals::store::paths::SearchPath;
use semvs_formats::Limits;
use std::path::Path;

fn store(folder: &Path) -> DepthStore {
    let images = SearchPath { working_folder: facade6(), scene_folder: facade6() };
    DepthStore::new(folder, images, 64 << 20, Limits::default())
}

/// The maps are half the size of the photographs.
const HALF: ResolutionOptions = ResolutionOptions { level: 1, min: 100, max: 2560 };

#[test]
fn maps_of_openmvs_belong_to_their_scene_and_only_to_its_size() {
    let scratch = Scratch::new();
    scratch.add_maps("post7", "");
    let store = store(&scratch.path(""));
    let scene = load_scene(&facade6().join("scene.mvs"), &facade6(), &Limits::default(), &Progress::silent())
        .unwrap();
    let cameras = working_cameras(&scene, &HALF, true, &Progress::silent()).unwrap();
    let full = ResolutionOptions { level: 0, ..HALF };
    let large = working_cameras(&scene, &full, true, &Progress::silent()).unwrap();
    for (i, view) in scene.scene.views.iter().enumerate() {
        let existing = |id: ImageId, cameras: &[Option<semvs::internals::geometry::Camera>]| {
            store.existing(id, cameras[i].as_ref().unwrap())
        };
        let own = existing(view.id, &cameras);
        assert!(matches!(own, Existing::Usable), "{}: {own:?}", view.name);
        assert!(
            matches!(existing(view.id, &large), Existing::Unusable(why) if why.contains("200×150 pixels instead of 400×300"))
        );
        let next = ImageId((view.id.0 + 1) % 6);
        assert!(matches!(existing(next, &cameras), Existing::Unusable(why) if why.contains("its camera")));
        assert!(matches!(existing(ImageId(77), &cameras), Existing::Absent));
    }
}

#[test]
fn maps_of_openmvs_are_written_back_byte_for_byte() {
    let scratch = Scratch::new();
    scratch.add_maps("post7", "");
    let (from, to) = (store(&scratch.path("")), store(&scratch.path("copy")));
    for id in (0..6).map(ImageId) {
        let estimate = from.read(id).unwrap();
        let valid = estimate.depth.data().iter().filter(|&&d| d > 0.0).count();
        assert!(valid > estimate.depth.size().area() / 2, "{id}: {valid} depths");
        let name = &estimate.image_name;
        assert!(name.starts_with("images/") || name.contains("/images/"), "{name}");
        semvs::internals::store::depth_store::write_depth_map(&to.path(id), &estimate, name).unwrap();
        let bytes = |store: &DepthStore| std::fs::read(store.path(id)).unwrap();
        assert!(bytes(&from) == bytes(&to), "{id}");
    }
}
