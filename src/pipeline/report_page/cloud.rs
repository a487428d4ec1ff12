//! The points of a page's viewer: some of the cloud, and what the depth maps say of each.

use super::super::page_parts::{bounding_box, middle, spacing};
use crate::error::Result;
use crate::report::{ClassRow, PageCloud, PageCloudClass, ViewerPoint, chosen, packed, shuffled};
use crate::scene::{CloudLayout, DepthEstimate, PointSource};
use crate::semantics::{ClassId, ClassTable};
use crate::store::ply_source::PlySource;
use nalgebra::Vector3;
use rayon::prelude::*;
use semvs_formats::Limits;
use std::collections::BTreeMap;
use std::path::Path;

/// A depth that differs from a point's by less than this share is that of the point.
const SAME_DEPTH: f64 = 0.01;
/// Most classes of the viewer; further ones share the last.
const MOST_CLASSES: usize = 256;

/// Some points of a cloud.
pub(super) struct ViewerCloud {
    points: Vec<ViewerPoint>,
    /// Sum of the confidences of the depths that are the point's, and their number.
    depths: Vec<(f32, u32)>,
    /// Ids of their labels, before `classes` is known.
    labels: Vec<u16>,
    layout: CloudLayout,
    /// Points of the whole cloud by label.
    counts: BTreeMap<u16, u64>,
    /// Names and colours by id.
    names: BTreeMap<u16, (String, [u8; 3])>,
    /// Whether any depth map was held against them, and whether one has confidences.
    met: (bool, bool),
    min: [f64; 3],
    extent: [f64; 3],
}

impl ViewerCloud {
    /// At most `most` of the points of the cloud at `path`, evenly chosen. Classes are named by `table`, else by `rows`, else
    /// by the cloud.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(super) fn read(
        path: &Path,
        most: usize,
        table: Option<&ClassTable>,
        rows: &[ClassRow],
    ) -> Result<Self> {
        let source = PlySource::open(path, Limits::default())?;
        let (layout, origin, len) = (source.layout(), source.origin(), source.len());
        let count = len.min(most as u64);
        let mut counts: BTreeMap<u16, u64> = BTreeMap::new();
        let (mut points, mut labels) = (Vec::with_capacity(count as usize), Vec::new());
        let (mut at, mut next) = (0u64, chosen(0, count, len));
        source.for_each(&mut |point| {
            *counts.entry(point.label).or_default() += 1;
            let is_chosen = at == next;
            at += 1;
            if !is_chosen {
                return Ok(());
            }
            next = chosen(points.len() as u64 + 1, count, len);
            let position = std::array::from_fn(|k| f64::from(point.position[k]) + origin[k]);
            labels.push(point.label);
            points.push(ViewerPoint {
                position,
                color: point.color,
                normal: point.normal,
                class: 0,
                confidence: point.confidence,
                label_confidence: point.label_confidence,
                views: point.views.len() as u32,
            });
            Ok(())
        })?;
        let listed = source.listed_classes()?;
        let names = counts.keys().map(|&id| (id, name_of(id, table, rows, listed.as_ref()))).collect();
        let (min, extent) = bounding_box(&mut points, &mut labels);
        // The viewer draws a first part of them while it is in motion.
        let order = shuffled(points.len());
        let points: Vec<ViewerPoint> = order.iter().map(|&i| points[i as usize]).collect();
        let labels: Vec<u16> = order.iter().map(|&i| labels[i as usize]).collect();
        let depths = vec![(0.0, 0); points.len()];
        Ok(ViewerCloud { points, depths, labels, layout, counts, names, met: (false, false), min, extent })
    }

    /// The least corner of the box about the points.
    pub(super) fn corner(&self) -> [f64; 3] {
        self.min
    }

    /// Holds a depth map against the points: which of them it shows, and how sure it is of them.
    pub(super) fn meet(&mut self, map: &DepthEstimate) {
        self.met.0 = true;
        self.met.1 |= map.confidence.is_some();
        self.points.par_iter().zip(&mut self.depths).with_min_len(1 << 12).for_each(|(point, seen)| {
            let p = map.camera.cam_from_world(&Vector3::from(point.position));
            if p.z <= 0.0 {
                return;
            }
            let (u, v) = map.camera.image_from_cam(&p);
            let (u, v) = (u.round(), v.round());
            if u < 0.0 || v < 0.0 {
                return;
            }
            let Some(&depth) = map.depth.get(u as usize, v as usize) else { return };
            if depth > 0.0 && (f64::from(depth) - p.z).abs() < SAME_DEPTH * p.z {
                let confidence = map.confidence.as_ref().and_then(|c| c.get(u as usize, v as usize));
                seen.0 += confidence.copied().unwrap_or_default().min(1.0);
                seen.1 += 1;
            }
        });
    }

    /// What the page needs: the cloud, its packed points, and the points of the whole cloud by label.
    pub(super) fn finished(mut self) -> (PageCloud, Vec<u8>, BTreeMap<u16, u64>) {
        let views_are_known = self.layout.views || self.met.0;
        let confidence_is_known = self.layout.confidence || self.met.1;
        let ids: Vec<u16> = self.names.keys().copied().take(MOST_CLASSES).collect();
        let mut shown = vec![0u64; ids.len()];
        for ((point, &(confidence, seen)), &label) in
            self.points.iter_mut().zip(&self.depths).zip(&self.labels)
        {
            if !self.layout.views {
                point.views = seen;
            }
            if !self.layout.confidence {
                point.confidence = confidence / seen.max(1) as f32;
            }
            let place = ids.binary_search(&label).unwrap_or(ids.len().saturating_sub(1));
            point.class = place as u8;
            shown[place] += 1;
        }
        let has_labels = self.layout.labels;
        let class = |(id, points): (&u16, u64)| {
            let (name, color) = self.names.get(id).cloned().unwrap_or_default();
            PageCloudClass { name, color, points, shown: true }
        };
        let classes = match has_labels {
            true => ids.iter().zip(shown).map(class).collect(),
            false => vec![PageCloudClass {
                name: "all".to_owned(),
                color: [200; 3],
                points: self.points.len() as u64,
                shown: true,
            }],
        };
        let (center, span) = middle(&self.points, self.min);
        let cloud = PageCloud {
            count: self.points.len(),
            extent: self.extent,
            center,
            span,
            spacing: spacing(&self.points),
            most_views: most_views(&self.points),
            has_colors: self.layout.colors,
            has_confidence: confidence_is_known,
            has_views: views_are_known,
            has_normals: self.layout.normals,
            has_label_confidence: has_labels,
            classes,
        };
        (cloud, packed(&self.points, self.min, self.extent), self.counts)
    }
}

fn name_of(
    id: u16,
    table: Option<&ClassTable>,
    rows: &[ClassRow],
    listed: Option<&ClassTable>,
) -> (String, [u8; 3]) {
    if let Some(row) = rows.iter().find(|row| row.id == id) {
        return (row.name.clone(), row.color);
    }
    let ids = ClassTable::ids();
    let knows = |table: &&ClassTable| id == 0 || table.contains(ClassId(id));
    let table = table.filter(knows).or(listed.filter(knows)).unwrap_or(&ids);
    (table.class_name(ClassId(id)).into_owned(), table.color(ClassId(id)))
}

/// Views of the point that only one in fifty has more of.
fn most_views(points: &[ViewerPoint]) -> u32 {
    let mut views: Vec<u32> = points.iter().map(|p| p.views.min(127)).collect();
    views.par_sort_unstable();
    views.get(views.len().saturating_sub(1) * 49 / 50).copied().unwrap_or(0)
}
