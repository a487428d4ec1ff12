//! What decides the bytes of every depth map, as digests: two maps with the same key are the same map.

use super::filter::neighbors_of_filter;
use super::filter_job::FilterJob;
use super::prepare::Prepared;
use super::problem::sparse_points;
use super::skip::{Labels, planar, skipped};
use crate::error::Result;
use crate::geometry::Camera;
use crate::scene::{SparsePoint, ViewIndex};
use crate::semantics::LabelEstimation;
use crate::stereo::StereoOptions;
use crate::store::digest::{Digest, Digester};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// To be raised whenever the same input gives other depth maps than before.
const REVISION: u64 = 5;

/// What maps are made by.
#[derive(Clone, Copy)]
pub(super) struct Recipe<'a> {
    pub(super) prepared: &'a Prepared,
    pub(super) options: &'a StereoOptions,
    pub(super) filter: &'a FilterJob,
}

impl Recipe<'_> {
    /// Geometric passes.
    pub(super) fn passes(&self) -> u32 {
        self.options.geometric_iterations
    }

    /// Number of the last stage: 0 is photometric estimation, then come the geometric passes, then the filter across
    /// views if there is one.
    pub(super) fn last(&self) -> u32 {
        self.passes() + u32::from(self.filter.across.is_some())
    }

    /// Whether maps are cleaned of speckles or gaps.
    pub(super) fn cleans(&self) -> bool {
        self.filter.speckles || self.filter.gaps || self.removes_scraps()
    }

    fn removes_scraps(&self) -> bool {
        self.filter.scraps().is_some() && self.prepared.leaves_pixels_out()
    }

    fn matched(&self, view: ViewIndex) -> bool {
        !self.prepared.neighbors[view.index()].matching().is_empty()
    }

    /// Whether `stage` makes a map of `view`; else the one of the stage before, or the one that is `given`, stays.
    pub(super) fn makes(&self, view: ViewIndex, stage: u32, given: bool) -> bool {
        match stage {
            0 => !given || (self.passes() == 0 && self.cleans()),
            pass if pass <= self.passes() => self.matched(view),
            _ => true,
        }
    }

    /// Whose maps of the stage before `stage`, which makes a map of `view`, reads; `views` are all that have maps.
    pub(super) fn inputs(&self, view: ViewIndex, stage: u32, views: &[ViewIndex]) -> Vec<ViewIndex> {
        let mut inputs = vec![view];
        if (1..=self.passes()).contains(&stage) {
            let sources = self.prepared.neighbors[view.index()].matching().iter().map(|n| n.view);
            inputs.extend(sources.filter(|&v| self.matched(v) && views.binary_search(&v).is_ok()));
        } else if let Some(across) = self.filter.across.as_ref().filter(|_| stage > self.passes()) {
            inputs.extend(neighbors_of_filter(self.prepared, view, across, views));
        }
        inputs
    }
}

/// What a view's maps are made from.
#[derive(Clone, Debug, Default)]
pub(super) struct Ingredients {
    /// Digests by name.
    pub(super) from: BTreeMap<String, Digest>,
    /// The key of the map after every stage.
    pub(super) keys: Vec<Digest>,
}

/// The ingredients of the maps of `views`, in their order; those of `given` are not estimated but are there, with these
/// bytes.
///
/// # Errors
/// An image, a mask or a label map cannot be read.
pub(super) fn ingredients(
    recipe: Recipe<'_>,
    views: &[ViewIndex],
    given: &BTreeMap<ViewIndex, Digest>,
) -> Result<Vec<Ingredients>> {
    let images = recipe
        .prepared
        .views()
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|view| Ok((view, Digest::of_file(recipe.prepared.images.path(view))?)))
        .collect::<Result<BTreeMap<ViewIndex, Digest>>>()?;
    let mut all = views
        .par_iter()
        .map(|&view| {
            let mut from = common(recipe);
            if let Some(&content) = given.get(&view) {
                from.insert("depth map".to_owned(), content);
            }
            if !given.contains_key(&view) || recipe.passes() > 0 && recipe.matched(view) {
                enter_problem(recipe, view, &images, &mut from)?;
            }
            if recipe.filter.across.is_some() {
                enter_filter(recipe, view, &mut from)?;
            }
            Ok(Ingredients { from, keys: Vec::new() })
        })
        .collect::<Result<Vec<Ingredients>>>()?;
    for stage in 0..=recipe.last() {
        let keys: Vec<Digest> = (0..views.len()).map(|i| key(recipe, views, &all, given, i, stage)).collect();
        all.iter_mut().zip(keys).for_each(|(ingredients, key)| ingredients.keys.push(key));
    }
    Ok(all)
}

/// The key of view number `i` after `stage`.
fn key(
    recipe: Recipe<'_>,
    views: &[ViewIndex],
    all: &[Ingredients],
    given: &BTreeMap<ViewIndex, Digest>,
    i: usize,
    stage: u32,
) -> Digest {
    let (view, own) = (views[i], &all[i]);
    if stage > 0 && !recipe.makes(view, stage, given.contains_key(&view)) {
        return own.keys[stage as usize - 1];
    }
    // The filters count for nothing before the stage that they are part of.
    let is_filter = stage > recipe.passes();
    let counts = |name: &str| match name {
        CLEANING => stage == recipe.passes(),
        FILTER => is_filter,
        _ => !is_filter,
    };
    Digest::of(|d| {
        d.number(u64::from(stage));
        for (name, digest) in own.from.iter().filter(|(name, _)| counts(name)) {
            d.text(name).digest(*digest);
        }
        if stage > 0 {
            for input in recipe.inputs(view, stage, views) {
                let at = views.binary_search(&input).ok();
                d.number(u64::from(recipe.prepared.id(input).0));
                if let Some(at) = at {
                    d.digest(all[at].keys[stage as usize - 1]);
                }
            }
        }
    })
}

const CLEANING: &str = "removal of speckles and gaps";
const FILTER: &str = "filter across views";

/// What all maps have in common.
fn common(recipe: Recipe<'_>) -> BTreeMap<String, Digest> {
    let program = Digest::of(|d| {
        d.text(env!("CARGO_PKG_VERSION")).number(REVISION);
    });
    let FilterJob { speckles, gaps, options, .. } = recipe.filter;
    let options = format!("{speckles} {gaps} {options:?} {}", recipe.removes_scraps());
    [("program version", program), ("estimation options", of_text(&format!("{:?}", recipe.options)))]
        .into_iter()
        .chain([(CLEANING, of_text(&options))])
        .map(|(name, digest)| (name.to_owned(), digest))
        .collect()
}

fn of_text(text: &str) -> Digest {
    of_bytes(text.as_bytes())
}

fn of_bytes(bytes: &[u8]) -> Digest {
    Digest::of(|d| {
        d.bytes(bytes);
    })
}

/// Enters what the estimator gets to know about a view.
fn enter_problem(
    recipe: Recipe<'_>,
    view: ViewIndex,
    images: &BTreeMap<ViewIndex, Digest>,
    from: &mut BTreeMap<String, Digest>,
) -> Result<()> {
    let prepared = recipe.prepared;
    let camera = prepared.camera(view)?;
    let image = |d: &mut Digester, view: ViewIndex| {
        d.text(&prepared.loaded.scene.views[view.index()].name);
        if let Some(&image) = images.get(&view) {
            d.digest(image);
        }
    };
    let neighbors = prepared.neighbors[view.index()].matching();
    let mut sources = Digester::new();
    let mut source_images = Digester::new();
    for neighbor in neighbors {
        sources.number(u64::from(prepared.id(neighbor.view).0)).number(u64::from(neighbor.scale.to_bits()));
        enter_camera(&mut sources, prepared.camera(neighbor.view)?);
        image(&mut source_images, neighbor.view);
    }
    let (points, range) = sparse_points(prepared, view, camera);
    let skip = skipped(view, camera.size(), prepared.masks.as_ref(), prepared.labels.as_ref())?;
    let skip: Vec<u8> = skip.iter().flat_map(|skip| skip.data()).map(|&skip| u8::from(skip)).collect();
    let regions = planar(view, camera.size(), prepared.masks.as_ref(), prepared.labels.as_ref())?;
    let entries = [
        ("image", Digest::of(|d| image(d, view))),
        ("camera or size", Digest::of(|d| enter_camera(d, camera))),
        ("neighbours", sources.finish()),
        ("images of neighbours", source_images.finish()),
        ("sparse points", Digest::of(|d| enter_points(d, &points, range))),
        ("masks or labels", of_bytes(&skip)),
        ("planar regions", of_text(&format!("{regions:?}"))),
    ];
    from.extend(entries.map(|(name, digest)| (name.to_owned(), digest)));
    if let Some(labels) = &prepared.labels
        && let LabelEstimation::Aware { cost } = labels.rules().estimation
    {
        let mut digester = Digester::new();
        digester.number(u64::from(cost.to_bits()));
        for view in std::iter::once(view).chain(neighbors.iter().map(|n| n.view)) {
            enter_labels(&mut digester, prepared, labels, view)?;
        }
        from.insert("classes of pixels".to_owned(), digester.finish());
    }
    Ok(())
}

/// Enters what the filter across views gets to know beside maps.
fn enter_filter(recipe: Recipe<'_>, view: ViewIndex, from: &mut BTreeMap<String, Digest>) -> Result<()> {
    let (prepared, filter) = (recipe.prepared, recipe.filter);
    let mut digester = Digester::new();
    digester.text(&format!("{:?} {:?}", filter.across, filter.options)).number(prepared.count() as u64);
    if let Some(labels) = prepared.labels.as_ref().filter(|labels| labels.rules().filter)
        && let Some(across) = &filter.across
    {
        let everyone: Vec<ViewIndex> = prepared.views().collect();
        let others = neighbors_of_filter(prepared, view, across, &everyone);
        for view in std::iter::once(view).chain(others) {
            enter_labels(&mut digester, prepared, labels, view)?;
        }
    }
    from.insert(FILTER.to_owned(), digester.finish());
    Ok(())
}

/// Enters the classes of a view's pixels as they are compared.
fn enter_labels(d: &mut Digester, prepared: &Prepared, labels: &Labels, view: ViewIndex) -> Result<()> {
    let (map, checked) = labels.maps(view, prepared.camera(view)?.size())?;
    let ids: Vec<u8> = checked.unwrap_or(map).data().iter().flat_map(|id| id.to_le_bytes()).collect();
    d.bytes(&ids);
    Ok(())
}

fn enter_camera(d: &mut Digester, camera: &Camera) {
    d.number(u64::from(camera.size().width)).number(u64::from(camera.size().height));
    d.reals(camera.k().iter()).reals(camera.rotation().iter()).reals(camera.center().iter());
}

fn enter_points(d: &mut Digester, points: &[SparsePoint], range: (f32, f32)) {
    d.reals(&[f64::from(range.0), f64::from(range.1)]).number(points.len() as u64);
    for SparsePoint { x, y, depth, normal } in points {
        d.reals(&[*x, *y, *depth].map(f64::from)).number(u64::from(normal.is_some()));
        d.reals(&normal.unwrap_or_default().map(f64::from));
    }
}
