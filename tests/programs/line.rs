//! Fusion of a long line of scenes: memory follows the working set, not the number of views.

use crate::common::Scratch;
use semvs_formats::Limits;
use semvs_formats::dmap::DepthMapFile;
use semvs_formats::mvs::{self, NEWEST_VERSION, Scene};

/// Distance between two copies of the bundled scene.
const STEP: f64 = 100.0;
/// Memory for the curve.
const MEMORY: &str = "62M";
/// One of so many sparse points is kept: they are input, and grow with it.
const SPARSE: usize = 8;

/// `copies` of the bundled scene side by side, with OpenMVS's depth maps.
fn line(copies: usize) -> Scratch {
    let scratch = Scratch::facade6();
    scratch.add_maps("post7", "maps");
    let one = mvs::read(scratch.path("scene.mvs"), &Limits::default()).unwrap();
    let mut all = Scene { platforms: one.platforms.clone(), ..Scene::default() };
    let maps: Vec<DepthMapFile> = (0..6)
        .map(|i| {
            DepthMapFile::read(scratch.path(&format!("maps/depth{i:04}.dmap")), &Limits::default()).unwrap()
        })
        .collect();
    for copy in 0..copies {
        let (shift, views) = (STEP * copy as f64, (copy * one.images.len()) as u32);
        for (i, image) in one.images.iter().enumerate() {
            let poses = &mut all.platforms[image.platform as usize].poses;
            let mut pose = one.platforms[image.platform as usize].poses[image.pose as usize].clone();
            pose.center[0] += shift;
            poses.push(pose);
            let (pose, id) = (poses.len() as u32 - 1, views + i as u32);
            let view_scores =
                image.view_scores.iter().map(|s| mvs::ViewScore { image: s.image + views, ..*s }).collect();
            all.images.push(mvs::Image { pose, id, view_scores, ..image.clone() });
            let mut map = maps[i].clone();
            map.center[0] += shift;
            map.ids.iter_mut().for_each(|id| *id += views);
            let mut bytes = Vec::new();
            map.write(&mut bytes).unwrap();
            scratch.write(&format!("maps/depth{id:04}.dmap"), bytes);
        }
        for (i, position) in one.points.positions.iter().enumerate().step_by(SPARSE) {
            all.points.positions.push([position[0] + shift as f32, position[1], position[2]]);
            let seen: Vec<u32> = one.points.views.images_of(i).iter().map(|view| view + views).collect();
            all.points.views.push(&seen, &[]);
        }
    }
    let mut bytes = Vec::new();
    mvs::write_interface(&mut bytes, &all, NEWEST_VERSION).unwrap();
    scratch.write("scene.mvs", bytes);
    scratch
}

/// Points, peak in MiB and seconds of fusion over so many copies.
fn fuse(scratch: &Scratch, options: &str) -> (usize, f64, f64) {
    scratch
        .semvs(&format!(
            "fuse scene.mvs --depth-maps maps -o out.ply --report r.json --estimate-roi 0 {options}"
        ))
        .ok();
    let report: serde_json::Value = serde_json::from_slice(&scratch.read("r.json")).unwrap();
    let peak = report["peak_memory_bytes"].as_f64().unwrap_or(0.0) / f64::from(1 << 20);
    let stages = report["stages"].as_array().unwrap();
    let fusion = stages.iter().find(|stage| stage["stage"] == "fuse").unwrap();
    (report["points"].as_u64().unwrap() as usize, peak, fusion["seconds"].as_f64().unwrap())
}

#[test]
fn memory_of_fusion_does_not_follow_the_number_of_views() {
    let (mut peaks, mut by_default) = (Vec::new(), Vec::new());
    let alone = line(1);
    let (points, ..) = fuse(&alone, "");
    for copies in [3, 11, 43] {
        let scratch = line(copies);
        let (all, peak, _) = fuse(&scratch, &format!("--max-memory {MEMORY} --max-threads 1"));
        let with_more = scratch.read("out.ply");
        let (_, more, seconds) = fuse(&scratch, "--max-threads 2");
        let (_, _, serial) = fuse(&scratch, "--max-threads 1");
        println!(
            "{} views: {all} points, {peak:.0} MiB within {MEMORY}, {more:.0} MiB by default; fusion {serial:.2} s by one thread, \
             {seconds:.2} s by two",
            6 * copies
        );
        assert_eq!(scratch.read("out.ply"), with_more, "streaming or not, the same bytes");
        assert!(all.abs_diff(copies * points) <= copies * points / 20);
        peaks.push(peak);
        by_default.push(more);
    }
    if cfg!(target_os = "linux") {
        assert!(peaks[2] <= 1.25 * peaks[1], "{peaks:?}");
        assert!(by_default[2] <= 1.25 * by_default[1], "{by_default:?}");
    }
}
