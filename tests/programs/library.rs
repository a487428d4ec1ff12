//! The library does what the program does.

use crate::common::Scratch;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

fn bytes(scratch: &Scratch, folder: &str) -> BTreeMap<String, Vec<u8>> {
    let files = scratch.files().into_iter().filter(|file| file.starts_with(&format!("{folder}/")));
    files.map(|file| (file[folder.len() + 1..].to_owned(), scratch.read(&file))).collect()
}

fn run(scratch: &Scratch, folder: &str) -> semvs::Densify {
    semvs::Densify::new(scratch.path("scene.mvs"))
        .output(scratch.path(folder).join("x.ply"))
        .depth_maps(scratch.path(folder))
        .resolution(1, 160, 2560)
}

#[test]
fn a_run_of_the_library_leaves_the_bytes_of_the_program() {
    let scratch = Scratch::facade6();
    let program = "--resolution-level 1 --min-resolution 160";
    scratch.semvs(&format!("densify scene.mvs -w p -o p/x.ply {program}")).ok();
    let steps = Arc::new(AtomicUsize::new(0));
    let seen = steps.clone();
    let job = run(&scratch, "l").observe(move |step| {
        assert!(step.done <= step.total && !step.stage.is_empty());
        seen.fetch_add(1, Ordering::Relaxed);
        true
    });
    let summary = job.run().unwrap();
    assert_eq!(summary.points(), scratch.cloud("l/x.ply").len() as u64);
    assert!(summary.files().next().unwrap().ends_with("x.ply"), "{summary:?}");
    assert!(steps.load(Ordering::Relaxed) > 20);
    assert_eq!(
        bytes(&scratch, "l").keys().collect::<Vec<_>>(),
        bytes(&scratch, "p").keys().collect::<Vec<_>>()
    );
    for (name, expected) in bytes(&scratch, "p") {
        assert!(scratch.read(&format!("l/{name}")) == expected, "{name}");
    }

    let labels = "--label-path labels --class-table 3dom-facade --exclude-classes sky --quality draft";
    scratch.semvs(&format!("densify scene.mvs -w pl -o pl/x.ply {program} {labels}")).ok();
    let job = run(&scratch, "ll").label_folder(scratch.path("labels")).class_table("3dom-facade");
    job.exclude_classes(["sky"]).quality(semvs::Quality::Draft).run().unwrap();
    for (name, expected) in bytes(&scratch, "pl") {
        assert!(scratch.read(&format!("ll/{name}")) == expected, "{name} with labels");
    }
}

#[test]
fn an_observer_stops_a_run_which_goes_on_later() {
    let scratch = Scratch::facade6();
    let stopped = run(&scratch, "s").observe(|step| step.stage != "Estimating depth maps").run();
    assert!(matches!(stopped, Err(semvs::Error::Interrupted)), "{stopped:?}");
    assert!(!scratch.has("s/x.ply"));
    let whole = run(&scratch, "s").run().unwrap();
    assert!(whole.points() > 10_000 && scratch.has("s/x.ply"));
}

#[test]
fn what_a_run_lacks_is_said_in_a_line() {
    let scratch = Scratch::facade6();
    let refused = |job: semvs::Densify| job.run().unwrap_err().to_string();
    let error = refused(semvs::Densify::new(scratch.path("scene.mvs")));
    assert!(error.contains("Densify::output"), "{error}");
    let error = refused(run(&scratch, "x").output(scratch.path("x.xyz")));
    assert!(error.contains("x.xyz") && error.contains(".ply, .las or .laz"), "{error}");
    let error = refused(run(&scratch, "x").label_folder(scratch.path("nowhere")));
    assert!(error.contains("nowhere"), "{error}");
}

#[test]
fn clouds_far_away_keep_their_digits() {
    use semvs::{Camera, Cloud, DepthMap, FuseOptions, FuseView, fuse};
    let scratch = Scratch::new();
    let (k, ahead) =
        ([[8.0, 0.0, 3.5], [0.0, 8.0, 3.5], [0.0, 0.0, 1.0]], [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]]);
    let far = [500_000.25, 5_000_000.5, 100.0];
    let map = |id: u32, x: f64| {
        let camera = Camera::new((8, 8), k, ahead, [far[0] + x, far[1], far[2]]).unwrap();
        DepthMap::builder(camera, vec![4.0; 64]).id(id).normals(vec![[0.0, 0.0, -1.0]; 64]).build().unwrap()
    };
    // The second camera stands one pixel of that depth to the right of the first.
    let views = [FuseView::new(map(0, 0.0)), FuseView::new(map(1, 0.5))];
    let cloud = fuse(&views, &FuseOptions::new().min_views(2)).unwrap();
    assert!(cloud.len() >= 7 * 8, "{}", cloud.len());
    cloud.write(scratch.path("far.ply")).unwrap();
    let read = Cloud::read(scratch.path("far.ply")).unwrap();
    assert_eq!(read.len(), cloud.len());
    for (a, b) in cloud.points().zip(read.points()) {
        assert!((a.position()[2] - 104.0).abs() < 1e-6, "{:?}", a.position());
        assert!((0..3).all(|i| (a.position()[i] - b.position()[i]).abs() < 1e-6), "{a:?} {b:?}");
        assert_eq!(a.views().collect::<Vec<_>>(), [0, 1]);
    }
    let twice = [FuseView::new(map(0, 0.0)), FuseView::new(map(0, 0.5))];
    let error = fuse(&twice, &FuseOptions::new()).unwrap_err().to_string();
    assert!(error.contains("photograph 0000"), "{error}");
    let error = fuse(&views, &FuseOptions::new().exclude_classes(["sky"])).unwrap_err().to_string();
    assert!(error.contains("FuseOptions::classes"), "{error}");
}
