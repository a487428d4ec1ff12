//! Which depths have the class of their pixel against them.

use crate::geometry::Camera;
use crate::report::{PageView, RunReport};
use crate::scene::{ColorImage, DepthEstimate, DepthMap, Grid, LabelMap};
use crate::semantics::{ClassId, ConsensusOptions, Witness, border_distance, label_consensus};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};

/// Views that a view is held against.
const MOST_OTHERS: usize = 12;

/// What is kept of a view, at the size of its picture.
pub(super) struct SmallView {
    pub(super) camera: Camera,
    pub(super) depth: DepthMap,
    /// Its label map, if there is one.
    pub(super) labels: Option<LabelMap>,
    pub(super) photograph: Option<ColorImage>,
}

impl SmallView {
    /// The depths of `map` at the size of `depth`, its camera relative to `origin`.
    pub(super) fn new(map: &DepthEstimate, depth: DepthMap, origin: &Vector3<f64>) -> Self {
        let camera = map.camera.scaled_per_axis(depth.size()).moved(&-origin);
        SmallView { camera, depth, labels: None, photograph: None }
    }
}

/// Whether the run that `run` tells of compared classes; one that tells nothing may have.
pub(super) fn is_wanted(run: &RunReport) -> bool {
    run.options.get("label-consistency").and_then(|value| value.as_str()) != Some("off")
}

/// For every view with labels the pixels whose depth has a class that is not kept, or another class than the views it was
/// matched with see there by majority; `None` for views without labels or without company.
pub(super) fn against_their_class(
    views: &[PageView],
    small: &[Option<SmallView>],
    run: &RunReport,
) -> Vec<Option<Grid<bool>>> {
    let unwanted: BTreeSet<u16> = run.classes.iter().filter(|row| !row.kept).map(|row| row.id).collect();
    let places: HashMap<u32, usize> = views.iter().enumerate().map(|(i, view)| (view.id, i)).collect();
    let borders: Vec<Option<Grid<u8>>> = small
        .par_iter()
        .map(|view| {
            Some(border_distance(view.as_ref()?.labels.as_ref()?, ConsensusOptions::default().border))
        })
        .collect();
    let witness = |i: usize| {
        let view = small[i].as_ref()?;
        let (labels, border_distance) = (view.labels.as_ref()?, borders[i].as_ref()?);
        Some(Witness { camera: &view.camera, depth: &view.depth, labels, border_distance })
    };
    let marked = |i: usize| {
        let own = witness(i)?;
        let sources = views[i].sources.iter().take(MOST_OTHERS);
        let others: Vec<Witness<'_>> =
            sources.filter_map(|id| places.get(id)).filter_map(|&k| witness(k)).collect();
        if others.is_empty() {
            return None;
        }
        let silent = LabelMap::filled(own.labels.size(), ClassId::VOID.0);
        let vote =
            label_consensus(&Witness { labels: &silent, ..own }, &others, &ConsensusOptions::default());
        let mut marks = Grid::filled(own.labels.size(), false);
        let pixels = own.depth.data().iter().zip(own.labels.data()).zip(vote.labels.data());
        for (mark, ((&depth, &label), &vote)) in marks.data_mut().iter_mut().zip(pixels) {
            let is_contradicted = label != 0 && vote != 0 && vote != label;
            *mark = depth > 0.0 && (is_contradicted || unwanted.contains(&label));
        }
        Some(marks)
    };
    (0..views.len()).into_par_iter().map(marked).collect()
}

/// Share of the depths that are marked.
pub(super) fn share(marks: &Grid<bool>, depth: &DepthMap) -> f64 {
    let depths = depth.data().iter().filter(|d| **d > 0.0).count();
    marks.data().iter().filter(|mark| **mark).count() as f64 / depths.max(1) as f64
}
