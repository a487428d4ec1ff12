//! `semvs import` of depths and `semvs export` of scenes and maps.

use crate::common::{self, Scratch};
use semvs_formats::mvs::{ArchiveKind, Container, SceneFile};
use semvs_formats::{Limits, dmap::DepthMapFile, neighbors_file, npy, pfm, roi};

fn file(scratch: &Scratch, name: &str) -> SceneFile {
    SceneFile::read(scratch.path(name), &Limits::default()).unwrap()
}

fn dmap(scratch: &Scratch, name: &str) -> DepthMapFile {
    DepthMapFile::read(scratch.path(name), &Limits::default()).unwrap()
}

#[test]
fn maps_survive_every_kind_of_raster() {
    /// A millimetre step; the depths are metres.
    const STEP: f32 = 0.0005001;
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    let maps: String = (0..6).map(|i| format!("maps/depth{i:04}.dmap ")).collect();
    for (kind, words) in
        [("pfm", "--planes depth,normal,confidence"), ("npy", "--planes depth,confidence"), ("png", "")]
    {
        scratch.semvs(&format!("export {maps} --to {kind} {words} -o {kind}")).ok();
        scratch.semvs(&format!("import {kind} --scene scene.mvs -o back-{kind}")).ok();
        for i in 0..6 {
            let before = dmap(&scratch, &format!("maps/depth{i:04}.dmap"));
            let after = dmap(&scratch, &format!("back-{kind}/depth{i:04}.dmap"));
            assert_eq!(
                (after.ids[0], after.width, after.height),
                (before.ids[0], before.width, before.height)
            );
            assert!(after.ids.len() > 2, "its neighbours are noted");
            assert!(after.k.iter().zip(&before.k).all(|(a, b)| (a - b).abs() < 1e-3));
            let worst = after.depth.iter().zip(&before.depth).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(worst <= if kind == "png" { STEP } else { 0.0 }, "{kind}: {worst}");
            let valid = || after.depth.iter().copied().filter(|&d| d > 0.0);
            assert!(valid().all(|d| d >= after.depth_min && d < after.depth_max));
            assert_eq!(after.normal.len(), after.depth.len());
            assert!(after.confidence.is_empty());
        }
        scratch
            .semvs(&format!("fuse scene.mvs --depth-maps back-{kind} -o {kind}.ply --estimate-roi 0"))
            .ok();
    }
    assert_eq!(scratch.read("pfm.ply"), scratch.read("npy.ply"));
    let array = npy::read(scratch.read("npy/0003.npy").as_slice(), None, &Limits::default()).unwrap();
    assert_eq!(array.shape, [150, 200]);
    let normals =
        pfm::read(scratch.read("pfm/0003.normal.pfm").as_slice(), None, &Limits::default()).unwrap();
    assert_eq!(normals.data, dmap(&scratch, "maps/depth0000.dmap").normal.as_flattened());
    scratch.semvs("import npy --scene scene.mvs -o flat --normals 0").ok();
    assert!(dmap(&scratch, "flat/depth0000.dmap").normal.is_empty());
    scratch
        .semvs(&format!("export {maps} --to png --planes normal -o x"))
        .fails_naming(&["PNG files hold depths only"]);
    scratch.semvs("export flat/depth0000.dmap --to npy --planes normal -o x").fails_naming(&["no normals"]);
    let said = scratch.semvs("export maps/depth0000.dmap --to png --depth-scale 1e6 -o x").ok();
    assert!(said.stderr.contains("--depth-scale"), "{}", said.stderr);
}

#[test]
fn depths_that_do_not_fit_are_refused() {
    let scratch = Scratch::facade6();
    std::fs::create_dir(scratch.path("depths")).unwrap();
    scratch.semvs("import depths --scene scene.mvs -o maps").fails_naming(&["depths", "0003.jpg"]);
    let array = |shape: Vec<u64>| {
        let count = shape.iter().product::<u64>() as usize;
        let mut bytes = Vec::new();
        npy::write(&npy::FloatArray { shape, data: vec![5.0; count] }, &mut bytes).unwrap();
        bytes
    };
    scratch.write("depths/0003.npy", array(vec![150, 100]));
    scratch
        .semvs("import depths --scene scene.mvs -o maps")
        .fails_naming(&["0003.npy", "100×150", "400×300"]);
    scratch.write("depths/0003.npy", array(vec![600, 800]));
    scratch.semvs("import depths --scene scene.mvs -o maps").fails_naming(&["0003.npy", "800×600"]);
    scratch.write("depths/0003.npy", array(vec![100 * 133]));
    scratch.semvs("import depths --scene scene.mvs -o maps").fails_naming(&["0003.npy", "(rows, columns)"]);
    scratch.write(
        "depths/0003.npy",
        b"\x93NUMPY\x01\x00\x40\x00{'descr': '<f4', 'fortran_order': False, 'shape': (65535, 65535)}  ",
    );
    scratch.semvs("import depths --scene scene.mvs -o maps").fails_naming(&["0003.npy"]);
    // 133×100 is a third of 400×300, rounded.
    scratch.write("depths/0003.npy", array(vec![100, 133]));
    let said = scratch.semvs("import depths --scene scene.mvs -o maps").ok();
    assert!(said.stderr.contains("5 images have no depths"), "{}", said.stderr);
    assert_eq!(dmap(&scratch, "maps/depth0000.dmap").width, 133);
    scratch.semvs("import depths --scene scene.mvs -o maps --depth-scale 0").fails_naming(&["--depth-scale"]);
    scratch.semvs("import depths -o maps").fails_naming(&["--scene"]);
    scratch.semvs("import depths -o maps.mvs --depth-scale 3").fails_naming(&["--scene"]);
}

#[test]
fn scenes_go_into_every_archive() {
    let scratch = Scratch::facade6();
    let original = file(&scratch, "scene.mvs");
    for version in 0..=7u32 {
        let said = scratch
            .semvs(&format!("export scene.mvs --to mvs --mvs-version {version} -o v{version}.mvs"))
            .ok();
        let written = file(&scratch, &format!("v{version}.mvs"));
        assert_eq!(written.container, Container::Interface { version });
        assert_eq!(written.scene.points, original.scene.points);
        assert_eq!(said.stderr.contains("image sizes of cameras"), version == 0, "{}", said.stderr);
    }
    let newest = std::fs::read(scratch.path("v7.mvs")).unwrap();
    assert_eq!(newest, scratch.read("scene.mvs"), "the same bytes where nothing changes");
    for (kind, archive) in
        [ArchiveKind::Text, ArchiveKind::Binary, ArchiveKind::Zlib, ArchiveKind::Zstd].into_iter().enumerate()
    {
        scratch.semvs(&format!("export scene.mvs --to mvs --archive-type {kind} -o p{kind}.mvs")).ok();
        let written = file(&scratch, &format!("p{kind}.mvs"));
        assert_eq!(written.container, Container::Project { kind: archive });
        assert_eq!((written.scene.images[2].width, written.scene.images[2].height), (400, 300));
        scratch.semvs(&format!("export p{kind}.mvs --to mvs --archive-type -1 -o i{kind}.mvs")).ok();
        let back = file(&scratch, &format!("i{kind}.mvs")).scene;
        assert_eq!((back.platforms[0].cameras[0].width, back.points), (400, original.scene.points.clone()));
    }
    scratch.semvs("export scene.mvs --to mvs --mvs-version 7 -o moved/scene.mvs").ok();
    let name = file(&scratch, "moved/scene.mvs").scene.images[0].name.clone();
    assert_eq!(String::from_utf8_lossy(&name), "../images/0003.jpg");
    scratch.semvs("export scene.mvs --to mvs -o scene.mvs").fails_naming(&["this is the input"]);
    scratch.semvs("export scene.mvs --to mvs --mvs-version 8 -o x.mvs").fails_naming(&["--mvs-version"]);
    scratch.semvs("export scene.mvs --to roi --mvs-version 7 -o x.txt").fails_naming(&["--mvs-version"]);
    scratch.semvs("export scene.mvs scene.mvs --to mvs -o x.mvs").fails_naming(&["one scene"]);
}

/// OpenMVS's own project archives: what is written is what was read, meshes and textures included.
#[test]
fn projects_keep_what_they_hold() {
    let scratch = Scratch::new();
    let corpus = common::fixtures().join("format-corpus/native");
    for (name, exact) in [("n0", true), ("n1", true), ("n2", false), ("n3", false)] {
        std::fs::copy(corpus.join(format!("{name}.mvs")), scratch.path(&format!("{name}.mvs"))).unwrap();
        scratch.semvs(&format!("export {name}.mvs --to mvs -o {name}-again.mvs")).ok();
        let (before, after) =
            (file(&scratch, &format!("{name}.mvs")), file(&scratch, &format!("{name}-again.mvs")));
        assert_eq!(before.scene, after.scene, "{name}");
        assert!(!after.scene.mesh.faces.is_empty() && !after.scene.mesh.textures.is_empty(), "{name}");
        if exact {
            assert_eq!(
                scratch.read(&format!("{name}.mvs")),
                scratch.read(&format!("{name}-again.mvs")),
                "{name}"
            );
        }
    }
    scratch
        .semvs("export n1.mvs --to mvs --mvs-version 7 -o x.mvs")
        .fails_naming(&["mesh", "native archive"]);
    assert!(!scratch.has("x.mvs"));
}

#[test]
fn regions_and_neighbours_become_text() {
    let scratch = Scratch::facade6();
    scratch.semvs("export scene.mvs --to roi -o roi.txt").fails_naming(&["no region of interest"]);
    scratch.semvs("export scene.mvs --to neighbors -o neighbors.txt").ok();
    let lists = neighbors_file::read(scratch.path("neighbors.txt"), 6, &Limits::default()).unwrap().lists;
    assert_eq!(lists.len(), 6);
    assert!(lists.iter().all(|list| !list.neighbors.is_empty()));
    let mut scene = file(&scratch, "scene.mvs");
    let rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let obb = semvs_formats::mvs::Obb { rotation, center: [1.0, 2.0, 3.0], half_extent: [4.0, 5.0, 6.0] };
    scene.scene.obb = Some(obb);
    let mut bytes = Vec::new();
    semvs_formats::mvs::write_interface(&mut bytes, &scene.scene, 7).unwrap();
    scratch.write("boxed.mvs", bytes);
    scratch.semvs("export boxed.mvs --to roi -o roi.txt").ok();
    assert_eq!(roi::read(scratch.path("roi.txt"), &Limits::default()).unwrap(), obb);
    let said = scratch.semvs("export boxed.mvs --to mvs --mvs-version 5 -o old.mvs").ok();
    assert!(said.stderr.contains("region of interest (since version 6)"), "{}", said.stderr);
}
