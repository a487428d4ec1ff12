//! A view that takes part in a step, in the form that the passes read: normals turned into the world, weights in place
//! of confidences, both once per view instead of once per use.

use super::FusionMaps;
use crate::geometry::Lens;
use crate::scene::{ColorImage, DepthEstimate, Grid, LabelMap, ViewIndex};
use std::sync::Arc;

/// A pixel as the passes read it, all in one place: they are bound by memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixel {
    /// Depth, 0 = none.
    pub(super) depth: f32,
    /// Weight in a point.
    pub(super) weight: f32,
    /// Unit normal in the world.
    pub(super) normal: [f32; 3],
}

/// The maps of one view.
pub(super) struct ViewPixels {
    /// The image's name.
    pub(super) name: String,
    pub(super) lens: Lens,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixels: Vec<Pixel>,
    has_normals: bool,
    color: Option<Arc<ColorImage>>,
    labels: Option<Arc<LabelMap>>,
    checked_labels: Option<Arc<LabelMap>>,
    label_confidence: Option<Arc<Grid<f32>>>,
}

/// Normal of all pixels where there are no normals: they count as facing the same way.
const FACING: [f32; 3] = [0.0, 0.0, -1.0];

impl ViewPixels {
    /// Takes over `maps`. `use_normals` is false where any map lacks them.
    pub(super) fn new(maps: FusionMaps, use_normals: bool) -> Self {
        let FusionMaps { estimate, color, labels, checked_labels, label_confidence } = maps;
        let DepthEstimate { image_name: name, camera, depth, normal, confidence, .. } = &*estimate;
        let name = name.clone();
        let (lens, size) = (Lens::new(camera), depth.size());
        let normal = normal.as_ref().filter(|_| use_normals).map(|map| map.data());
        let confidence = confidence.as_ref().map(|map| map.data());
        let pixel = |(i, &depth): (usize, &f32)| Pixel {
            depth,
            weight: pixel_weight(confidence.map_or(1.0, |c| c[i]), depth),
            normal: normal.map_or(FACING, |n| lens.world_direction(n[i])),
        };
        let pixels = depth.data().iter().enumerate().map(pixel).collect();
        let has_normals = normal.is_some();
        let (width, height) = (size.width, size.height);
        ViewPixels {
            name,
            lens,
            width,
            height,
            pixels,
            has_normals,
            color,
            labels,
            checked_labels,
            label_confidence,
        }
    }

    /// Bytes that the maps hold in memory.
    pub(super) fn bytes(&self) -> u64 {
        let has = |map: bool, bytes: u64| if map { bytes } else { 0 };
        self.pixels.len() as u64
            * (size_of::<Pixel>() as u64
                + has(self.color.is_some(), 3)
                + has(self.labels.is_some(), 2)
                + has(self.checked_labels.is_some(), 2)
                + has(self.label_confidence.is_some(), 4))
    }

    /// Whether there is an image to take colours from.
    pub(super) fn has_color(&self) -> bool {
        self.color.is_some()
    }

    /// Class of every pixel, if the view has labels.
    pub(super) fn labels(&self) -> Option<&[u16]> {
        self.labels.as_ref().map(|labels| labels.data())
    }
}

/// Weight of a pixel in a point: grows with its confidence, falls with the square of its depth.
#[inline]
fn pixel_weight(confidence: f32, depth: f32) -> f32 {
    1.0 / ((1.0 - confidence).max(0.03) * depth * depth)
}

/// A view that takes part in a step: its maps as plain slices.
#[derive(Clone, Copy)]
pub(super) struct Participant<'a> {
    pub(super) view: ViewIndex,
    pub(super) lens: &'a Lens,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) pixels: &'a [Pixel],
    /// Whether the normals are those of a map.
    pub(super) has_normals: bool,
    pub(super) color: Option<&'a [[u8; 3]]>,
    labels: Option<&'a [u16]>,
    checked_labels: Option<&'a [u16]>,
    certainty: Option<&'a [f32]>,
}

impl<'a> Participant<'a> {
    pub(super) fn new(view: ViewIndex, pixels: &'a ViewPixels) -> Self {
        let labels = pixels.labels();
        Participant {
            view,
            lens: &pixels.lens,
            width: pixels.width,
            height: pixels.height,
            pixels: &pixels.pixels,
            has_normals: pixels.has_normals,
            color: pixels.color.as_deref().map(|c| c.data()),
            labels,
            checked_labels: pixels.checked_labels.as_ref().map(|labels| labels.data()).or(labels),
            certainty: pixels.label_confidence.as_ref().map(|map| map.data()),
        }
    }

    /// World point of a pixel.
    #[inline]
    pub(super) fn point(&self, pixel: u32) -> [f64; 3] {
        self.lens.world_point(pixel % self.width, pixel / self.width, self.pixels[pixel as usize].depth)
    }

    /// How certain the class of a pixel is, 0..1.
    #[inline]
    pub(super) fn certainty(&self, pixel: usize) -> f32 {
        self.certainty.map_or(1.0, |c| c[pixel])
    }

    /// Class of a pixel, 0 without labels.
    #[inline]
    pub(super) fn label(&self, pixel: usize) -> u16 {
        self.labels.map_or(0, |l| l[pixel])
    }

    /// Class of a pixel as the consistency check sees it.
    #[inline]
    pub(super) fn checked_label(&self, pixel: usize) -> u16 {
        self.checked_labels.map_or(0, |l| l[pixel])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::{Plane, camera, view_of_plane};

    #[test]
    fn weights_and_normals_are_those_of_the_maps() {
        let mut view = view_of_plane(0, camera(8, 6, [0.3, -0.2, 0.1], 0.37), Plane::slanted(8.0, 0.2, -0.1));
        if let Some(confidence) = &mut view.confidence {
            confidence.data_mut()[3] = 0.5;
            confidence.data_mut()[4] = 1.0;
        }
        let lens = Lens::new(&view.camera);
        let pixels = ViewPixels::new(FusionMaps::new(Arc::new(view.clone())), true);
        let participant = Participant::new(ViewIndex(0), &pixels);
        let depth = view.depth.data();
        assert_eq!(participant.pixels[3].weight, 1.0 / (0.5 * depth[3] * depth[3]));
        assert_eq!(participant.pixels[4].weight, 1.0 / (0.03 * depth[4] * depth[4]));
        let normal = view.normal.as_ref().unwrap().data()[5];
        assert_eq!(participant.pixels[5].normal, lens.world_direction(normal));
        assert_eq!(participant.point(10), lens.world_point(2, 1, depth[10]));
        assert!(participant.has_normals && pixels.bytes() == 48 * 20);

        let bare = DepthEstimate { normal: None, confidence: None, ..view };
        let pixels = ViewPixels::new(FusionMaps::new(Arc::new(bare)), false);
        let participant = Participant::new(ViewIndex(0), &pixels);
        let pixel = participant.pixels[3];
        assert_eq!(pixel.weight, 1.0 / (0.03 * pixel.depth * pixel.depth));
        assert_eq!((pixel.normal, participant.label(5)), (FACING, 0));
        assert!(!participant.has_normals);
    }
}
