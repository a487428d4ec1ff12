//! OpenMVS depth maps (`.dmap`): reading of the raw (`DR`) and the quantised (`D2`) layout, writing of `DR`.

mod quantized;
mod write;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::wire::{Place, Reader, vec3f};
use crate::{Error, Limits, Result};
use quantized::Quantization;

/// First bytes of the raw layout.
const MAGIC: [u8; 2] = *b"DR";
/// First bytes of the quantised layout.
const MAGIC_QUANTIZED: [u8; 2] = *b"D2";

const DEPTH: u8 = 1;
const NORMAL: u8 = 2;
const CONFIDENCE: u8 = 4;
const VIEWS: u8 = 8;
const HALF_DEPTH: u8 = 16;

const ROOT: Place<'static> = Place::Root("");

/// A depth map file: header and planes, row-major, top row first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthMapFile {
    /// Image size that `k` refers to.
    pub image_width: u32,
    /// See `image_width`.
    pub image_height: u32,
    /// Size of every plane below.
    pub width: u32,
    /// See `width`.
    pub height: u32,
    /// Smallest depth allowed for this view.
    pub depth_min: f32,
    /// Largest depth allowed for this view.
    pub depth_max: f32,
    /// Path of the reference image as stored, relative to the folder of the depth map.
    pub image_name: Vec<u8>,
    /// Global IDs: the reference image first, then the neighbours used, best first.
    pub ids: Vec<u32>,
    /// Intrinsics in pixels of the image size, row-major 3×3.
    pub k: [f64; 9],
    /// Rotation, camera from world, row-major 3×3.
    pub rotation: [f64; 9],
    /// Camera centre in the world.
    pub center: [f64; 3],
    /// Depth along the optical axis; 0 = no estimate. Readers turn what is negative or not finite into 0.
    pub depth: Vec<f32>,
    /// Unit normals in the camera frame, facing the camera; empty if absent. May be stale where `depth` is 0.
    /// Readers turn what is not finite into the zero vector (no normal).
    pub normal: Vec<[f32; 3]>,
    /// Confidence, larger is better, may exceed 1; empty if absent. Readers turn what is negative or not finite
    /// into 0.
    pub confidence: Vec<f32>,
    /// Per pixel up to four indices into `ids[1..]`, 255 = empty slot; empty if absent.
    pub views: Vec<[u8; 4]>,
}

/// What a depth map file says before its planes; fields as in [`DepthMapFile`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthMapHeader {
    /// Image size that `k` refers to.
    pub image_width: u32,
    /// See `image_width`.
    pub image_height: u32,
    /// Size of every plane.
    pub width: u32,
    /// See `width`.
    pub height: u32,
    /// Smallest depth allowed for this view.
    pub depth_min: f32,
    /// Largest depth allowed for this view.
    pub depth_max: f32,
    /// Path of the reference image as stored.
    pub image_name: Vec<u8>,
    /// Global IDs: the reference image, then the neighbours.
    pub ids: Vec<u32>,
    /// Intrinsics in pixels of the image size, row-major 3×3.
    pub k: [f64; 9],
    /// Rotation, camera from world, row-major 3×3.
    pub rotation: [f64; 9],
    /// Camera centre in the world.
    pub center: [f64; 3],
    /// Whether the normal plane follows.
    pub has_normal: bool,
    /// Whether the confidence plane follows.
    pub has_confidence: bool,
    /// Whether the views plane follows.
    pub has_views: bool,
    /// Whether the planes are quantised (`D2`).
    pub quantized: bool,
}

/// Reads the header of a depth map and compares the size of the file with what it announces.
///
/// # Errors
/// As [`DepthMapFile::read`].
pub fn read_header(path: impl AsRef<Path>, limits: &Limits) -> Result<DepthMapHeader> {
    Ok(header(&mut Reader::<File>::open(path.as_ref(), limits)?)?.0)
}

impl DepthMapFile {
    /// Reads a depth map.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::Format`] if the magic is wrong, there is no depth, a size is 0, the map is larger than
    /// the image, the camera is not finite or without focal length, or the file is shorter or longer than its
    /// header says; [`Error::Limits`]; [`Error::Unsupported`] for unknown type bits.
    pub fn read(path: impl AsRef<Path>, limits: &Limits) -> Result<DepthMapFile> {
        read(Reader::<File>::open(path.as_ref(), limits)?)
    }

    /// Reads a depth map that is in memory.
    ///
    /// # Errors
    /// As [`DepthMapFile::read`].
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<DepthMapFile> {
        read(Reader::from_bytes(bytes, limits))
    }
}

/// Header of either layout, with how the planes are quantised.
fn header<R: Read>(r: &mut Reader<R>) -> Result<(DepthMapHeader, Option<Quantization>)> {
    let at = ROOT.field("header");
    let [m0, m1, kind, extra] = r.array(&at)?;
    let quantized = [m0, m1] == MAGIC_QUANTIZED;
    if !quantized && [m0, m1] != MAGIC {
        return Err(r.error(&at, "not an OpenMVS depth map: neither DR nor D2 at the start"));
    }
    check_kind(r, kind, &at)?;
    let mut h = DepthMapHeader {
        image_width: r.u32(&ROOT.field("imageWidth"))?,
        image_height: r.u32(&ROOT.field("imageHeight"))?,
        width: r.u32(&ROOT.field("depthWidth"))?,
        height: r.u32(&ROOT.field("depthHeight"))?,
        depth_min: r.f32(&ROOT.field("dMin"))?,
        depth_max: r.f32(&ROOT.field("dMax"))?,
        has_normal: kind & NORMAL != 0,
        has_confidence: kind & CONFIDENCE != 0,
        has_views: kind & VIEWS != 0,
        quantized,
        ..DepthMapHeader::default()
    };
    if let Err(what) = h.check_size() {
        return Err(r.error(&ROOT.field("depthWidth"), what));
    }
    let quantization = match quantized {
        true => Some(Quantization::new(extra as i8, r.f32(&ROOT.field("confidenceScale"))?)),
        false => None,
    };
    let at = ROOT.field("fileName");
    let length = r.u16(&at)?;
    h.image_name = r.text(length.into(), &at)?;
    let at = ROOT.field("IDs");
    let count = r.u32(&at)?;
    if !(1..=255).contains(&count) {
        return Err(r.error(&at, format!("{count} view IDs, 1 to 255 are possible")));
    }
    h.ids = r.vec(count.into(), &at, |&b| u32::from_le_bytes(b))?;
    h.k = r.f64s(&ROOT.field("K"))?;
    h.rotation = r.f64s(&ROOT.field("R"))?;
    h.center = r.f64s(&ROOT.field("C"))?;
    if let Err((field, what)) = h.check_camera() {
        return Err(r.error(&ROOT.field(field), what));
    }
    let needed = h.plane_bytes();
    match r.remaining() {
        Some(left) if needed != Some(left) => {
            let needed = needed.map_or("too many".into(), |n| n.to_string());
            let what = format!("{}×{} pixels need {needed} bytes, {left} are left", h.width, h.height);
            Err(r.error(&ROOT.field("planes"), what))
        }
        _ => Ok((h, quantization)),
    }
}

fn check_kind<R: Read>(r: &Reader<R>, kind: u8, at: &Place<'_>) -> Result<()> {
    if kind & HALF_DEPTH != 0 {
        let what = "depth map with flag bit 4 (16-bit float depths), which only a fork of OpenMVS writes";
        return Err(Error::Unsupported(what.into()));
    }
    let unknown = kind & !(DEPTH | NORMAL | CONFIDENCE | VIEWS);
    if unknown != 0 {
        return Err(Error::Unsupported(format!("depth map with unknown type bits {unknown:#04x}")));
    }
    if kind & DEPTH == 0 {
        return Err(r.error(at, format!("type {kind} has no depth")));
    }
    Ok(())
}

impl DepthMapHeader {
    /// What is wrong with the sizes, if anything.
    fn check_size(&self) -> std::result::Result<(), String> {
        let (w, h, iw, ih) = (self.width, self.height, self.image_width, self.image_height);
        if w == 0 || h == 0 || w > iw || h > ih {
            return Err(format!("map size {w}×{h} does not fit an image of {iw}×{ih}"));
        }
        Ok(())
    }

    /// What is wrong with the camera, if anything, and in which field.
    fn check_camera(&self) -> std::result::Result<(), (&'static str, String)> {
        for (field, values) in [("K", &self.k[..]), ("R", &self.rotation), ("C", &self.center)] {
            if let Some(v) = values.iter().find(|v| !v.is_finite()) {
                return Err((field, format!("{v} is not a finite number")));
            }
        }
        if self.k[0] <= 0.0 || self.k[4] <= 0.0 {
            let what = format!("focal lengths must be positive, they are {} and {}", self.k[0], self.k[4]);
            return Err(("K", what));
        }
        Ok(())
    }

    /// Pixels of each plane.
    fn area(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Bytes of all planes; `None` if too many for 64 bits.
    fn plane_bytes(&self) -> Option<u64> {
        let [depth, normal, confidence] = if self.quantized { [2, 4, 1] } else { [4, 12, 4] };
        let optional = [(self.has_normal, normal), (self.has_confidence, confidence), (self.has_views, 4)];
        let pixel =
            depth + optional.iter().map(|&(present, size)| if present { size } else { 0 }).sum::<u64>();
        self.area().checked_mul(pixel)
    }
}

fn read<R: Read>(mut r: Reader<R>) -> Result<DepthMapFile> {
    let (h, quantization) = header(&mut r)?;
    let r = &mut r;
    let [depth, normal, confidence, views] =
        ["depth", "normal", "confidence", "views"].map(|name| ROOT.field(name));
    let (area, none) = (h.area(), 0);
    let normals = if h.has_normal { area } else { none };
    let confidences = if h.has_confidence { area } else { none };
    let mut map = DepthMapFile::default();
    match quantization {
        None => {
            map.depth = r.vec(area, &depth, |&b| usable(f32::from_le_bytes(b)))?;
            map.normal = r.vec(normals, &normal, |b| finite(vec3f(b)))?;
            map.confidence = r.vec(confidences, &confidence, |&b| usable(f32::from_le_bytes(b)))?;
        }
        Some(q) => {
            map.depth = r.vec(area, &depth, |&b| usable(q.depth(b)))?;
            map.normal = r.vec(normals, &normal, |&b| quantized::normal(b))?;
            map.confidence = r.vec(confidences, &confidence, |&b| usable(q.confidence(b)))?;
        }
    }
    map.views = r.vec(if h.has_views { area } else { none }, &views, |&b| b)?;
    if !r.at_end()? {
        return Err(r.error(&ROOT.field("planes"), "the file goes on after the last plane"));
    }
    Ok(DepthMapFile {
        image_width: h.image_width,
        image_height: h.image_height,
        width: h.width,
        height: h.height,
        depth_min: h.depth_min,
        depth_max: h.depth_max,
        image_name: h.image_name,
        ids: h.ids,
        k: h.k,
        rotation: h.rotation,
        center: h.center,
        ..map
    })
}

/// A depth or confidence, 0 if it is negative or not finite.
#[inline]
fn usable(value: f32) -> f32 {
    if value > 0.0 && value < f32::INFINITY { value } else { 0.0 }
}

/// A normal, the zero vector if it is not finite.
#[inline]
fn finite(normal: [f32; 3]) -> [f32; 3] {
    if normal.iter().all(|v| v.is_finite()) { normal } else { [0.0; 3] }
}
