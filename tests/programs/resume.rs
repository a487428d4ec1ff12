//! Runs that are repeated, interrupted, killed, started twice.

#[cfg(unix)]
use crate::common::SEMVS;
use crate::common::{SMALL, Scratch};
#[cfg(unix)]
use std::process::{Command, Stdio};
#[cfg(unix)]
use std::time::{Duration, Instant};

/// Small maps, quickly, with all stages.
const QUICK: &str = "--resolution-level 2 --min-resolution 80 --iters 1 --sub-resolution-levels 0 --number-views 2 \
                     --number-views-fuse 2";

/// Bytes of the results.
fn results(scratch: &Scratch) -> Vec<(String, Vec<u8>)> {
    let is_result = |name: &String| ["ply", "mvs", "dmap", "semvs"].iter().any(|end| name.ends_with(end));
    let named = |name: String| {
        let bytes = scratch.read(&name);
        (name, bytes)
    };
    scratch.files().into_iter().filter(is_result).map(named).collect()
}

#[test]
fn a_second_run_makes_only_what_has_changed() {
    let scratch = Scratch::facade6();
    let run = |more: &str| scratch.semvs(&format!("densify scene.mvs -o out.ply {QUICK} {more}")).ok().stderr;
    run("");
    let first = results(&scratch);
    let report = run("--report r.json");
    assert!(report.contains("6 depth maps are up to date"), "{report}");
    assert_eq!(results(&scratch), first);
    let rows: serde_json::Value = serde_json::from_slice(&scratch.read("r.json")).unwrap();
    assert!(rows["views"].as_array().unwrap().iter().all(|view| view["reused"] == true));

    // Another option makes other maps, and says which.
    let said = run("--quality draft");
    assert!(said.contains("6 depth maps exist") && said.contains("estimation options"), "{said}");
    let said = run("--quality draft --filter openmvs");
    assert!(said.contains("estimation options, filter across views,"), "{said}");
    // Back again.
    run("");
    assert_eq!(results(&scratch), first);

    // One image changes: its own map and those that see it, no others.
    let photograph = scratch.read("images/0013.jpg");
    scratch.edit("images/0013.jpg", |bytes| bytes.extend(b"a comment after the end"));
    let said = run("");
    assert!(said.contains("image") && said.contains("estimated again"), "{said}");
    scratch.write("images/0013.jpg", photograph);
    run("");
    assert_eq!(results(&scratch), first);

    // A map that was changed or is gone is made again.
    scratch.edit("depth0002.dmap", |bytes| *bytes.last_mut().unwrap() ^= 1);
    std::fs::remove_file(scratch.path("depth0004.dmap")).unwrap();
    let said = run("");
    assert!(said.contains("4 depth maps are up to date") && said.contains("1 depth maps exist"), "{said}");
    assert_eq!(results(&scratch), first);

    let said = run("--force");
    assert!(said.contains("--force") && !said.contains("up to date"), "{said}");
    assert_eq!(results(&scratch), first);
    // Without maps nothing is left to be told of.
    run("--remove-dmaps 1");
    assert!(!scratch.has("depth0000.dmap") && !scratch.has("depthmaps.semvs"));
}

#[test]
fn maps_of_others_are_filtered_anew_by_every_run() {
    let scratch = Scratch::facade6();
    scratch.add_maps("raw", ".");
    let words = format!("scene.mvs {SMALL} --geometric-iters 0 --postprocess-dmaps 4 -v 0");
    let before = scratch.read("depth0003.dmap");
    scratch.densify_point_cloud(&words).ok();
    let once = scratch.read("depth0003.dmap");
    assert_ne!(once, before);
    scratch.densify_point_cloud(&words).ok();
    assert_ne!(scratch.read("depth0003.dmap"), once, "as OpenMVS does");
}

#[test]
fn a_folder_has_one_run_at_a_time() {
    let scratch = Scratch::facade6();
    std::fs::create_dir(scratch.path("maps")).unwrap();
    let lock = std::fs::File::create(scratch.path("maps/.semvs.lock")).unwrap();
    lock.lock().unwrap();
    let before = scratch.files();
    for words in [
        format!("densify scene.mvs -o out.ply -w maps {QUICK}"),
        "fuse scene.mvs --depth-maps maps -o out.ply".to_owned(),
    ] {
        scratch.semvs(&words).fails_naming(&["maps", "another run", "-w"]);
    }
    assert_eq!(scratch.files(), before);
    drop(lock);
    // What a run that was killed has left is in nobody's way, and is cleared.
    scratch.write("maps/.depth0001.dmap.Ab12Cd.semvs-tmp", "half a map");
    scratch.write(".out.ply.Ab12Cd.semvs-tmp", "half a cloud");
    let out = scratch.semvs(&format!("densify scene.mvs -o out.ply -w maps {QUICK}")).ok();
    assert!(out.stderr.contains("2 temporary files"), "{}", out.stderr);
    assert!(!scratch.files().iter().any(|name| name.contains("semvs-tmp") || name.contains("lock")));
}

#[cfg(unix)]
#[test]
fn the_first_interrupt_leaves_a_state_to_go_on_from() {
    let scratch = Scratch::facade6();
    let words: Vec<&str> =
        "densify scene.mvs -o out.ply --resolution-level 1 --min-resolution 160 --max-threads 1"
            .split(' ')
            .collect();
    scratch.run(SEMVS, &words).ok();
    let expected = results(&scratch);
    for name in ["out.ply", "out.mvs", "depthmaps.semvs"] {
        std::fs::remove_file(scratch.path(name)).unwrap();
    }
    (0..6).for_each(|i| std::fs::remove_file(scratch.path(&format!("depth{i:04}.dmap"))).unwrap());

    let mut command = Command::new(SEMVS);
    command.args(&words).current_dir(scratch.path("")).stderr(Stdio::piped()).stdout(Stdio::null());
    let mut child = command.spawn().unwrap();
    let begun = Instant::now();
    while !scratch.files().iter().any(|name| name.contains(".pass"))
        && begun.elapsed() < Duration::from_secs(60)
    {
        std::thread::sleep(Duration::from_millis(5));
    }
    Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    let mut said = String::new();
    std::io::Read::read_to_string(&mut child.stderr.take().unwrap(), &mut said).unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{said}");
    assert!(said.contains("the same command goes on"), "{said}");
    assert!(!scratch.has("out.ply") && !scratch.files().iter().any(|name| name.ends_with("tmp")));
    let out = scratch.run(SEMVS, &words).ok();
    assert!(out.stderr.contains("an unfinished run is resumed"), "{}", out.stderr);
    assert_eq!(results(&scratch), expected);
}

#[cfg(target_os = "linux")]
#[test]
fn memory_that_runs_out_ends_as_if_the_system_had_killed_the_process() {
    let scratch = Scratch::facade6();
    let program = format!(
        "ulimit -v 60000; exec {SEMVS} densify scene.mvs -o out.ply --resolution-level 0 --max-threads 2"
    );
    let output = Command::new("sh").args(["-c", &program]).current_dir(scratch.path("")).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(137), "{said}");
    assert!(said.contains("out of memory"), "{said}");
}

#[test]
fn less_memory_gives_the_same_bytes_or_is_refused_before_work() {
    let scratch = Scratch::facade6();
    let run = |more: &str| scratch.semvs(&format!("densify scene.mvs -o out.ply {QUICK} {more}"));
    run("").ok();
    let expected = results(&scratch);
    run("--force --max-memory 60M").ok();
    assert_eq!(results(&scratch), expected);
    let refused = run("--force --max-memory 40M");
    assert_eq!(refused.code, Some(137), "{}", refused.stderr);
    assert!(refused.stderr.contains("give --max-memory") && refused.stderr.contains("40 MiB may be used"));
    assert_eq!(results(&scratch), expected);
    run("--max-memory 4").fails_naming(&["--max-memory", "4G"]);
}
