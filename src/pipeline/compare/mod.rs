//! Two results against each other, from files: scenes, depth maps or folders of them, clouds.

mod expect;
mod page;
mod pictures;
mod points;
mod read;

pub use expect::Expectation;

use crate::error::{Error, Result};
use crate::evaluate::{
    Check, Comparison, Kind, Part, Tolerance, check_limits, compare_clouds, compare_maps, compare_scenes,
    folder_figures,
};
use crate::store::atomic::check_writable;
use crate::store::packed;
use page::Looks;
use pictures::SmallPair;
use semvs_formats::Limits;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// `compare`.
#[derive(Clone, Debug, PartialEq)]
pub struct CompareJob {
    /// The result to judge.
    pub a: PathBuf,
    /// What it should be.
    pub b: PathBuf,
    /// Scene of the clouds: gives the depths that distances are held against.
    pub scene: Option<PathBuf>,
    /// What the differences may be.
    pub expect: Option<Expectation>,
    /// The page to write about it.
    pub page: Option<PathBuf>,
}

/// What `compare` found.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The differences.
    pub comparison: Comparison,
    /// The numbers held against their limits; `None` if none were given.
    pub checks: Option<Vec<Check>>,
    /// Bytes of the page that was written.
    pub page_bytes: Option<usize>,
}

impl Outcome {
    /// The numbers outside their limits; `None` if none were given.
    pub fn violations(&self) -> Option<Vec<Check>> {
        let checks = self.checks.as_ref()?;
        Some(checks.iter().filter(|check| !check.holds()).cloned().collect())
    }
}

/// Runs `job`.
///
/// # Errors
/// Results that are unreadable, of different kinds, or maps of different sizes; limits on figures that there are not; a
/// page that cannot be written.
pub fn compare(job: &CompareJob) -> Result<Outcome> {
    let (a, b) = (kind_of(&job.a)?, kind_of(&job.b)?);
    let is_folder = |path: &Path| if path.is_dir() { "a folder" } else { "a file" };
    if a != b || job.a.is_dir() != job.b.is_dir() {
        return Err(Error::invalid(format!(
            "{} ({}, {}) and {} ({}, {}) are of different kinds and cannot be compared",
            job.a.display(),
            a.name(),
            is_folder(&job.a),
            job.b.display(),
            b.name(),
            is_folder(&job.b)
        )));
    }
    if let Some(scene) = job.scene.as_ref().filter(|_| a != Kind::Clouds) {
        return Err(Error::content(scene, "a scene is of use for clouds only; leave --scene out"));
    }
    let tolerance = job.expect.as_ref().map_or_else(Tolerance::default, |e| e.tolerance);
    if let Some(expect) = &job.expect {
        expect.check_kind(a)?;
    }
    job.page.as_deref().map(check_writable).transpose()?;
    let mut looks = job.page.is_some().then(Looks::default);
    let comparison = match a {
        Kind::Scenes => scenes(job, &tolerance)?,
        Kind::DepthMaps => depth_maps(job, &tolerance, looks.as_mut())?,
        Kind::Clouds => clouds(job, &tolerance, looks.as_mut())?,
    };
    let checks = match &job.expect {
        Some(expect) => {
            Some(check_limits(&comparison, &expect.limits).map_err(|e| expect.error(&e.to_string()))?)
        }
        None => None,
    };
    let mut outcome = Outcome { comparison, checks, page_bytes: None };
    if let Some((path, looks)) = job.page.as_deref().zip(looks) {
        outcome.page_bytes = Some(page::write(job, &outcome, &looks, path)?);
    }
    Ok(outcome)
}

/// What a file holds by its first bytes, or else by its name; folders hold depth maps.
fn kind_of(path: &Path) -> Result<Kind> {
    if path.is_dir() {
        return Ok(Kind::DepthMaps);
    }
    let name = packed::unpacked_name(path);
    let extension = name.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    match (packed::read_head(path, 4)?.as_slice(), extension.as_str()) {
        ([b'M', b'V', b'S', b'I' | 0], _) => Ok(Kind::Scenes),
        ([b'D', b'R' | b'2', ..], _) => Ok(Kind::DepthMaps),
        ([b'p', b'l', b'y', b'\n' | b'\r'], _) => Ok(Kind::Clouds),
        (_, "mvs") => Ok(Kind::Scenes),
        (_, "dmap") => Ok(Kind::DepthMaps),
        (_, "ply") => Ok(Kind::Clouds),
        _ => Err(Error::content(
            path,
            "neither a scene (.mvs) nor a depth map (.dmap) nor a cloud (.ply): cannot be compared",
        )),
    }
}

fn scenes(job: &CompareJob, tolerance: &Tolerance) -> Result<Comparison> {
    let (a, b) = (read::scene(&job.a)?, read::scene(&job.b)?);
    let (figures, notes, first) = compare_scenes(&a, &b, tolerance)?;
    Ok(Comparison { kind: Kind::Scenes, figures, notes, first, parts: Vec::new() })
}

fn clouds(job: &CompareJob, tolerance: &Tolerance, looks: Option<&mut Looks>) -> Result<Comparison> {
    let (a, b) = (read::cloud(&job.a)?, read::cloud(&job.b)?);
    let cameras = job.scene.as_deref().map(read::calibrations).transpose()?;
    let compared = compare_clouds(&a, &b, cameras.as_deref(), tolerance)?;
    if let Some(looks) = looks {
        looks.clouds = Some((a, b));
    }
    Ok(Comparison {
        kind: Kind::Clouds,
        figures: compared.figures(),
        notes: compared.notes(),
        first: compared.first,
        parts: Vec::new(),
    })
}

fn depth_maps(job: &CompareJob, tolerance: &Tolerance, mut looks: Option<&mut Looks>) -> Result<Comparison> {
    let (pairs, only_a, only_b) = pairs(job)?;
    let mut parts = Vec::new();
    for (name, a, b) in &pairs {
        let [map_a, map_b] = [a, b].map(|path| packed::read_map(path, &Limits::default()));
        let (map_a, map_b) = (map_a?, map_b?);
        let compared =
            compare_maps(&map_a, &map_b, tolerance).map_err(|e| Error::content(a, e.to_string()))?;
        if let Some(looks) = &mut looks {
            looks.pairs.extend(SmallPair::new(&map_a, &map_b, pairs.len()));
        }
        let (figures, notes) = (compared.figures(), compared.notes());
        parts.push(Part { name: name.clone(), figures, notes, first: compared.first });
    }
    let only = |which: &str, names: Vec<String>| {
        names.into_iter().map(move |n| format!("only in {which}: {n}")).collect::<Vec<_>>()
    };
    Ok(Comparison {
        kind: Kind::DepthMaps,
        figures: folder_figures(pairs.len(), only_a.len(), only_b.len()),
        notes: only("A", only_a).into_iter().chain(only("B", only_b)).collect(),
        first: None,
        parts,
    })
}

/// Name and files of every pair, and the names that only one folder has.
type Pairs = (Vec<(String, PathBuf, PathBuf)>, Vec<String>, Vec<String>);

/// The two files, or the files of the two folders paired by name.
fn pairs(job: &CompareJob) -> Result<Pairs> {
    if !job.a.is_dir() {
        let name =
            packed::unpacked_name(&job.a).file_name().unwrap_or_default().to_string_lossy().into_owned();
        return Ok((vec![(name, job.a.clone(), job.b.clone())], Vec::new(), Vec::new()));
    }
    let (a, mut b) = (maps_of(&job.a)?, maps_of(&job.b)?);
    let (mut pairs, mut only_a) = (Vec::new(), Vec::new());
    for (name, path) in a {
        match b.remove(&name) {
            Some(other) => pairs.push((name, path, other)),
            None => only_a.push(name),
        }
    }
    if pairs.is_empty() {
        let what = format!("none of its depth maps has its name in {}: nothing to compare", job.b.display());
        return Err(Error::content(&job.a, what));
    }
    Ok((pairs, only_a, b.into_keys().collect()))
}

/// The depth maps of a folder by name, `.zst` left out.
fn maps_of(folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let failed = |e| Error::io(folder, "list", e);
    let mut maps = BTreeMap::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = packed::unpacked_name(&path);
        if name.extension().is_some_and(|e| e == "dmap") && path.is_file() {
            let name = name.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if let Some(other) = maps.insert(name, path.clone()) {
                let what = format!("is the same map as {}; keep one of them", other.display());
                return Err(Error::content(&path, what));
            }
        }
    }
    if maps.is_empty() {
        return Err(Error::content(folder, "no depth map (.dmap) in this folder"));
    }
    Ok(maps)
}
