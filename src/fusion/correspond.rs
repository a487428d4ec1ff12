//! First pass over a row of the reference view: where do its free pixels fall in the neighbours, and what is
//! there? Reads only what cannot change while the view has its turn, so rows are independent.

use super::FusionMaps;
use super::state::FreePixels;
use crate::geometry::{Lens, is_similar_depth};
use crate::scene::{LabelMap, ViewIndex};
use crate::semantics::{Agreement, ClassPolicy};

/// A view that takes part in a step: its maps as plain slices.
pub(super) struct Participant<'a> {
    pub(super) view: ViewIndex,
    pub(super) lens: Lens,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) depth: &'a [f32],
    pub(super) normal: Option<&'a [[f32; 3]]>,
    pub(super) confidence: Option<&'a [f32]>,
    pub(super) color: Option<&'a [[u8; 3]]>,
    labels: Option<&'a [u16]>,
    checked_labels: Option<&'a [u16]>,
}

impl<'a> Participant<'a> {
    /// `use_normals` is false where any map lacks them: then all pixels count as facing the same way.
    pub(super) fn new(view: ViewIndex, maps: &'a FusionMaps, use_normals: bool) -> Self {
        fn data(labels: &LabelMap) -> &[u16] {
            labels.data()
        }
        let size = maps.size();
        let labels = maps.labels.as_deref().map(data);
        Participant {
            view,
            lens: Lens::new(&maps.estimate.camera),
            width: size.width,
            height: size.height,
            depth: maps.estimate.depth.data(),
            normal: maps.estimate.normal.as_ref().filter(|_| use_normals).map(|n| n.data()),
            confidence: maps.estimate.confidence.as_ref().map(|c| c.data()),
            color: maps.color.as_deref().map(|c| c.data()),
            labels,
            checked_labels: maps.checked_labels.as_deref().map(data).or(labels),
        }
    }

    /// World normal of a pixel; the same for all without normals.
    #[inline]
    pub(super) fn normal_in_world(&self, pixel: usize) -> [f32; 3] {
        self.normal.map_or([0.0, 0.0, -1.0], |n| self.lens.world_direction(n[pixel]))
    }

    /// Weight of a pixel in a point: grows with its confidence, falls with the square of its depth.
    #[inline]
    pub(super) fn weight(&self, pixel: usize) -> f32 {
        let confidence = self.confidence.map_or(1.0, |c| c[pixel]);
        let depth = self.depth[pixel];
        1.0 / ((1.0 - confidence).max(0.03) * depth * depth)
    }

    /// Class of a pixel, 0 without labels.
    #[inline]
    pub(super) fn label(&self, pixel: usize) -> u16 {
        self.labels.map_or(0, |l| l[pixel])
    }

    /// Class of a pixel as the consistency check sees it.
    #[inline]
    fn checked_label(&self, pixel: usize) -> u16 {
        self.checked_labels.map_or(0, |l| l[pixel])
    }
}

/// When two pixels belong together.
pub(super) struct Matching<'a> {
    pub(super) max_depth_diff: f32,
    pub(super) min_cos_normal: f32,
    /// `None`: labels take no part.
    pub(super) policy: Option<&'a ClassPolicy>,
}

/// What a neighbour has where a reference pixel falls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Relation {
    /// The same surface.
    Agrees,
    /// The same surface, but another class.
    Dissents,
    /// Another surface behind the reference's point, which would hide it.
    Behind,
}

/// A pixel of a neighbour and its relation in 32 bits; 0 = nothing of interest.
#[derive(Clone, Copy, Debug, Default)]
struct Correspondence(u32);

impl Correspondence {
    fn new(relation: Relation, pixel: u32) -> Self {
        Correspondence((relation as u32 + 1) << 30 | pixel)
    }

    #[inline]
    fn get(self) -> Option<(Relation, u32)> {
        let relation = match self.0 >> 30 {
            0 => return None,
            1 => Relation::Agrees,
            2 => Relation::Dissents,
            _ => Relation::Behind,
        };
        Some((relation, self.0 & ((1 << 30) - 1)))
    }
}

/// The free pixels of one row with their points, and what every neighbour has there.
#[derive(Default)]
pub(super) struct RowMatches {
    /// Columns, ascending.
    pub(super) columns: Vec<u32>,
    /// World points of those pixels.
    pub(super) points: Vec<[f32; 3]>,
    /// Neighbour by neighbour, one entry per column each.
    correspondences: Vec<Correspondence>,
    normals: Vec<[f32; 3]>,
    coordinates: [Vec<f64>; 3],
    projected: Vec<(u32, f32)>,
}

/// "Outside the image" among projected pixels.
const OUTSIDE: u32 = u32::MAX;

impl RowMatches {
    /// Fills in row `y` of `views[0]` against the other views; `free` is parallel to `views`.
    pub(super) fn compute(
        &mut self,
        views: &[Participant<'_>],
        free: &[FreePixels],
        y: u32,
        matching: &Matching<'_>,
    ) {
        let (Some((reference, neighbors)), Some((own_free, others_free))) =
            (views.split_first(), free.split_first())
        else {
            return;
        };
        self.start_row(reference, own_free, y, matching);
        for (neighbor, free) in neighbors.iter().zip(others_free) {
            self.project(neighbor);
            for (i, &(pixel, depth)) in self.projected.iter().enumerate() {
                let found = if pixel == OUTSIDE || !free.contains(pixel) {
                    Correspondence::default()
                } else {
                    let own = y as usize * reference.width as usize + self.columns[i] as usize;
                    let normal = self.normals[i];
                    match relation(matching, reference, own, normal, neighbor, pixel as usize, depth) {
                        Some(relation) => Correspondence::new(relation, pixel),
                        None => Correspondence::default(),
                    }
                };
                self.correspondences.push(found);
            }
        }
    }

    /// What neighbour `neighbor` (0 = first after the reference) has for the `i`-th column.
    #[inline]
    pub(super) fn get(&self, neighbor: usize, i: usize) -> Option<(Relation, u32)> {
        self.correspondences[neighbor * self.columns.len() + i].get()
    }

    fn start_row(&mut self, reference: &Participant<'_>, free: &FreePixels, y: u32, matching: &Matching<'_>) {
        self.columns.clear();
        self.points.clear();
        self.normals.clear();
        self.correspondences.clear();
        self.coordinates.iter_mut().for_each(Vec::clear);
        let start = y as usize * reference.width as usize;
        for pixel in free.in_range(start, start + reference.width as usize) {
            if matching.policy.is_some_and(|policy| !policy.is_candidate(reference.label(pixel))) {
                continue;
            }
            let x = (pixel - start) as u32;
            let point = reference.lens.world_point(x, y, reference.depth[pixel]).map(|v| v as f32);
            self.columns.push(x);
            self.points.push(point);
            self.normals.push(reference.normal_in_world(pixel));
            for (coordinates, v) in self.coordinates.iter_mut().zip(point) {
                coordinates.push(f64::from(v));
            }
        }
    }

    /// Pixel and depth of all points in `neighbor`, [`OUTSIDE`] where it does not see them.
    fn project(&mut self, neighbor: &Participant<'_>) {
        let [xs, ys, zs] = &self.coordinates;
        let p = &neighbor.lens.projection;
        let (width, height) = (neighbor.width as f32, neighbor.height as f32);
        self.projected.clear();
        self.projected.extend(xs.iter().zip(ys).zip(zs).map(|((x, y), z)| {
            let [u, v, depth] = [0, 1, 2].map(|i| (p[i][0] * x + p[i][1] * y + p[i][2] * z + p[i][3]) as f32);
            // Truncation equals rounding down where it matters: negative values are outside.
            let (u, v) = (u / depth + 0.5, v / depth + 0.5);
            let inside = (depth > 0.0) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height);
            let pixel = (v as u32).wrapping_mul(neighbor.width).wrapping_add(u as u32);
            (if inside { pixel } else { OUTSIDE }, depth)
        }));
    }
}

#[inline]
fn relation(
    matching: &Matching<'_>,
    reference: &Participant<'_>,
    own: usize,
    normal: [f32; 3],
    neighbor: &Participant<'_>,
    pixel: usize,
    depth: f32,
) -> Option<Relation> {
    let other_depth = neighbor.depth[pixel];
    let same_surface = is_similar_depth(depth, other_depth, matching.max_depth_diff) && {
        neighbor.normal.is_none() || {
            let other = neighbor.normal_in_world(pixel);
            normal[0] * other[0] + normal[1] * other[1] + normal[2] * other[2] > matching.min_cos_normal
        }
    };
    if !same_surface {
        return (depth < other_depth).then_some(Relation::Behind);
    }
    let agreement = matching.policy.map_or(Agreement::Agrees, |policy| {
        policy.agreement(reference.checked_label(own), neighbor.checked_label(pixel))
    });
    Some(match agreement {
        Agreement::Agrees => Relation::Agrees,
        Agreement::Differs => Relation::Dissents,
    })
}
