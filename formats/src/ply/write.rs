//! Streaming writer of point clouds.

use super::cloud::Cloud;
use super::header::Encoding;
use super::layout::{Field, Layout};
use crate::number::general;
use crate::{Error, Result};
use std::io::Write;

/// Bytes handed to the medium at a time.
const BLOCK: usize = 1 << 20;
/// Most entries a list with an 8-bit count can have.
const MAX_VIEWS: usize = 255;

/// Writes a whole cloud.
///
/// # Errors
/// As [`PlyWriter::write`].
pub fn write_cloud(writer: impl Write, layout: &Layout, cloud: &Cloud) -> Result<()> {
    let mut points = PlyWriter::new(writer, layout, cloud.len() as u64)?;
    points.write(cloud)?;
    points.finish()?;
    Ok(())
}

/// Writes points chunk by chunk into a file whose number of points is known.
pub struct PlyWriter<W> {
    inner: W,
    layout: Layout,
    declared: u64,
    written: u64,
    block: Vec<u8>,
}

impl<W: Write> PlyWriter<W> {
    /// Writes the header of a file of `count` points. No buffering is needed around `writer`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a big-endian layout.
    pub fn new(writer: W, layout: &Layout, count: u64) -> Result<Self> {
        if layout.encoding == Encoding::BigEndian {
            return Err(Error::Unsupported("big-endian PLY files are read but not written".into()));
        }
        let mut block = Vec::with_capacity(BLOCK + BLOCK / 16);
        block.extend(layout.header(count).to_text(layout.type_names).into_bytes());
        Ok(PlyWriter { inner: writer, layout: layout.clone(), declared: count, written: 0, block })
    }

    /// Appends all points of `cloud`. Of a point seen by more than 255 views the 255 heaviest are written, without
    /// weights the first.
    ///
    /// # Errors
    /// [`Error::Unsupported`] if the cloud lacks what the layout declares or its attributes differ in length,
    /// [`Error::Format`] for a label that does not fit or more points than declared, [`Error::Io`].
    pub fn write(&mut self, cloud: &Cloud) -> Result<()> {
        if let Some(name) = cloud.inconsistency() {
            return Err(Error::Unsupported(format!("a cloud whose {name} do not fit its points")));
        }
        if let Some(field) = self.layout.fields.iter().find(|f| !has(cloud, **f)) {
            return Err(Error::Unsupported(format!("a PLY layout with {field:?} for a cloud without it")));
        }
        self.written += cloud.len() as u64;
        if self.written > self.declared {
            return Err(self.miscounted());
        }
        let first = self.written - cloud.len() as u64;
        let ascii = self.layout.encoding == Encoding::Ascii;
        for index in 0..cloud.len() {
            let chosen = chosen_views(cloud, index);
            for field in &self.layout.fields {
                let fits = if ascii {
                    put(&mut Ascii(&mut self.block), *field, cloud, index, chosen.as_deref())
                } else {
                    put(&mut Binary(&mut self.block), *field, cloud, index, chosen.as_deref())
                };
                if !fits {
                    let what = format!("class id {} does not fit in 8 bits", cloud.labels[index]);
                    let field = format!("vertex[{}].label", first + index as u64);
                    return Err(Error::Format { offset: 0, field, what });
                }
            }
            if ascii {
                self.block.push(b'\n');
            }
            if self.block.len() >= BLOCK {
                self.inner.write_all(&self.block)?;
                self.block.clear();
            }
        }
        Ok(())
    }

    /// Writes what is still buffered and hands the writer back.
    ///
    /// # Errors
    /// [`Error::Format`] if the number of points is not the declared one, [`Error::Io`].
    pub fn finish(mut self) -> Result<W> {
        if self.written != self.declared {
            return Err(self.miscounted());
        }
        self.inner.write_all(&self.block)?;
        self.inner.flush()?;
        Ok(self.inner)
    }

    fn miscounted(&self) -> Error {
        let what = format!("{} points written, {} declared", self.written, self.declared);
        Error::Format { offset: 0, field: "element vertex".into(), what }
    }
}

/// Where numbers go, in the notation of the encoding.
trait Sink {
    fn integers(&mut self, width: usize, values: &[u32]);
    fn floats(&mut self, values: &[f32]);
    fn doubles(&mut self, values: &[f64]);
}

struct Binary<'a>(&'a mut Vec<u8>);

impl Binary<'_> {
    /// `N` bytes at the end for each of `values`.
    #[inline]
    fn push<const N: usize, T: Copy>(&mut self, values: &[T], encode: impl Fn(T) -> [u8; N]) {
        let first = self.0.len();
        self.0.resize(first + N * values.len(), 0);
        for (bytes, value) in self.0[first..].as_chunks_mut().0.iter_mut().zip(values) {
            *bytes = encode(*value);
        }
    }
}

impl Sink for Binary<'_> {
    #[inline]
    fn integers(&mut self, width: usize, values: &[u32]) {
        match width {
            1 => self.push(values, |v| [v as u8]),
            2 => self.push(values, |v| (v as u16).to_le_bytes()),
            _ => self.push(values, u32::to_le_bytes),
        }
    }
    #[inline]
    fn floats(&mut self, values: &[f32]) {
        self.push(values, f32::to_le_bytes);
    }
    #[inline]
    fn doubles(&mut self, values: &[f64]) {
        self.push(values, f64::to_le_bytes);
    }
}

struct Ascii<'a>(&'a mut Vec<u8>);

impl Sink for Ascii<'_> {
    fn integers(&mut self, _width: usize, values: &[u32]) {
        for value in values {
            self.0.extend(format!("{value} ").bytes());
        }
    }
    fn floats(&mut self, values: &[f32]) {
        for value in values {
            self.0.extend(general(f64::from(*value), 6).bytes());
            self.0.push(b' ');
        }
    }
    fn doubles(&mut self, values: &[f64]) {
        for value in values {
            self.0.extend(format!("{value} ").bytes());
        }
    }
}

/// Writes one field of point `index`; false if the value does not fit. `chosen` are the positions in the point's list
/// of views that are written, `None` for all.
#[inline]
fn put(out: &mut impl Sink, field: Field, cloud: &Cloud, index: usize, chosen: Option<&[usize]>) -> bool {
    match field {
        Field::Position => out.floats(&cloud.positions[index]),
        Field::PositionF64 => {
            let widened = cloud.positions[index].map(f64::from);
            out.doubles(cloud.positions_f64.get(index).unwrap_or(&widened));
        }
        Field::Color => out.integers(1, &cloud.colors[index].map(u32::from)),
        Field::Normal => out.floats(&cloud.normals[index]),
        Field::LabelU8 if cloud.labels[index] > 255 => return false,
        Field::LabelU8 => out.integers(1, &[cloud.labels[index].into()]),
        Field::LabelU16 => out.integers(2, &[cloud.labels[index].into()]),
        Field::LabelConfidence => out.floats(&[cloud.label_confidence[index]]),
        Field::ViewCount => {
            let listed = cloud.images_of(index).len() as u32;
            out.integers(1, &[cloud.view_counts.get(index).copied().unwrap_or(listed).min(255)]);
        }
        Field::ViewIndices => with_chosen(cloud.images_of(index), chosen, |list| {
            out.integers(1, &[list.len() as u32]);
            out.integers(4, list);
        }),
        Field::ViewWeights => with_chosen(cloud.weights_of(index), chosen, |list| {
            out.integers(1, &[list.len() as u32]);
            out.floats(list);
        }),
        Field::Confidence => out.floats(&[cloud.confidence[index]]),
        Field::Value => out.floats(&[cloud.value[index]]),
    }
    true
}

/// Hands the chosen entries of `list` to `put`.
#[inline]
fn with_chosen<T: Copy>(list: &[T], chosen: Option<&[usize]>, put: impl FnOnce(&[T])) {
    match chosen {
        None => put(list),
        Some(chosen) => put(&chosen.iter().map(|&i| list[i]).collect::<Vec<_>>()),
    }
}

/// Positions of the views to write, in list order, if there are too many for all.
fn chosen_views(cloud: &Cloud, index: usize) -> Option<Vec<usize>> {
    let n = cloud.images_of(index).len();
    if n <= MAX_VIEWS {
        return None;
    }
    let mut order: Vec<usize> = (0..n).collect();
    let weights = cloud.weights_of(index);
    if !weights.is_empty() {
        order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
    }
    order.truncate(MAX_VIEWS);
    order.sort_unstable();
    Some(order)
}

/// Whether `cloud` has the column that `field` is made from; a cloud without points has every column.
fn has(cloud: &Cloud, field: Field) -> bool {
    cloud.is_empty()
        || match field {
            Field::Position | Field::PositionF64 => true,
            Field::Color => !cloud.colors.is_empty(),
            Field::Normal => !cloud.normals.is_empty(),
            Field::LabelU8 | Field::LabelU16 => !cloud.labels.is_empty(),
            Field::LabelConfidence => !cloud.label_confidence.is_empty(),
            Field::ViewCount => cloud.has_views() || !cloud.view_counts.is_empty(),
            Field::ViewIndices => cloud.has_views(),
            Field::ViewWeights => {
                cloud.has_views() && (cloud.views.images.is_empty() || !cloud.views.weights.is_empty())
            }
            Field::Confidence => !cloud.confidence.is_empty(),
            Field::Value => !cloud.value.is_empty(),
        }
}
