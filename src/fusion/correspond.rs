//! First pass over a row of the reference view: where do its free pixels fall in the neighbours, and what is
//! there? Reads only what cannot change while the view has its turn, so rows are independent.

use super::participant::{Participant, Pixel};
use super::state::PixelStates;
use crate::geometry::is_similar_depth;
use crate::semantics::{Agreement, ClassPolicy};

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

/// The free pixels of one row, and what every neighbour has there.
#[derive(Default)]
pub(super) struct RowMatches {
    /// Columns, ascending.
    pub(super) columns: Vec<u32>,
    /// Neighbour by neighbour, one entry per column each.
    correspondences: Vec<Correspondence>,
}

/// What the search for correspondences needs on the way, reused from row to row.
#[derive(Default)]
pub(super) struct RowScratch {
    /// World normals of the row's free pixels.
    normals: Vec<[f32; 3]>,
    /// Their world points, rounded to `f32`.
    points: [Vec<f64>; 3],
    /// Where they fall in a neighbour: pixel, and depth there.
    pixels: Vec<u32>,
    depths: Vec<f32>,
}

/// "Outside the image" among projected pixels.
const OUTSIDE: u32 = u32::MAX;

impl RowMatches {
    /// Fills in row `y` of `views[0]` against the other views; `states` are parallel to `views` and may be from
    /// before: a pixel that no longer supports others is found to be taken when points are made.
    pub(super) fn compute(
        &mut self,
        scratch: &mut RowScratch,
        views: &[Participant<'_>],
        states: &[PixelStates],
        y: u32,
        matching: &Matching<'_>,
    ) {
        let (Some((reference, neighbors)), Some((own_states, others_states))) =
            (views.split_first(), states.split_first())
        else {
            return;
        };
        self.start_row(scratch, reference, own_states, y, matching);
        self.correspondences.reserve_exact(self.columns.len() * neighbors.len());
        for (neighbor, states) in neighbors.iter().zip(others_states) {
            scratch.project(neighbor);
            let row = y as usize * reference.width as usize;
            let projected = scratch.pixels.iter().zip(&scratch.depths).zip(&scratch.normals);
            let found = projected.zip(&self.columns).map(|(((&pixel, &depth), &normal), &x)| {
                if pixel == OUTSIDE || !states.supports(pixel) {
                    return Correspondence::default();
                }
                let own = row + x as usize;
                match relation(matching, reference, own, normal, neighbor, pixel as usize, depth) {
                    Some(relation) => Correspondence::new(relation, pixel),
                    None => Correspondence::default(),
                }
            });
            self.correspondences.extend(found);
        }
    }

    /// What neighbour `neighbor` (0 = first after the reference) has for the `i`-th column.
    #[inline]
    pub(super) fn get(&self, neighbor: usize, i: usize) -> Option<(Relation, u32)> {
        self.correspondences[neighbor * self.columns.len() + i].get()
    }

    fn start_row(
        &mut self,
        scratch: &mut RowScratch,
        reference: &Participant<'_>,
        states: &PixelStates,
        y: u32,
        matching: &Matching<'_>,
    ) {
        self.columns.clear();
        self.correspondences.clear();
        scratch.normals.clear();
        scratch.points.iter_mut().for_each(Vec::clear);
        let start = y as usize * reference.width as usize;
        for pixel in states.free_in_range(start, start + reference.width as usize) {
            if matching.policy.is_some_and(|policy| !policy.is_candidate(reference.label(pixel))) {
                continue;
            }
            let x = (pixel - start) as u32;
            self.columns.push(x);
            let Pixel { depth, normal, .. } = reference.pixels[pixel];
            scratch.normals.push(normal);
            let point = reference.lens.world_point(x, y, depth);
            for (coordinates, v) in scratch.points.iter_mut().zip(point) {
                coordinates.push(f64::from(v as f32));
            }
        }
    }
}

impl RowScratch {
    /// Pixel and depth of all points in `neighbor`, [`OUTSIDE`] where it does not see them.
    fn project(&mut self, neighbor: &Participant<'_>) {
        let [xs, ys, zs] = &self.points;
        let p = &neighbor.lens.projection;
        let (width, height) = (neighbor.width as f32, neighbor.height as f32);
        self.pixels.resize(xs.len(), 0);
        self.depths.resize(xs.len(), 0.0);
        let out = self.pixels.iter_mut().zip(&mut self.depths);
        for ((out_pixel, out_depth), ((x, y), z)) in out.zip(xs.iter().zip(ys).zip(zs)) {
            let [u, v, depth] = [0, 1, 2].map(|i| (p[i][0] * x + p[i][1] * y + p[i][2] * z + p[i][3]) as f32);
            // Truncation equals rounding down where it matters: negative values are outside.
            let (u, v) = (u / depth + 0.5, v / depth + 0.5);
            let inside = (depth > 0.0) & (u >= 0.0) & (v >= 0.0) & (u < width) & (v < height);
            let pixel = (v as i32 as u32).wrapping_mul(neighbor.width).wrapping_add(u as i32 as u32);
            *out_pixel = if inside { pixel } else { OUTSIDE };
            *out_depth = depth;
        }
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
    let Pixel { depth: other_depth, normal: other, .. } = neighbor.pixels[pixel];
    let cos = normal[0] * other[0] + normal[1] * other[1] + normal[2] * other[2];
    let same_surface = is_similar_depth(depth, other_depth, matching.max_depth_diff)
        && (!neighbor.has_normals || cos > matching.min_cos_normal);
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
