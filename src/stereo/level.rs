//! One resolution of a stereo problem: the reference, the sources and the maps between them.

use super::plane::Pinhole;
use super::problem::StereoProblem;
use super::source_planes::SourcePlanes;
use super::texels::{Texels, halved};
use super::tile::{REACH, Row, TILE_W, WIN_W};
use crate::geometry::{Camera, Size};
use crate::scene::{GrayImage, LabelMap};
use crate::semantics::nearest_labels;
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Pixels around an image that tiles may reach into.
pub(crate) const PAD: usize = 32;
/// Mid-grey, subtracted so that sums of squares keep their digits.
const MID_GREY: f32 = 128.0;
/// Steps per grey level of the reference.
pub(crate) const STEPS: f32 = 64.0;
/// Largest side of an image, in pixels.
pub(crate) const MAX_SIDE: u32 = 32_767;

/// The reference image with a margin: whole numbers of 1/64 grey levels, 0..255 minus mid-grey.
pub(crate) struct Reference {
    stride: usize,
    data: Vec<f32>,
}

impl Reference {
    fn new(gray: &GrayImage) -> Self {
        let (w, h) = (gray.width(), gray.height());
        let stride = w + 2 * PAD;
        let mut data = Vec::with_capacity(stride * (h + 2 * PAD));
        for y in 0..h + 2 * PAD {
            let row = gray.row(y.saturating_sub(PAD).min(h - 1));
            for x in 0..stride {
                let level = row[x.saturating_sub(PAD).min(w - 1)].clamp(0.0, 1.0) * 255.0 - MID_GREY;
                data.push((level * STEPS).floor());
            }
        }
        Reference { stride, data }
    }

    /// `n` grey levels from column `x` of row `y`, which may lie up to [`PAD`] outside.
    pub(crate) fn window(&self, x: i32, y: i32, n: usize) -> &[f32] {
        let at = (y + PAD as i32) as usize * self.stride + (x + PAD as i32) as usize;
        &self.data[at..at + n]
    }
}

/// A source image and the projection from (reference pixel, inverse depth) into it.
pub(crate) struct Source {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// As [`Texels::quads`].
    pub(crate) quads: Arc<[u32]>,
    /// As [`Texels::bytes`].
    pub(crate) bytes: Arc<[u8]>,
    /// Homogeneous source pixel = `a · (x, y, 1) + b · w`.
    pub(crate) a: [[f32; 3]; 3],
    pub(crate) b: [f32; 3],
    /// Class of every pixel, if labels are heeded.
    pub(crate) labels: Option<Vec<u32>>,
    /// Planes of the source's own depth map, if the geometric term is on.
    pub(crate) geometry: Option<SourceGeometry>,
}

/// What takes reference pixels and inverse depths into up to sixteen sources, a lane each: `a` and `b` of [`Source`].
pub(crate) struct Transfers {
    pub(crate) a: [[Row; 3]; 3],
    pub(crate) b: [Row; 3],
    /// Last column and row where bilinear samples have all their neighbours and one pixel to spare; below 1 where there is no
    /// such source.
    pub(crate) last: [Row; 2],
}

/// The depth map of a source view as planes of inverse depth, and the way into it.
pub(crate) struct SourceGeometry {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// As [`SourcePlanes::planes`].
    pub(crate) planes: Arc<[u32]>,
    pub(crate) a: [[f32; 3]; 3],
    pub(crate) b: [f32; 3],
    /// Pixels of the reference that one unit of the source's inverse depth amounts to.
    pub(crate) pixels_per_w: f32,
}

/// One resolution of a stereo problem.
pub(crate) struct Level {
    pub(crate) size: Size,
    pub(crate) pinhole: Pinhole,
    pub(crate) reference: Reference,
    pub(crate) sources: Vec<Source>,
    /// Of the first sixteen sources, of the next sixteen, and so on.
    pub(crate) transfers: Vec<Transfers>,
    /// Smallest and largest inverse depth allowed.
    pub(crate) w_range: (f32, f32),
    /// Largest shift in any source, in pixels, per unit of inverse depth, at the image centre.
    pub(crate) pixels_per_w: f32,
    /// How matching windows are weighted.
    pub(crate) weighting: Weighting,
    /// Weight of the geometric term.
    pub(crate) geometric_weight: f32,
    /// Classes of the reference, if labels are heeded.
    pub(crate) labels: Option<LabelMap>,
    /// What a source costs more where it shows another class.
    pub(crate) label_cost: f32,
}

/// Falloffs of a texel's bilateral weight e⁻ˣ (Yoon & Kweon 2006) in a matching window: `x = grey · Δg² + space · Δp²`,
/// with differences to the window's centre in grey levels and in pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weighting {
    pub(crate) grey: f32,
    pub(crate) space: f32,
}

impl Weighting {
    /// While hypotheses are searched for: σ = 17 grey levels, 4.2 pixels. Wide windows find the right plane.
    pub(crate) const SEARCH: Self =
        Weighting { grey: 1.0 / (2.0 * 17.3 * 17.3), space: 1.0 / (2.0 * 4.24 * 4.24) };
    /// Where nothing comes after the search: σ = 17 grey levels, 3 pixels.
    pub(crate) const ALONE: Self =
        Weighting { grey: 1.0 / (2.0 * 17.3 * 17.3), space: 1.0 / (2.0 * 3.0 * 3.0) };
    /// While the neighbours' depth maps help: σ = 12 grey levels, 1.9 pixels. Narrow windows tell depth edges apart.
    pub(crate) const REFINE: Self =
        Weighting { grey: 1.0 / (2.0 * 12.2 * 12.2), space: 1.0 / (2.0 * 1.9 * 1.9) };
}

impl Level {
    /// The problem at full resolution divided by `2^halvings`.
    pub(crate) fn new(problem: &StereoProblem, halvings: u32) -> Self {
        let gray = shrunk(&problem.reference.gray, halvings);
        let camera = at_size(&problem.reference.camera, gray.size());
        let (fx, fy, cx, cy) = camera.intrinsics();
        let pinhole = Pinhole { fx: fx as f32, fy: fy as f32, cx: cx as f32, cy: cy as f32 };
        let w_range = (1.0 / problem.depth_range.1, 1.0 / problem.depth_range.0);
        let w_mid = typical_inverse_depth(problem);
        let mut pixels_per_w = 0.0f32;
        let sources = problem
            .sources
            .iter()
            .enumerate()
            .filter_map(|(i, s)| {
                let Texels { size, quads, bytes } = s.texels.halved(halvings)?;
                let (a, b) = transfer(&camera, &at_size(&s.camera, *size));
                pixels_per_w = pixels_per_w.max(shift_per_w(&a, &b, camera.size(), w_mid));
                Some(Source {
                    width: size.width as usize,
                    height: size.height as usize,
                    quads: quads.clone(),
                    bytes: bytes.clone(),
                    a: rows_f32(&a),
                    b: [b.x as f32, b.y as f32, b.z as f32],
                    labels: problem.labels.as_ref().and_then(|l| ids(l.sources.get(i)?, *size)),
                    geometry: None,
                })
            })
            .collect::<Vec<Source>>();
        Level {
            transfers: sources.chunks(TILE_W).map(Transfers::new).collect(),
            size: camera.size(),
            pinhole,
            reference: Reference::new(&gray),
            sources,
            w_range,
            pixels_per_w: pixels_per_w.max(f32::MIN_POSITIVE),
            geometric_weight: 0.0,
            labels: problem.labels.as_ref().map(|l| nearest_labels(&l.reference, camera.size())),
            label_cost: problem.labels.as_ref().map_or(0.0, |l| l.cost),
            weighting: Weighting::SEARCH,
        }
    }

    /// Adds the sources' own depth maps, so that hypotheses are also compared with them.
    pub(crate) fn with_geometry<'a>(
        mut self,
        reference: &Camera,
        maps: impl Iterator<Item = Option<&'a SourcePlanes>>,
        weight: f32,
    ) -> Self {
        self.geometric_weight = weight;
        self.weighting = Weighting::REFINE;
        for (source, map) in self.sources.iter_mut().zip(maps) {
            source.geometry = map.map(|m| source_geometry(reference, m));
        }
        self
    }
}

/// The classes of `labels` at `size`; `None` if there are none.
fn ids(labels: &LabelMap, size: Size) -> Option<Vec<u32>> {
    let labels = nearest_labels(labels, size);
    (size.area() > 0).then(|| labels.data().iter().map(|&id| u32::from(id)).collect())
}

/// The image divided by `2^halvings`.
fn shrunk(gray: &Arc<GrayImage>, halvings: u32) -> Arc<GrayImage> {
    if halvings == 0 { gray.clone() } else { Arc::new(halved(gray, halvings)) }
}

/// The camera of an image that was halved to `size`.
fn at_size(camera: &Camera, size: Size) -> Camera {
    if camera.size() == size { camera.clone() } else { camera.scaled_per_axis(size) }
}

/// `A = K₁R₁R₀ᵀK₀⁻¹` and `b = K₁R₁(C₀ − C₁)`: the source pixel of a reference pixel at inverse depth w is `A p + b w`.
fn transfer(reference: &Camera, source: &Camera) -> (Matrix3<f64>, Vector3<f64>) {
    let kr = source.k() * source.rotation();
    let inverse_k = inverse_intrinsics(reference);
    (kr * reference.rotation().transpose() * inverse_k, kr * (reference.center() - source.center()))
}

/// Inverse of K without skew: what back-projection uses.
fn inverse_intrinsics(camera: &Camera) -> Matrix3<f64> {
    let (fx, fy, cx, cy) = camera.intrinsics();
    Matrix3::new(1.0 / fx, 0.0, -cx / fx, 0.0, 1.0 / fy, -cy / fy, 0.0, 0.0, 1.0)
}

fn rows_f32(m: &Matrix3<f64>) -> [[f32; 3]; 3] {
    std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)] as f32))
}

/// How far the projection of the image centre moves per unit of inverse depth around `w`.
fn shift_per_w(a: &Matrix3<f64>, b: &Vector3<f64>, size: Size, w: f32) -> f32 {
    let p = Vector3::new(f64::from(size.width) / 2.0, f64::from(size.height) / 2.0, 1.0);
    let q = a * p + b * f64::from(w);
    if q.z.abs() < 1e-12 {
        return 0.0;
    }
    let (u, v) = (q.x / q.z, q.y / q.z);
    (((b.x - u * b.z) / q.z).hypot((b.y - v * b.z) / q.z)) as f32
}

/// Median inverse depth of the sparse points, or the middle of the range.
fn typical_inverse_depth(problem: &StereoProblem) -> f32 {
    let mut w: Vec<f32> = problem.sparse.iter().map(|p| 1.0 / p.depth).collect();
    if w.is_empty() {
        return 0.5 / problem.depth_range.0 + 0.5 / problem.depth_range.1;
    }
    w.sort_unstable_by(f32::total_cmp);
    w[w.len() / 2]
}

impl Source {
    /// The grey level at a pixel, or the nearest one, as a base of [`Lanes::bilinear`].
    ///
    /// [`Lanes::bilinear`]: super::cost::lanes::Lanes::bilinear
    #[inline(always)]
    pub(crate) fn level_at(&self, x: u32, y: u32) -> u32 {
        let (x, y) = ((x as usize).min(self.width - 1), (y as usize).min(self.height - 1));
        let level = self.bytes.get(y * self.width + x).copied().unwrap_or(0) as i8;
        (i32::from(level) * 255 * 255) as u32
    }
}

impl Transfers {
    /// Of up to sixteen sources.
    fn new(sources: &[Source]) -> Self {
        let none: Row = [0.0; TILE_W];
        let mut out = Transfers { a: [[none; 3]; 3], b: [none; 3], last: [none; 2] };
        for (lane, source) in sources.iter().enumerate() {
            for row in 0..3 {
                for column in 0..3 {
                    out.a[row][column][lane] = source.a[row][column];
                }
                out.b[row][lane] = source.b[row];
            }
            out.last[0][lane] = source.width as f32 - 2.0;
            out.last[1][lane] = source.height as f32 - 2.0;
        }
        out
    }
}

fn source_geometry(reference: &Camera, map: &SourcePlanes) -> SourceGeometry {
    let (a, b) = transfer(reference, &map.camera);
    let baseline = (reference.center() - map.camera.center()).norm();
    let (rx, _, _, _) = reference.intrinsics();
    SourceGeometry {
        width: map.size.width as usize,
        height: map.size.height as usize,
        planes: map.planes.clone(),
        a: rows_f32(&a),
        b: [b.x as f32, b.y as f32, b.z as f32],
        pixels_per_w: (rx * baseline) as f32,
    }
}

const _: () = assert!(PAD >= WIN_W + REACH && PAD >= TILE_W + REACH);
