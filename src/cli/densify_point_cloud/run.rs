//! One run of `DensifyPointCloud`, from the command line to the exit code.

use super::args::DropInArgs;
use super::front::{self, Typing};
use super::log::Log;
use super::{actions, help, priority, refusals};
use crate::cli::commands::{effective, write_report};
use crate::cli::duration;
use crate::cli::exit_code;
use crate::cli::listen::Recorder;
use crate::cli::one_line::printable;
use crate::cli::options::FilterKind;
use crate::cli::resolve::{self, Resolver};
use crate::cli::values::{openmvs_path, under};
use crate::error::{Error, Result};
use crate::fusion::Support;
use crate::pipeline::{self, DensifyJob, Outputs, SceneArchive};
use crate::report::{RunReport, build, class_table};
use crate::stereo::Quality;
use crate::store::atomic::create_folder;
use crate::store::cloud::{CloudFormat, PlyLayout};
use crate::store::paths::with_suffix;
use semvs_formats::mvs::ArchiveKind;
use std::ffi::OsString;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;

/// Runs `DensifyPointCloud` with the words of its command line, the program's name left out. Lines go to stdout and
/// to a log file in the working folder; an error goes to stderr too unless stdout is a terminal. Every failure is
/// exit code 1.
pub fn densify_point_cloud(words: impl IntoIterator<Item = OsString>) -> ExitCode {
    let words: Vec<OsString> = words.into_iter().collect();
    let typing = match front::read(&words) {
        Ok(typing) => typing,
        Err(error) => return fail(None, &error),
    };
    if typing.args.version {
        return match resolve::cpu() {
            Ok(level) => {
                crate::cli::print(&format!("{}\n{}", title(), resolve::kernels(level)));
                ExitCode::SUCCESS
            }
            Err(error) => fail(None, &error.to_string()),
        };
    }
    let folder = typing.args.shared.run.working_folder.as_deref().map(openmvs_path).unwrap_or_default();
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
    let log = create_folder(here).and_then(|()| Log::create(here, typing.args.verbosity));
    let log = match log {
        Ok(log) => Arc::new(log),
        Err(error) => return fail(None, &error.to_string()),
    };
    log.line(0, &title());
    let typed: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
    log.line(0, &format!("Command line: DensifyPointCloud {}", typed.join(" ")));
    if typing.args.help {
        crate::cli::print(&help::text());
        if typing.args.input_file.is_none() {
            return ExitCode::FAILURE;
        }
    }
    // The default of OpenMVS, a low one, is not set unless it is typed.
    let wanted = typing.has("process-priority").then_some(typing.args.process_priority);
    if let Some(Err(why)) = wanted.map(priority::set) {
        log.line(1, &format!("--process-priority {}: not set: {why}", typing.args.process_priority));
    }
    let recorder = Recorder::before(log.clone());
    match run(&typing, &folder, &log, &recorder) {
        Ok(()) => {
            log.memory();
            ExitCode::SUCCESS
        }
        Err(error) => {
            fail(Some(&log), &error.to_string());
            exit_code(&error)
        }
    }
}

/// The first line of the log.
fn title() -> String {
    format!("semvs {}, DensifyPointCloud as of OpenMVS 2.3.0", build())
}

/// Says what went wrong.
fn fail(log: Option<&Log>, error: &str) -> ExitCode {
    let error = printable(error);
    match log {
        Some(log) => log.error(&error),
        None => crate::cli::print(&format!("{} [App     ] error: {error}\n", duration::clock())),
    }
    if !std::io::stdout().is_terminal() {
        crate::cli::complain(&format!("error: {error}\n"));
    }
    ExitCode::FAILURE
}

fn run(typing: &Typing, folder: &Path, log: &Log, recorder: &Arc<Recorder>) -> Result<()> {
    let args = &typing.args;
    let Some(input) = &args.input_file else {
        return Err(Error::invalid("no input file: give the scene, DensifyPointCloud SCENE.mvs; see --help"));
    };
    refusals::check(args).map_err(Error::Invalid)?;
    let input = existing_input(folder, input)?;
    let place = |path: &Path| front::resolve_existing(folder, path);
    let resolver = Resolver::new(&args.shared, &place)?;
    let progress = recorder.progress();
    resolver.remarks.iter().for_each(|remark| progress.warn(remark.as_str()));
    let job = job(typing, folder, input, &resolver)?;
    if actions::act(typing, folder, &job, &progress)? {
        return Ok(());
    }
    let start = Instant::now();
    recorder.heed_interrupts();
    let mut report = match pipeline::densify(&job, resolve::cpu()?, &progress) {
        Err(error @ (Error::Interrupted | Error::OutOfMemory(_))) => return Err(error),
        Err(error) if args.strict_openmvs && job.depth_maps_only && pipeline::is_readable(&job.input) => {
            log.error(&error.to_string());
            log.line(0, &format!("Depth-maps estimated ({})", duration::text(start.elapsed())));
            return Ok(());
        }
        result => result?,
    };
    report.warnings = recorder.warnings();
    conclude(report, &job, typing, log)
}

/// The scene as OpenMVS finds it.
///
/// # Errors
/// There is none; the message says where it was looked for.
fn existing_input(folder: &Path, typed: &Path) -> Result<PathBuf> {
    let input = front::resolve(folder, typed);
    if input.exists() {
        return Ok(input);
    }
    let elsewhere = openmvs_path(typed);
    let what = match std::path::absolute(&elsewhere) {
        _ if folder.as_os_str().is_empty() || elsewhere.is_absolute() => "no such scene".to_owned(),
        Ok(path) if path.exists() => {
            format!("no such scene; its path is taken from the working folder (-w), give {}", path.display())
        }
        _ => "no such scene; its path is taken from the working folder (-w)".to_owned(),
    };
    Err(Error::content(&input, what))
}

/// Verbosity from which on pictures of the depth maps are left.
const PICTURES: i32 = 3;

fn job(typing: &Typing, folder: &Path, input: PathBuf, resolver: &Resolver<'_>) -> Result<DensifyJob> {
    let args = &typing.args;
    let shared = &args.shared;
    let strict = args.strict_openmvs;
    let base = output_base(args, folder, &input)?;
    let (archive, layout) = archive(args)?;
    let mut scene = resolver.scene(input, folder.to_owned())?;
    if let Some(masks) = &mut scene.masks {
        // Unlike all others this path is relative to the current folder.
        masks.folder = shared.images.mask_path.as_deref().map(openmvs_path);
    }
    if strict {
        (scene.strict, scene.like_openmvs) = (true, true);
        if let Some(tower) = &mut scene.tower {
            (tower.any_direction, tower.cloud) = (true, PathBuf::from("tower.ply"));
        }
    }
    let outputs = &shared.labels.output;
    let filter = resolver.filter(strict || typing.has("postprocess-dmaps"), FilterKind::Openmvs)?;
    Ok(DensifyJob {
        input: scene,
        resolution: resolver.resolution()?,
        depth_maps: if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder.to_owned() },
        force: shared.run.force,
        pictures: args.verbosity >= PICTURES,
        stereo: resolver.stereo(Quality::High, &filter)?,
        filter,
        depth_maps_only: shared.estimation.fusion_mode == 1,
        remove_depth_maps: shared.fusion.remove_dmaps,
        fusion: resolver.fusion(Support::Unclaimed, None)?,
        outputs: Outputs {
            scene: Some(with_suffix(&base, ".mvs")),
            archive,
            report: outputs.report.as_deref().map(|path| under(folder, &openmvs_path(path))),
            names_from_scene: false,
            sparse_cloud: true,
            allow_empty: strict,
            ..resolve::outputs(&outputs.clouds, with_suffix(&base, cloud_extension(args)), layout)
        },
    })
}

/// The extension of the cloud: `.ply`, unless the results are named like a LAS or LAZ file.
fn cloud_extension(args: &DropInArgs) -> &'static str {
    let named = args.output_file.as_deref().filter(|_| !args.strict_openmvs).and_then(CloudFormat::named);
    match named {
        Some(CloudFormat::Las) => ".las",
        Some(CloudFormat::Laz) => ".laz",
        Some(CloudFormat::Ply) | None => ".ply",
    }
}

/// The results' path without extension.
fn output_base(args: &DropInArgs, folder: &Path, input: &Path) -> Result<PathBuf> {
    let base = match &args.output_file {
        Some(output) if args.strict_openmvs => {
            let path = front::resolve(folder, output);
            // A dot in the name of a folder ends the name too.
            let text = path.to_string_lossy();
            PathBuf::from(text.rsplit_once('.').map_or(&*text, |(base, _)| base))
        }
        Some(output) => front::resolve(folder, output).with_extension(""),
        None => with_suffix(&input.with_extension(""), "_dense"),
    };
    match base.file_name() {
        None => Err(Error::content(&base, "--output-file: give a file name")),
        Some(_) => Ok(base),
    }
}

/// What the scene is written as, and the columns of a cloud beside it.
fn archive(args: &DropInArgs) -> Result<(SceneArchive, PlyLayout)> {
    let kind = args.archive_type;
    if kind == -1 {
        return Ok((SceneArchive::Interface, PlyLayout::OpenMvs));
    }
    match usize::try_from(kind).ok().and_then(|kind| ArchiveKind::ALL.get(kind)) {
        Some(&kind) => Ok((SceneArchive::Project(kind), PlyLayout::OpenMvsProject)),
        None if args.strict_openmvs => Ok((SceneArchive::Header(kind), PlyLayout::OpenMvsProject)),
        None => Err(Error::invalid(format!("--archive-type {kind}: give -1 to 3"))),
    }
}

fn conclude(mut report: RunReport, job: &DensifyJob, typing: &Typing, log: &Log) -> Result<()> {
    if !report.classes.is_empty() {
        class_table(&report.classes).lines().for_each(|line| log.line(0, line));
    }
    if let Some(path) = &job.outputs.report {
        report.of_this_build("DensifyPointCloud");
        report.options = typing.options.clone();
        effective::resolve(
            &mut report.options,
            &job.input,
            &job.outputs,
            None,
            Some(&job.filter),
            &job.fusion,
        );
        write_report(&report, path)?;
    }
    Ok(())
}
