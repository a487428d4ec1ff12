//! The files that are named on the command line, held against what a command takes, before anything is read: whoever is new
//! gives the right file in the wrong place.

use super::exchange_args::ExportKind;
use super::labels_args::LabelsCommand;
use super::options::SharedOptions;
use super::semvs_args::Command;
use crate::error::{Error, Result};
use crate::semantics::nearest;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// What a path leads to, told by its first bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Folder,
    Scene,
    DepthMap,
    Ply,
    Las,
    Picture,
    Compressed,
    /// Whatever reads it will tell.
    Other,
}

impl Kind {
    fn of(path: &Path) -> Kind {
        if path.is_dir() {
            return Kind::Folder;
        }
        let mut head = Vec::new();
        if !path.is_file() || File::open(path).and_then(|file| file.take(8).read_to_end(&mut head)).is_err() {
            return Kind::Other;
        }
        match head.as_slice() {
            [b'M', b'V', b'S', b'I' | 0, ..] => Kind::Scene,
            [b'D', b'R' | b'2', ..] => Kind::DepthMap,
            [b'p', b'l', b'y', b'\n' | b'\r', ..] => Kind::Ply,
            [b'L', b'A', b'S', b'F', ..] => Kind::Las,
            [0xFF, 0xD8, 0xFF, ..] | [0x89, b'P', b'N', b'G', ..] => Kind::Picture,
            [b'I', b'I', b'*', 0, ..] | [b'M', b'M', 0, b'*', ..] => Kind::Picture,
            [0x28, 0xB5, 0x2F, 0xFD, ..] | [0x1F, 0x8B, ..] | [b'P', b'K', 3, 4, ..] => Kind::Compressed,
            _ => Kind::Other,
        }
    }

    fn text(self) -> &'static str {
        match self {
            Kind::Folder => "a folder",
            Kind::Scene => "an OpenMVS scene",
            Kind::DepthMap => "a depth map",
            Kind::Ply => "a PLY file",
            Kind::Las => "a LAS or LAZ cloud",
            Kind::Picture => "a picture",
            Kind::Compressed => "a compressed file; unpack it first",
            Kind::Other => "a file",
        }
    }
}

/// Checks the files that `command` names.
///
/// # Errors
/// One is not there, or of a kind that the command does not take.
pub(super) fn check(command: &Command) -> Result<()> {
    const SCENE: &[Kind] = &[Kind::Scene, Kind::Folder, Kind::Other];
    let scene = |path: &Path| {
        takes(path, SCENE, "give the scene: an .mvs file, or the folder of COLMAP's undistorted workspace")?;
        check_workspace(path)
    };
    let maps = |path: &Path| takes(path, &[Kind::Folder], "--depth-maps takes the folder of the depth maps");
    match command {
        Command::Densify(args) => scene(&args.scene).and_then(|()| shared(&args.shared)),
        Command::Fuse(args) => {
            scene(&args.scene)?;
            args.depth_maps.as_deref().map_or(Ok(()), maps)?;
            shared(&args.shared)
        }
        Command::Convert(args) => args.depth_maps.iter().try_for_each(|path| {
            let kinds = &[Kind::DepthMap, Kind::Ply, Kind::Other];
            takes(path, kinds, "give depth maps, DIR/depth*.dmap, or one PLY cloud")
        }),
        Command::Import(args) => {
            takes(
                &args.input,
                &[Kind::Folder],
                "give a folder: COLMAP's workspace or model, or one of depths with --scene",
            )?;
            args.scene.as_deref().map_or(Ok(()), scene)
        }
        Command::Export(args) => args.inputs.iter().try_for_each(|path| match args.to {
            ExportKind::Pfm | ExportKind::Npy | ExportKind::Png => {
                let wanted = "--to pfm, npy and png take depth maps, DIR/depth*.dmap";
                takes(path, &[Kind::DepthMap, Kind::Other], wanted)
            }
            ExportKind::Mvs | ExportKind::Colmap | ExportKind::Roi | ExportKind::Neighbors => scene(path),
        }),
        Command::Inspect(args) => {
            let kinds = [Kind::Scene, Kind::DepthMap, Kind::Ply, Kind::Las, Kind::Picture, Kind::Other];
            takes(&args.file, &kinds, "give a file in it; semvs preview DIR draws all depth maps of a folder")
        }
        Command::Evaluate(args) => [&args.cloud, &args.truth].into_iter().try_for_each(|path| {
            takes(path, &[Kind::Ply, Kind::Other], "clouds that are held against each other are PLY files")
        }),
        Command::Labels(args) => match &args.command {
            LabelsCommand::Check(args) => {
                scene(&args.scene)?;
                args.depth_maps.as_deref().map_or(Ok(()), maps)
            }
            LabelsCommand::Render(args) => {
                scene(&args.scene)?;
                takes(
                    &args.cloud,
                    &[Kind::Ply, Kind::Other],
                    "--cloud takes a labelled PLY cloud, as semvs densify writes it",
                )
            }
        },
        Command::Preview(args) => takes(
            &args.maps,
            &[Kind::DepthMap, Kind::Folder, Kind::Other],
            "give a depth map (.dmap) or a folder of them",
        ),
        Command::Compare(args) => {
            [&args.a, &args.b].into_iter().chain(&args.expect).try_for_each(|path| exists(path))
        }
        // These take no file.
        Command::Demo(_) | Command::Completions(_) | Command::Man(_) => Ok(()),
        Command::Report(args) => takes(
            &args.folder,
            &[Kind::Folder],
            "give the folder that a run has left: -w, or that of its cloud",
        ),
    }
}

/// Files that options name.
fn shared(options: &SharedOptions) -> Result<()> {
    options.images.view_neighbors_file.iter().try_for_each(|path| exists(path))?;
    options.images.pointcloud_file.iter().try_for_each(|path| {
        takes(path, &[Kind::Ply, Kind::Other], "--pointcloud-file takes a PLY file with lists of views")
    })
}

/// Refuses what is not there or of another kind than `kinds`; `wanted`: what to give.
fn takes(path: &Path, kinds: &[Kind], wanted: &str) -> Result<()> {
    exists(path)?;
    match Kind::of(path) {
        kind if kinds.contains(&kind) => Ok(()),
        kind => Err(Error::content(path, format!("this is {}; {wanted}", kind.text()))),
    }
}

/// A folder that is no workspace but holds scenes is a slip that can be named.
fn check_workspace(folder: &Path) -> Result<()> {
    let is_workspace =
        || ["sparse", "cameras.bin", "cameras.txt"].iter().any(|name| folder.join(name).exists());
    if !folder.is_dir() || is_workspace() {
        return Ok(());
    }
    let scenes = with_extension(folder, "mvs");
    if scenes.is_empty() {
        return Ok(());
    }
    Err(Error::content(folder, format!("this is a folder; give the scene in it: {}", named(&scenes))))
}

/// Refuses a path that leads nowhere, with what may have been meant.
fn exists(path: &Path) -> Result<()> {
    match path.try_exists() {
        // What else is wrong with it is told by whoever opens it.
        Ok(true) | Err(_) => return Ok(()),
        Ok(false) => {}
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(Error::content(path, format!("not there, nor is the folder {}", folder.display())));
    }
    Err(Error::content(path, format!("there is no such file or folder{}", instead_of(path, folder))))
}

/// What in `folder` may have been meant by `path`, if anything.
fn instead_of(path: &Path, folder: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let names: Vec<String> =
        entries(folder).iter().filter_map(|entry| entry.file_name()?.to_str().map(str::to_owned)).collect();
    if let Some(near) = nearest(&name, names.iter().map(String::as_str)) {
        return format!("; did you mean {}?", path.with_file_name(near).display());
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let like = if extension.is_empty() { Vec::new() } else { with_extension(folder, &extension) };
    match like.is_empty() {
        true => String::new(),
        false => format!("; there is {}", named(&like)),
    }
}

/// The files of a folder, sorted; none if it cannot be read.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let found = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = found.map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

fn with_extension(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let has = |path: &PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    let mut found = entries(folder);
    found.retain(has);
    found.into_iter().map(|path| path.strip_prefix(".").map(Path::to_owned).unwrap_or(path)).collect()
}

/// The first of `paths`, and how many more there are.
fn named(paths: &[PathBuf]) -> String {
    const MOST: usize = 3;
    let first: Vec<String> = paths.iter().take(MOST).map(|path| path.display().to_string()).collect();
    match paths.len().saturating_sub(MOST) {
        0 => first.join(", "),
        more => format!("{} and {more} more", first.join(", ")),
    }
}
