//! `semvs demo`.

use super::densify;
use crate::cli::install_args::DemoArgs;
use crate::cli::listen::Recorder;
use crate::cli::semvs_args::{Command, SemvsArgs};
use crate::error::{Error, Result};
use crate::store::demo_scene;
use clap::{CommandFactory, FromArgMatches};
use std::ffi::OsString;
use std::path::Path;
use std::sync::Arc;

/// Unpacks the scene, runs `semvs densify` on it, and says what to look at.
///
/// # Errors
/// The folder holds something else; those of the run.
pub(crate) fn demo(args: &DemoArgs, recorder: &Arc<Recorder>) -> Result<()> {
    let folder = &args.output;
    let scene = folder.join("scene");
    demo_scene::unpack(folder, &scene)?;
    let words = words(folder, &scene, args.max_threads);
    let failed = |e: clap::Error| Error::invalid(format!("--output: {}", crate::cli::one_line::one_line(&e)));
    let matches = SemvsArgs::command().try_get_matches_from(words).map_err(failed)?;
    let typed = SemvsArgs::from_arg_matches(&matches).map_err(failed)?;
    if let (Command::Densify(args), Some((_, matches))) = (&typed.command, matches.subcommand()) {
        densify(args, matches, recorder)?;
    }
    crate::cli::print(&what_next(folder));
    Ok(())
}

/// The command line of the run. The scene goes last, where its name may begin with a dash.
fn words(folder: &Path, scene: &Path, threads: u32) -> Vec<OsString> {
    let mut words: Vec<OsString> = ["semvs", "densify"].map(OsString::from).to_vec();
    for (option, path) in [
        ("--output=", folder.join("cloud.ply")),
        ("--working-folder=", folder.to_owned()),
        ("--label-path=", scene.join("labels")),
        ("--report=", folder.join("run.json")),
        ("--report-html=", folder.join("report.html")),
    ] {
        let mut word = OsString::from(option);
        word.push(path);
        words.push(word);
    }
    words.extend(["--class-table=3dom-facade", "--exclude-classes=sky,obstacle"].map(OsString::from));
    words.push(format!("--max-threads={threads}").into());
    words.push("--".into());
    words.push(scene.join("scene.mvs").into());
    words
}

fn what_next(folder: &Path) -> String {
    let page = folder.join("report.html");
    let page = std::path::absolute(&page).unwrap_or(page);
    format!(
        "\nOpen this page in a browser: the cloud to turn, every depth map, what was counted and timed.
  {}
The cloud, with a class for every point, opens in CloudCompare, MeshLab and Blender:
  {}
Then, with photographs of your own:
  semvs densify SCENE.mvs -o out/cloud.ply -w out --report-html out/report.html
  semvs densify COLMAP_DENSE_FOLDER --report-html report.html
",
        page.display(),
        folder.join("cloud.ply").display()
    )
}
