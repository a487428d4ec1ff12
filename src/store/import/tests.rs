use super::*;
use semvs_formats::mvs::{Camera, Image, Platform, PointCloud, Pose, ViewScore};

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

fn facade() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6/scene.mvs")
}

/// Three calibrated images of one camera and four points.
fn archive() -> mvs::Scene {
    let camera = Camera {
        width: 640,
        height: 480,
        k: [600.0, 0.0, 310.0, 0.0, 610.0, 250.0, 0.0, 0.0, 1.0],
        rotation: IDENTITY,
        ..Default::default()
    };
    let poses = (0..3).map(|i| Pose { rotation: IDENTITY, center: [f64::from(i), 0.0, 0.0] }).collect();
    let image = |i: u32| Image {
        name: format!("images\\{i}.jpg").into_bytes(),
        platform: 0,
        camera: 0,
        pose: i,
        id: NO_ID,
        ..Default::default()
    };
    let mut points = PointCloud { positions: vec![[0.0, 0.0, 9.0]; 4], ..Default::default() };
    for views in [&[0, 1][..], &[2, 0], &[1, 2], &[0, 1, 2]] {
        points.views.push(views, &[]);
    }
    mvs::Scene {
        platforms: vec![Platform { cameras: vec![camera], poses, ..Default::default() }],
        images: (0..3).map(image).collect(),
        points,
        ..Default::default()
    }
}

/// The scene after a journey through a file of `version`.
fn load(archive: &mvs::Scene, version: u32) -> Result<LoadedScene> {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("scene.mvs");
    let mut bytes = Vec::new();
    let container = mvs::Container::Interface { version };
    let file = SceneFile { scene: archive.clone(), container, reserved: 0, trailing_bytes: 0 };
    file.write(&mut bytes).unwrap();
    std::fs::write(&path, bytes).unwrap();
    load_scene(&path, scratch.path(), &Limits::default(), &Progress::silent())
}

#[test]
fn the_bundled_scene_loads() {
    let loaded =
        load_scene(&facade(), Path::new("elsewhere"), &Limits::default(), &Progress::silent()).unwrap();
    assert_eq!(loaded.container, mvs::Container::Interface { version: 7 });
    assert_eq!((loaded.scene.views.len(), loaded.scene.tracks.len()), (6, 6344));
    let view = &loaded.scene.views[1];
    assert_eq!((view.name.as_str(), view.id), ("images/0004.jpg", ImageId(1)));
    let calibration = view.calibration.as_ref().unwrap();
    assert_eq!(calibration.size, Some(Size::new(400, 300)));
    let k = calibration.camera_at(Size::new(400, 300)).k().clone_owned();
    assert!((k[(0, 0)] - 333.3333333333333).abs() < 1e-12 && (k[(0, 2)] - 199.5).abs() < 1e-12);
    assert!(loaded.image_path(ViewIndex(1)).is_file(), "found beside the scene");
}

#[test]
fn rigs_are_composed() {
    let mut archive = archive();
    // The camera looks along the platform's x axis from one unit above it; pose 0 is turned about z by 90 degrees.
    archive.platforms[0].cameras[0].rotation = [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0];
    archive.platforms[0].cameras[0].center = [0.0, 2.0, 1.0];
    archive.platforms[0].poses[0] =
        Pose { rotation: [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0], center: [5.0, 6.0, 7.0] };
    let loaded = load(&archive, 7).unwrap();
    let calibration = loaded.scene.views[0].calibration.as_ref().unwrap();
    assert_eq!(calibration.rotation, Matrix3::new(-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0));
    assert_eq!(calibration.center, Vector3::new(5.0 - 2.0, 6.0, 8.0));
}

#[test]
fn uncalibrated_images_stay_in_the_list_and_see_nothing() {
    let mut archive = archive();
    archive.images[1].pose = NO_ID;
    archive.images[0].view_scores = [1, 2, 0]
        .map(|image| ViewScore { image, points: 5, scale: 1.0, angle: 0.1, area: 0.5, score: 3.0 })
        .into();
    let loaded = load(&archive, 7).unwrap();
    assert_eq!(loaded.scene.views.len(), 3);
    assert_eq!(loaded.scene.views[1].calibration, None);
    let seen: Vec<_> =
        loaded.scene.tracks.iter().map(|(_, v)| v.iter().map(|v| v.0).collect::<Vec<_>>()).collect();
    assert_eq!(seen, [vec![0], vec![0, 2], vec![2], vec![0, 2]]);
    let neighbors: Vec<_> = loaded.scene.views[0].neighbors.iter().map(|n| n.view.0).collect();
    assert_eq!(neighbors, [2], "neither the uncalibrated image nor the image itself");
}

#[test]
fn names_and_ids_are_put_right() {
    let mut archive = archive();
    archive.images[0].id = 2;
    archive.images[1].mask_name = b"masks\\1.png".to_vec();
    let loaded = load(&archive, 7).unwrap();
    let views = &loaded.scene.views;
    assert_eq!(views[1].name, "images/1.jpg");
    assert_eq!((views[0].mask.as_deref(), views[1].mask.as_deref()), (None, Some("masks/1.png")));
    assert_eq!(views.iter().map(|v| v.id.0).collect::<Vec<_>>(), [0, 1, 2], "IDs 2, 1 and 2 are not unique");
}

#[test]
fn points_nowhere_are_left_out() {
    let mut archive = archive();
    archive.points.positions[2] = [0.0, f32::INFINITY, 1.0];
    assert_eq!(load(&archive, 7).unwrap().scene.tracks.len(), 3);
}

#[test]
fn views_that_name_no_image_are_left_out_and_repeated_ones_count() {
    let mut archive = archive();
    archive.points.views = mvs::Visibility::default();
    for views in [&[0, 1, 7][..], &[2, 0, 2], &[1, 2], &[]] {
        archive.points.views.push(views, &[]);
    }
    let loaded = load(&archive, 7).unwrap();
    let visibility = |i| loaded.scene.tracks.visibility(i).iter().map(|v| v.0).collect::<Vec<_>>();
    assert_eq!([visibility(0), visibility(1)], [vec![0, 1], vec![0, 2, 2]]);
    assert_eq!(loaded.archive.points.views.images_of(1), [0, 2], "what is written has every view once");
}

#[test]
fn normalised_intrinsics_take_the_size_of_the_photograph() {
    let scratch = tempfile::tempdir().unwrap();
    image::GrayImage::new(200, 100).save(scratch.path().join("a.png")).unwrap();
    let mut archive = archive();
    let camera = &mut archive.platforms[0].cameras[0];
    (camera.width, camera.height) = (0, 0);
    for image in &mut archive.images {
        image.name = b"a.png".to_vec();
    }
    // Both files mean a principal point of (99.5, 49.5) in 200x100.
    for (version, center) in [(5, [0.4975, 0.2475 + 0.1]), (7, [0.0, -0.2])] {
        archive.platforms[0].cameras[0].k = [1.0, 0.0, center[0], 0.0, 1.0, center[1], 0.0, 0.0, 1.0];
        let path = scratch.path().join("scene.mvs");
        let mut bytes = Vec::new();
        mvs::write_interface(&mut bytes, &archive, version).unwrap();
        std::fs::write(&path, bytes).unwrap();
        let loaded = load_scene(&path, scratch.path(), &Limits::default(), &Progress::silent()).unwrap();
        let calibration = loaded.scene.views[0].calibration.as_ref().unwrap();
        assert_eq!(calibration.size, Some(Size::new(200, 100)));
        let k = calibration.camera_at(Size::new(200, 100)).k().clone_owned();
        assert!((k[(0, 2)] - 99.5).abs() < 1e-9, "version {version}: {k}");
        let row = if version == 5 { 0.3475 * 200.0 } else { 0.3 * 200.0 - 0.5 };
        assert!((k[(1, 2)] - row).abs() < 1e-9, "version {version}: {k}");
    }
}

#[test]
fn unusable_scenes_are_errors_that_say_why() {
    let fails = |change: &dyn Fn(&mut mvs::Scene), words: &str| {
        let mut archive = archive();
        change(&mut archive);
        let error = load(&archive, 7).unwrap_err().to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{words}: {error}");
    };
    fails(&|a| a.images[2].pose = 9, "pose");
    fails(&|a| a.platforms[0].cameras[0].k[0] = 0.0, "K");
    fails(&|a| a.platforms[0].poses[1].rotation[0] = f64::NAN, "R");
    fails(&|a| a.platforms[0].poses[1].center[0] = f64::INFINITY, "C");
    fails(&|a| a.images[1..].iter_mut().for_each(|i| i.pose = NO_ID), "at least two");
    fails(&|a| a.images.clear(), "");
    let scratch = tempfile::tempdir().unwrap();
    let absent =
        load_scene(&scratch.path().join("no.mvs"), Path::new(""), &Limits::default(), &Progress::silent());
    assert!(absent.unwrap_err().to_string().contains("no.mvs"));
}

#[test]
fn every_prefix_of_a_scene_is_refused() {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("scene.mvs");
    let mut bytes = Vec::new();
    mvs::write_interface(&mut bytes, &archive(), 7).unwrap();
    for length in (0..bytes.len()).step_by(7) {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(
            load_scene(&path, scratch.path(), &Limits::default(), &Progress::silent()).is_err(),
            "{length} bytes"
        );
    }
}
