//! Corners of DensifyPointCloud where a scene or its files could lose something without a word.

use crate::common::{self, Scratch};
use semvs_formats::Limits;
use semvs_formats::mvs::{Container, SceneFile};
use semvs_formats::ply::{self, Cloud, Encoding, Field, Layout, PlyWriter, TypeNames};

/// Small maps, quickly.
const QUICK: &str =
    "--resolution-level 2 --min-resolution 80 --iters 1 --geometric-iters 0 --sub-resolution-levels 0";

fn file(scratch: &Scratch, name: &str) -> SceneFile {
    SceneFile::read(scratch.path(name), &Limits::default()).unwrap()
}

fn cloud(scratch: &Scratch, name: &str) -> Cloud {
    ply::read_cloud(std::fs::File::open(scratch.path(name)).unwrap(), &Limits::default()).unwrap()
}

#[test]
fn depth_maps_alone_leave_the_sparse_points_whole_and_the_maps_in_place() {
    let scratch = Scratch::facade6();
    let mut input = file(&scratch, "scene.mvs").scene;
    // Weights that are not all 0 are kept too.
    input.points.views.weights = (0..input.points.views.images.len()).map(|i| 1.0 + i as f32).collect();
    let mut bytes = Vec::new();
    semvs_formats::mvs::write_interface(&mut bytes, &input, 7).unwrap();
    scratch.write("scene.mvs", bytes);
    scratch.densify_point_cloud(&format!("scene.mvs {QUICK} --fusion-mode 1 --remove-dmaps 1 -v 0")).ok();
    let sparse = cloud(&scratch, "scene_dense.ply");
    assert_eq!(sparse.positions, input.points.positions);
    assert_eq!(sparse.colors, input.points.colors);
    assert_eq!(sparse.views, input.points.views);
    assert!(scratch.has("depth0000.dmap") && scratch.has("depth0005.dmap"));
    scratch.densify_point_cloud(&format!("scene.mvs {QUICK} --fusion-mode 1 --archive-type 3 -v 0")).ok();
    let project = file(&scratch, "scene_dense.mvs").scene;
    assert_eq!(project.points.colors, input.points.colors);
    assert_eq!(project.points.views, input.points.views);
    let sparse = cloud(&scratch, "scene_dense.ply");
    assert!(!sparse.has_views() && sparse.colors == input.points.colors);
}

#[test]
fn a_region_is_put_into_the_kind_of_archive_that_is_asked_for() {
    let scratch = Scratch::facade6();
    scratch.write("roi.txt", "1 0 0 0 1 0 0 0 1 1 2 3 4 5 6");
    scratch.densify_point_cloud("scene.mvs --import-roi-file roi.txt -o a.mvs").ok();
    scratch.densify_point_cloud("scene.mvs --import-roi-file roi.txt -o b.mvs --archive-type 2").ok();
    let (interface, project) = (file(&scratch, "a.mvs"), file(&scratch, "b.mvs"));
    assert!(matches!(interface.container, Container::Interface { version: 7 }));
    assert!(matches!(project.container, Container::Project { .. }));
    let input = file(&scratch, "scene.mvs").scene;
    for scene in [&interface.scene, &project.scene] {
        assert_eq!(scene.obb.as_ref().unwrap().half_extent, [4.0, 5.0, 6.0]);
        assert_eq!(scene.points.colors, input.points.colors);
    }
    assert_eq!(project.scene.platforms[0].name, input.platforms[0].name);
}

#[test]
fn masks_of_a_folder_are_named_in_the_scene() {
    let scratch = Scratch::facade6();
    std::fs::create_dir(scratch.path("masks")).unwrap();
    for image in file(&scratch, "scene.mvs").scene.images {
        let name = String::from_utf8(image.name).unwrap();
        let stem = name.trim_start_matches("images/").trim_end_matches(".jpg").to_owned();
        image::GrayImage::from_pixel(4, 3, image::Luma([255]))
            .save(scratch.path(&format!("masks/{stem}.mask.png")))
            .unwrap();
    }
    let words = format!("scene.mvs {QUICK} --fusion-mode 1 --mask-path masks -v 0");
    scratch.densify_point_cloud(&words).ok();
    assert!(file(&scratch, "scene_dense.mvs").scene.images[0].mask_name.is_empty(), "not in use");
    scratch.densify_point_cloud(&format!("{words} --ignore-mask-label 0")).ok();
    let images = file(&scratch, "scene_dense.mvs").scene.images;
    assert_eq!(images[0].mask_name, b"masks/0003.mask.png");
    // The next step finds them by itself.
    let again = format!("scene_dense.mvs {QUICK} --fusion-mode 1 --ignore-mask-label 0 -v 0");
    assert!(!scratch.densify_point_cloud(&again).ok().stdout.contains("warning"));
}

#[test]
fn a_verbose_run_leaves_pictures() {
    let scratch = Scratch::facade6();
    scratch.densify_point_cloud(&format!("scene.mvs {QUICK} -v 2")).ok();
    assert!(!scratch.has("depth0000.png") && !scratch.has("scene_dense.mlp"));
    scratch.densify_point_cloud(&format!("scene.mvs {QUICK} -v 3 --estimate-colors 0")).ok();
    for ending in ["png", "conf.png", "ply", "filtered.png", "filtered.ply"] {
        assert!(scratch.has(&format!("depth0003.{ending}")), "{ending}");
    }
    let (all, filtered) = (cloud(&scratch, "depth0003.ply"), cloud(&scratch, "depth0003.filtered.ply"));
    assert!(all.len() > filtered.len() && !filtered.is_empty());
    assert!(!all.normals.is_empty() && !all.colors.is_empty() && !all.has_views());
    let header = String::from_utf8_lossy(&scratch.read("depth0003.ply")[..300]).into_owned();
    assert!(header.find("nx").unwrap() < header.find("red").unwrap());
    let picture = image::open(scratch.path("depth0003.filtered.png")).unwrap().into_luma8();
    let bright = picture.pixels().filter(|p| p.0[0] > 0).count();
    assert_eq!(bright, filtered.len());
    let project = String::from_utf8(scratch.read("scene_dense.mlp")).unwrap();
    assert!(project.contains("\"scene_dense.ply\"") && project.contains("\"images/0013.jpg\""));
}

#[test]
fn a_finished_cloud_does_not_need_the_photographs() {
    let scratch = Scratch::facade6();
    let dense = common::facade6().join("openmvs-2.3.0/archive3/scene_dense.mvs");
    std::fs::copy(dense, scratch.path("scene_dense.mvs")).unwrap();
    let words = "scene_dense.mvs --filter-point-cloud -20 -v 0";
    scratch.densify_point_cloud(words).ok();
    let with = scratch.read("scene_dense_dense_filtered.ply");
    std::fs::remove_dir_all(scratch.path("images")).unwrap();
    let outcome = scratch.densify_point_cloud(words).ok();
    assert!(!outcome.stdout.contains("warning"), "{}", outcome.stdout);
    assert_eq!(scratch.read("scene_dense_dense_filtered.ply").len(), with.len());
}

#[test]
fn points_from_a_ply_are_repaired_like_those_of_a_scene() {
    let scratch = Scratch::facade6();
    let input = file(&scratch, "scene.mvs").scene.points;
    let mut other = Cloud { positions: input.positions.clone(), ..Cloud::default() };
    for i in 0..input.positions.len() {
        let mut views = input.views.images_of(i).to_vec();
        views.reverse();
        views.push(views[0]);
        other.views.push(&views, &[]);
    }
    other.positions[0][1] = f32::NAN;
    let layout = Layout {
        encoding: Encoding::LittleEndian,
        type_names: TypeNames::Sized,
        fields: vec![Field::Position, Field::ViewIndices],
        comments: Vec::new(),
    };
    let place = std::fs::File::create(scratch.path("other.ply")).unwrap();
    let mut writer = PlyWriter::new(place, &layout, other.positions.len() as u64).unwrap();
    writer.write(&other).unwrap();
    drop(writer.finish().unwrap());
    scratch.densify_point_cloud(&format!("scene.mvs -p other.ply {QUICK} --fusion-mode 1 -v 0")).ok();
    let written = file(&scratch, "scene_dense.mvs").scene.points;
    assert_eq!(written.positions, input.positions[1..]);
    assert_eq!(written.views.images_of(0), input.views.images_of(1));
}

#[test]
fn a_scene_without_sparse_points_is_densified() {
    let scratch = Scratch::facade6();
    let mut input = file(&scratch, "scene.mvs").scene;
    input.points = Default::default();
    let mut bytes = Vec::new();
    semvs_formats::mvs::write_interface(&mut bytes, &input, 7).unwrap();
    scratch.write("scene.mvs", bytes);
    let words = "scene.mvs --resolution-level 2 --min-resolution 80 -v 0";
    let outcome = scratch.densify_point_cloud(words).ok();
    assert!(outcome.stdout.contains("no sparse points"), "{}", outcome.stdout);
    let first = scratch.read("scene_dense.ply");
    assert!(cloud(&scratch, "scene_dense.ply").len() > 1000);
    assert!(
        file(&scratch, "scene_dense.mvs").scene.points.positions.is_empty(),
        "made-up points are not written"
    );
    scratch.densify_point_cloud(words).ok();
    assert_eq!(scratch.read("scene_dense.ply"), first);
}

#[test]
fn images_alone_in_a_neighbour_file_are_told_of() {
    let scratch = Scratch::facade6();
    scratch.write("pairs.txt", "0 1 2\n3\n1 0\n");
    let words = "scene.mvs --view-neighbors-file pairs.txt --output-view-neighbors-file out.txt";
    let outcome = scratch.densify_point_cloud(words).ok();
    assert!(outcome.stdout.contains("pairs.txt: 1 images stand alone"), "{}", outcome.stdout);
    assert_eq!(scratch.read("out.txt"), b"0 1 2\n1 0\n2\n3\n4\n5\n");
}
