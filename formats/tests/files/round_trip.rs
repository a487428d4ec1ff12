//! Generated scenes and depth maps come back as they were written.

use proptest::collection::vec;
use proptest::prelude::*;
use semvs_formats::Limits;
use semvs_formats::dmap::DepthMapFile;
use semvs_formats::mvs::{
    self, ArchiveKind, Camera, Image, IndexLists, Line, Mesh, NO_ID, Obb, Platform, PointCloud, Pose, Scene,
    SceneFile, Texture, ViewScore, Visibility,
};

fn float() -> impl Strategy<Value = f32> {
    prop_oneof![-1e3f32..1e3, Just(0.0), Just(f32::MAX), Just(f32::MIN_POSITIVE), Just(-1e-30)]
}

fn double() -> impl Strategy<Value = f64> {
    prop_oneof![-1e6f64..1e6, Just(0.0), Just(1e300), Just(-1e-300)]
}

fn name() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![vec(any::<u8>(), 0..12), "[ -~]{0,20}".prop_map(String::into_bytes)]
}

fn matrix() -> impl Strategy<Value = [f64; 9]> {
    proptest::array::uniform9(double())
}

fn vec3f() -> impl Strategy<Value = [f32; 3]> {
    proptest::array::uniform3(float())
}

/// Nothing, or exactly `n` of something.
fn all_or_none<S: Strategy>(n: usize, item: S) -> impl Strategy<Value = Vec<S::Value>>
where
    S::Value: Clone,
{
    (any::<bool>(), vec(item, n)).prop_map(|(present, items)| if present { items } else { Vec::new() })
}

prop_compose! {
    fn camera()(name in name(), band in name(), size in (1u32..5000, 1u32..5000), k in matrix(), rotation in matrix(),
                center in proptest::array::uniform3(double())) -> Camera {
        Camera { name, band, width: size.0, height: size.1, k, rotation, center }
    }
}

prop_compose! {
    fn platform()(name in name(), cameras in vec(camera(), 1..3), poses in vec((matrix(),
                  proptest::array::uniform3(double())), 1..4)) -> Platform {
        let poses = poses.into_iter().map(|(rotation, center)| Pose { rotation, center }).collect();
        Platform { name, cameras, poses }
    }
}

prop_compose! {
    fn score(images: u32)(image in 0..images, points in any::<u32>(), v in proptest::array::uniform4(float())) -> ViewScore {
        ViewScore { image, points, scale: v[0], angle: v[1], area: v[2], score: v[3] }
    }
}

prop_compose! {
    /// An image of platform 0, camera 0, pose 0, or an uncalibrated one.
    fn image(images: u32)(name in name(), mask_name in name(), calibrated in any::<bool>(), id in any::<u32>(),
                          size in (0u32..5000, 0u32..5000), depths in vec3f(),
                          view_scores in vec(score(images), 0..4)) -> Image {
        let index = if calibrated { 0 } else { NO_ID };
        Image {
            name, mask_name, platform: index, camera: index, pose: index, id, width: size.0, height: size.1,
            min_depth: depths[0], avg_depth: depths[1], max_depth: depths[2], view_scores,
        }
    }
}

/// `n` lists of views with positive weights, or without weights.
fn visibility(n: usize, images: u32) -> impl Strategy<Value = Visibility> {
    (vec(vec((0..images, 0.01f32..10.0), 0..6), n), any::<bool>()).prop_map(|(lists, weighted)| {
        let mut views = Visibility::default();
        for list in lists {
            let (images, weights): (Vec<_>, Vec<_>) = list.into_iter().unzip();
            views.push(&images, if weighted { &weights } else { &[] });
        }
        views
    })
}

fn cloud(images: u32) -> impl Strategy<Value = PointCloud> {
    (0usize..12).prop_flat_map(move |n| {
        (vec(vec3f(), n), visibility(n, images), all_or_none(n, vec3f()), all_or_none(n, any::<[u8; 3]>()))
            .prop_map(|(positions, views, normals, colors)| PointCloud { positions, views, normals, colors })
    })
}

fn lists(n: usize, below: u32) -> impl Strategy<Value = IndexLists> {
    all_or_none(n, vec(0..below, 0..4)).prop_map(|lists| {
        let mut out = IndexLists::default();
        for list in lists {
            out.indices.extend(list);
            out.ends.push(out.indices.len() as u64);
        }
        out
    })
}

prop_compose! {
    fn texture()(w in 1usize..4, h in 1usize..4)(pixels in vec(any::<[u8; 3]>(), w * h), w in Just(w)) -> Texture {
        Texture { width: w as u32, height: (pixels.len() / w) as u32, pixels }
    }
}

fn mesh() -> impl Strategy<Value = Mesh> {
    (1usize..6, 1usize..5, 1usize..3).prop_flat_map(|(v, f, t)| {
        let vertices = (vec(vec3f(), v), all_or_none(v, vec3f()), lists(v, v as u32), lists(v, f as u32));
        let faces = (vec(proptest::array::uniform3(0..v as u32), f), all_or_none(f, vec3f()));
        let texture = (
            all_or_none(3 * f, [float(), float()]),
            all_or_none(f, 0..t as u8),
            vec(texture(), t),
            all_or_none(v, 0u8..2),
        );
        (vertices, faces, texture).prop_map(|(v, f, t)| Mesh {
            vertices: v.0,
            vertex_normals: v.1,
            vertex_vertices: v.2,
            vertex_faces: v.3,
            faces: f.0,
            face_normals: f.1,
            face_texcoords: t.0,
            face_textures: t.1,
            textures: t.2,
            vertex_boundary: t.3,
        })
    })
}

/// A box that both spellings hold exactly: multiples of 1/8 about the axes.
fn obb() -> impl Strategy<Value = Option<Obb>> {
    let eighths = |from: i32| proptest::array::uniform3((from..1000).prop_map(|v| f64::from(v) / 8.0));
    let rotation = [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    proptest::option::of((eighths(-1000), eighths(1)).prop_map(move |(center, half_extent)| Obb {
        rotation,
        center,
        half_extent,
    }))
}

fn scene() -> impl Strategy<Value = Scene> {
    let line = |images| (vec3f(), vec3f(), vec((0..images, float()), 0..3));
    (1u32..5)
        .prop_flat_map(move |n| {
            let first = (vec(platform(), 1..3), vec(image(n), n as usize), cloud(n), mesh());
            let lines = (0usize..3).prop_flat_map(move |count| {
                (vec(line(n), count), all_or_none(count, vec3f()), all_or_none(count, any::<[u8; 3]>()))
            });
            (first, lines, vec(double(), 16), obb())
        })
        .prop_map(|(first, lines, transform, obb)| Scene {
            platforms: first.0,
            images: first.1,
            points: first.2,
            mesh: first.3,
            lines: lines.0.into_iter().map(|(start, end, views)| Line { start, end, views }).collect(),
            line_normals: lines.1,
            line_colors: lines.2,
            transform: transform.try_into().unwrap(),
            obb,
            ..Scene::default()
        })
}

/// The scene without what interface archives cannot hold.
fn for_interface(mut scene: Scene) -> Scene {
    scene.mesh = Mesh::default();
    for image in &mut scene.images {
        (image.width, image.height) = (0, 0);
    }
    scene
}

/// The scene without what native projects cannot hold.
fn for_project(scene: Scene) -> Scene {
    let mut out = Scene {
        platforms: scene.platforms,
        images: scene.images,
        points: scene.points,
        mesh: scene.mesh,
        obb: scene.obb,
        ..Scene::default()
    };
    for camera in out.platforms.iter_mut().flat_map(|p| &mut p.cameras) {
        let Camera { k, rotation, center, .. } = *camera;
        *camera = Camera { k, rotation, center, ..Camera::default() };
    }
    for image in &mut out.images {
        (image.min_depth, image.max_depth) = (0.0, 0.0);
    }
    out
}

prop_compose! {
    fn depth_map()(size in (1u32..9, 1u32..7), extra in (0u32..9, 0u32..9))
                  (area in Just((size.0 * size.1) as usize), size in Just(size), extra in Just(extra),
                   planes in (
                       vec(prop_oneof![Just(0.0f32), 0.01f32..100.0], (size.0 * size.1) as usize),
                       all_or_none((size.0 * size.1) as usize, vec3f()),
                       all_or_none((size.0 * size.1) as usize, 0f32..9.0),
                       all_or_none((size.0 * size.1) as usize, any::<[u8; 4]>())),
                   range in (0f32..1.0, 1f32..f32::MAX), image_name in name(), ids in vec(any::<u32>(), 1..256),
                   focal in (0.1f64..1e4, 0.1f64..1e4), rotation in matrix(),
                   center in proptest::array::uniform3(double())) -> DepthMapFile {
        assert_eq!(planes.0.len(), area);
        DepthMapFile {
            image_width: size.0 + extra.0, image_height: size.1 + extra.1, width: size.0, height: size.1,
            depth_min: range.0, depth_max: range.1, image_name, ids,
            k: [focal.0, 0.0, 3.5, 0.0, focal.1, 2.5, 0.0, 0.0, 1.0], rotation, center,
            depth: planes.0, normal: planes.1, confidence: planes.2, views: planes.3,
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn interface_archives(scene in scene()) {
        let scene = for_interface(scene);
        let mut bytes = Vec::new();
        mvs::write_interface(&mut bytes, &scene, 7).unwrap();
        let file = SceneFile::from_bytes(&bytes, &Limits::default()).unwrap();
        prop_assert_eq!(&file.scene, &scene);
        let mut again = Vec::new();
        file.write(&mut again).unwrap();
        prop_assert!(again == bytes);
    }

    #[test]
    fn projects(scene in scene()) {
        let scene = for_project(scene);
        for kind in ArchiveKind::ALL {
            let mut bytes = Vec::new();
            mvs::write_project(&mut bytes, &scene, kind).unwrap();
            let file = SceneFile::from_bytes(&bytes, &Limits::default()).unwrap();
            prop_assert_eq!(&file.scene, &scene);
            prop_assert_eq!(file.trailing_bytes, 0);
        }
    }

    #[test]
    fn depth_maps(map in depth_map()) {
        let mut bytes = Vec::new();
        map.write(&mut bytes).unwrap();
        prop_assert_eq!(&DepthMapFile::from_bytes(&bytes, &Limits::default()).unwrap(), &map);
    }

    /// Damage in several places at once.
    #[test]
    fn damaged_scenes(scene in scene(), edits in vec((any::<prop::sample::Index>(), any::<u8>()), 1..20)) {
        for kind in [None, Some(ArchiveKind::Text), Some(ArchiveKind::Binary)] {
            let mut bytes = Vec::new();
            match kind {
                None => mvs::write_interface(&mut bytes, &for_interface(scene.clone()), 7).unwrap(),
                Some(kind) => mvs::write_project(&mut bytes, &scene, kind).unwrap(),
            }
            for (at, value) in &edits {
                *at.get_mut(&mut bytes) = *value;
            }
            if let Ok(file) = SceneFile::from_bytes(&bytes, &Limits::default()) {
                let mut scene = file.scene;
                scene.repair().unwrap();
                let _ = scene.check();
            }
        }
    }
}
