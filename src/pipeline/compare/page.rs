//! The page about a comparison.

use super::pictures::{SmallPair, pictures};
use super::points::compared_points;
use super::{CompareJob, Outcome};
use crate::error::{Error, Result};
use crate::report::{ComparisonPage, PageCheck, PagePair, build};
use crate::scene::PointCloud;
use crate::store::atomic::write_file;
use std::path::Path;

/// What a page shows besides the numbers.
#[derive(Default)]
pub(super) struct Looks {
    /// Every pair of depth maps, in the order of the comparison's parts.
    pub(super) pairs: Vec<SmallPair>,
    /// Both clouds.
    pub(super) clouds: Option<(PointCloud, PointCloud)>,
}

/// Writes the page about `outcome` to `path`; its size in bytes.
///
/// # Errors
/// The place cannot be written.
pub(super) fn write(job: &CompareJob, outcome: &Outcome, looks: &Looks, path: &Path) -> Result<usize> {
    let comparison = &outcome.comparison;
    let (layers, mut scales) = pictures(&looks.pairs)?;
    let points = looks.clouds.as_ref().and_then(|(a, b)| compared_points(a, b));
    let (cloud, packed) = match points {
        Some(points) => {
            scales.distance = points.distance;
            (Some(points.cloud), points.packed)
        }
        None => (None, Vec::new()),
    };
    let parts =
        comparison.parts.iter().zip(&looks.pairs).zip(layers).map(|((part, pair), layers)| PagePair {
            name: part.name.clone(),
            size: [pair.full.width, pair.full.height],
            figures: (&part.figures).into(),
            notes: part.notes.clone(),
            first: part.first.clone(),
            layers,
        });
    let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let page = ComparisonPage {
        title: format!("{} against {}", name(&job.a), name(&job.b)),
        a: job.a.display().to_string(),
        b: job.b.display().to_string(),
        kind: comparison.kind.name(),
        version: build(),
        figures: (&comparison.figures).into(),
        checks: outcome.checks.as_ref().map(|checks| checks.iter().map(PageCheck::from).collect()),
        notes: comparison.notes.clone(),
        first: comparison.first.clone(),
        parts: parts.collect(),
        scales,
        cloud,
        ..ComparisonPage::default()
    };
    let text = page.render(&packed).map_err(|e| Error::content(path, format!("no JSON: {e}")))?;
    write_file(path, text.as_bytes())?;
    Ok(text.len())
}
