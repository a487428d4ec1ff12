//! One point as bytes: the number of views, the fixed attributes of the layout, views and weights.

use crate::scene::{CloudLayout, CloudPoint, ViewIndex};

/// Where the attributes of a record are.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordFormat {
    layout: CloudLayout,
    /// Bytes before the views.
    fixed: usize,
    /// Bytes per view.
    per_view: usize,
}

/// Bytes of the number of views, with which a record starts.
const COUNT: usize = 4;

impl RecordFormat {
    pub(super) fn new(layout: CloudLayout) -> Self {
        let optional = [(layout.normals, 12), (layout.colors, 3), (layout.confidence, 4), (layout.labels, 6)];
        let fixed = COUNT + 12 + optional.iter().map(|&(has, n)| if has { n } else { 0 }).sum::<usize>();
        let per_view = if layout.weights { 8 } else { 4 };
        RecordFormat { layout, fixed, per_view }
    }

    pub(super) fn layout(&self) -> CloudLayout {
        self.layout
    }

    pub(super) fn encode(&self, point: &CloudPoint<'_>, out: &mut Vec<u8>) {
        let floats = |out: &mut Vec<u8>, values: &[f32]| {
            values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        };
        let has = self.layout;
        let views = if has.views { point.views } else { &[] };
        out.extend_from_slice(&(views.len() as u32).to_le_bytes());
        floats(out, &point.position);
        if has.normals {
            floats(out, &point.normal);
        }
        if has.colors {
            out.extend_from_slice(&point.color);
        }
        if has.confidence {
            floats(out, &[point.confidence]);
        }
        if has.labels {
            out.extend_from_slice(&point.label.to_le_bytes());
            floats(out, &[point.label_confidence]);
        }
        views.iter().for_each(|v| out.extend_from_slice(&v.0.to_le_bytes()));
        if has.weights {
            (0..views.len()).for_each(|i| floats(out, &[point.weights.get(i).copied().unwrap_or(0.0)]));
        }
    }

    /// Length of the record of `point`.
    pub(super) fn len(&self, point: &CloudPoint<'_>) -> usize {
        self.fixed + if self.layout.views { point.views.len() * self.per_view } else { 0 }
    }

    /// Length of the record that `bytes` start with.
    pub(super) fn len_of(&self, bytes: &[u8]) -> usize {
        self.fixed + self.view_count(bytes) * self.per_view
    }

    fn view_count(&self, bytes: &[u8]) -> usize {
        u32_at(bytes, 0) as usize
    }

    pub(super) fn decoder(self) -> Decoder {
        Decoder { format: self, views: Vec::new(), weights: Vec::new() }
    }
}

/// Turns records back into points.
#[derive(Debug)]
pub(super) struct Decoder {
    format: RecordFormat,
    views: Vec<ViewIndex>,
    weights: Vec<f32>,
}

impl Decoder {
    /// The point of a whole record.
    pub(super) fn decode(&mut self, bytes: &[u8]) -> CloudPoint<'_> {
        let has = self.format.layout;
        let count = self.format.view_count(bytes);
        let mut at = COUNT;
        let mut next = |n: usize| {
            at += n;
            at - n
        };
        let mut point = CloudPoint { position: floats_at(bytes, next(12)), ..CloudPoint::default() };
        if has.normals {
            point.normal = floats_at(bytes, next(12));
        }
        if has.colors {
            let i = next(3);
            point.color = [bytes[i], bytes[i + 1], bytes[i + 2]];
        }
        if has.confidence {
            [point.confidence] = floats_at(bytes, next(4));
        }
        if has.labels {
            let i = next(6);
            point.label = u16::from_le_bytes([bytes[i], bytes[i + 1]]);
            [point.label_confidence] = floats_at(bytes, i + 2);
        }
        let start = next(4 * count);
        self.views.clear();
        self.views.extend((0..count).map(|i| ViewIndex(u32_at(bytes, start + 4 * i))));
        self.weights.clear();
        if has.weights {
            let start = next(4 * count);
            self.weights.extend((0..count).map(|i| f32::from_bits(u32_at(bytes, start + 4 * i))));
        }
        CloudPoint { views: &self.views, weights: &self.weights, ..point }
    }
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn floats_at<const N: usize>(bytes: &[u8], at: usize) -> [f32; N] {
    std::array::from_fn(|i| f32::from_bits(u32_at(bytes, at + 4 * i)))
}
