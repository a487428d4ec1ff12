//! What one meets first: the demo, completions, manual pages.

use crate::common::{self, Scratch};
use std::io::ErrorKind;
use std::process::{Command, Output};

#[test]
fn the_demo_leaves_a_cloud_and_a_page_and_goes_on_where_it_was() {
    let scratch = Scratch::new();
    let out = scratch.semvs("demo").ok();
    let page = scratch.path("semvs-demo/report.html").canonicalize().unwrap();
    assert!(out.stdout.contains(page.to_str().unwrap()), "{}", out.stdout);
    for name in ["scene.mvs", "images/0012.jpg", "labels/0003_l.png"] {
        let bundled = std::fs::read(common::facade6().join(name)).unwrap();
        assert_eq!(scratch.read(&format!("semvs-demo/scene/{name}")), bundled, "{name}");
    }
    let cloud = scratch.cloud("semvs-demo/cloud.ply");
    assert!(cloud.len() > 50_000, "{}", cloud.len());
    let text = String::from_utf8(scratch.read("semvs-demo/report.html")).unwrap();
    assert!(text.contains("\"window\"") && text.contains("3dom-facade"));
    let maps = scratch.files().iter().filter(|name| name.ends_with(".dmap")).count();
    assert_eq!(maps, 6);

    let before = scratch.read("semvs-demo/cloud.ply");
    scratch.write("semvs-demo/notes.txt", "mine");
    std::fs::remove_file(scratch.path("semvs-demo/scene/images/0004.jpg")).unwrap();
    let again = scratch.semvs("demo").ok();
    assert!(again.stderr.contains("6 depth maps are up to date"), "{}", again.stderr);
    assert!(scratch.read("semvs-demo/cloud.ply") == before);
    assert_eq!(scratch.read("semvs-demo/notes.txt"), b"mine");

    // A changed scene is somebody's work.
    scratch.write("semvs-demo/scene/labels/0005_l.png", "painted over");
    scratch.semvs("demo").fails_naming(&["0005_l.png", "-o"]);
    assert_eq!(scratch.read("semvs-demo/scene/labels/0005_l.png"), b"painted over");
}

#[test]
fn the_demo_keeps_off_folders_of_others() {
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("full")).unwrap();
    scratch.write("full/cloud.ply", "mine");
    scratch.semvs("demo -o full").fails_naming(&["full", "other files", "-o"]);
    scratch.semvs("demo -o full/cloud.ply").fails_naming(&["full/cloud.ply", "in the way"]);
    scratch.semvs("demo -o full/cloud.ply/x").fails_naming(&["full/cloud.ply", "in the way"]);
    scratch.semvs("demo here").fails_naming(&["here"]);
    assert_eq!(scratch.files(), ["full/cloud.ply"]);
}

/// What `program` says, run in the folder; `None` where it is not installed.
fn asked(scratch: &Scratch, program: &str, words: &[&str]) -> Option<Output> {
    match Command::new(program).args(words).current_dir(scratch.path(".")).output() {
        Err(e) if e.kind() == ErrorKind::NotFound => {
            println!("skipped: {program} is not installed");
            None
        }
        output => Some(output.unwrap()),
    }
}

#[track_caller]
fn assert_silent(output: &Output) {
    let said =
        String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.is_empty(), "{said}");
}

#[test]
fn shells_take_their_completions() {
    let scratch = Scratch::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        for (program, words) in
            [("semvs", ["labels", "label-estimation"]), ("DensifyPointCloud", ["tower-mode", "iters"])]
        {
            let script = scratch.semvs(&format!("completions {shell} --program {program}")).ok().stdout;
            assert!(words.iter().all(|word| script.contains(word)), "{shell} {program}\n{script}");
            let name = format!("{program}.{shell}");
            scratch.write(&name, &script);
            if ["bash", "zsh", "fish"].contains(&shell)
                && let Some(output) = asked(&scratch, shell, &["-n", &name])
            {
                assert_silent(&output);
            }
        }
    }
    let complete = "source semvs.bash; COMP_WORDS=(semvs densify --label-co); COMP_CWORD=2; \
                    _semvs semvs --label-co densify; echo ${COMPREPLY[@]}";
    if let Some(output) = asked(&scratch, "bash", &["-c", complete]) {
        assert_eq!(String::from_utf8_lossy(&output.stdout), "--label-cost --label-consistency\n");
    }
    scratch.semvs("completions tcsh").fails_naming(&["tcsh", "zsh"]);
}

#[test]
fn every_command_has_a_manual_page_that_readers_take() {
    let scratch = Scratch::new();
    let listed = scratch.semvs("man -o man1").ok().stdout;
    assert_eq!(listed.lines().count(), scratch.files().len());
    let help = scratch.semvs("--help").ok().stdout;
    let commands = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let is_command = |line: &&str| line.starts_with("  ") && !line.starts_with("   ");
    let commands: Vec<&str> =
        commands.lines().filter(is_command).map(|line| line.split_whitespace().next().unwrap()).collect();
    assert!(commands.len() > 10 && commands.contains(&"densify"), "{commands:?}");
    for command in commands.iter().filter(|command| **command != "help") {
        assert!(scratch.has(&format!("man1/semvs-{command}.1")), "{command}");
    }
    assert!(scratch.has("man1/semvs-labels-check.1") && scratch.has("man1/DensifyPointCloud.1"));
    let main = scratch.semvs("man").ok().stdout;
    assert_eq!(main.as_bytes(), scratch.read("man1/semvs.1"));
    for page in scratch.files() {
        if let Some(output) = asked(&scratch, "mandoc", &["-Tlint", "-Werror", &page]) {
            assert_silent(&output);
        }
        if let Some(output) = asked(&scratch, "man", &["--warnings", "-l", &page]) {
            assert!(output.status.success() && output.stderr.is_empty(), "{page}: {output:?}");
            assert!(output.stdout.len() > 500, "{page}");
        }
    }
    let page = String::from_utf8(scratch.read("man1/semvs-densify.1")).unwrap();
    for part in ["SH EXAMPLES", "semvs densify colmap/dense", "\\-\\-label\\-path", "semvs 0."] {
        assert!(page.contains(part), "{part}\n{page}");
    }
    scratch.write("file", "");
    scratch.semvs("man -o file").fails_naming(&["file", "in the way"]);
}
