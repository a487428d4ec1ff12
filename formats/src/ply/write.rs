//! Streaming writer of point clouds.

use super::ascii::push_number;
use super::cloud::Cloud;
use super::header::Encoding;
use super::layout::{Field, Layout};
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
    fn u8(&mut self, value: u8);
    fn u16(&mut self, value: u16);
    fn u32(&mut self, value: u32);
    fn f32(&mut self, value: f32);
    fn f64(&mut self, value: f64);
}

struct Binary<'a>(&'a mut Vec<u8>);

impl Sink for Binary<'_> {
    fn u8(&mut self, value: u8) {
        self.0.push(value);
    }
    fn u16(&mut self, value: u16) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
    fn u32(&mut self, value: u32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
    fn f32(&mut self, value: f32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
    fn f64(&mut self, value: f64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }
}

struct Ascii<'a>(&'a mut Vec<u8>);

impl Sink for Ascii<'_> {
    fn u8(&mut self, value: u8) {
        self.u32(value.into());
    }
    fn u16(&mut self, value: u16) {
        self.u32(value.into());
    }
    fn u32(&mut self, value: u32) {
        self.0.extend(value.to_string().bytes());
        self.0.push(b' ');
    }
    fn f32(&mut self, value: f32) {
        push_number(value.into(), self.0);
    }
    fn f64(&mut self, value: f64) {
        self.0.extend(value.to_string().bytes());
        self.0.push(b' ');
    }
}

/// Writes one field of point `index`; false if the value does not fit. `chosen` are the positions in the point's list
/// of views that are written, `None` for all.
#[inline]
fn put(out: &mut impl Sink, field: Field, cloud: &Cloud, index: usize, chosen: Option<&[usize]>) -> bool {
    match field {
        Field::Position => cloud.positions[index].iter().for_each(|v| out.f32(*v)),
        Field::PositionF64 => {
            let widened = cloud.positions[index].map(f64::from);
            cloud.positions_f64.get(index).unwrap_or(&widened).iter().for_each(|v| out.f64(*v));
        }
        Field::Color => cloud.colors[index].iter().for_each(|v| out.u8(*v)),
        Field::Normal => cloud.normals[index].iter().for_each(|v| out.f32(*v)),
        Field::LabelU8 => match u8::try_from(cloud.labels[index]) {
            Ok(label) => out.u8(label),
            Err(_) => return false,
        },
        Field::LabelU16 => out.u16(cloud.labels[index]),
        Field::LabelConfidence => out.f32(cloud.label_confidence[index]),
        Field::ViewCount => {
            let listed = cloud.images_of(index).len() as u32;
            out.u8(cloud.view_counts.get(index).copied().unwrap_or(listed).min(255) as u8);
        }
        Field::ViewIndices => put_list(out, cloud.images_of(index), chosen, |out, v| out.u32(v)),
        Field::ViewWeights => put_list(out, cloud.weights_of(index), chosen, |out, v| out.f32(v)),
        Field::Confidence => out.f32(cloud.confidence[index]),
        Field::Value => out.f32(cloud.value[index]),
    }
    true
}

#[inline]
fn put_list<S: Sink, T: Copy>(out: &mut S, list: &[T], chosen: Option<&[usize]>, put: impl Fn(&mut S, T)) {
    match chosen {
        None => {
            out.u8(list.len() as u8);
            list.iter().for_each(|&v| put(out, v));
        }
        Some(chosen) => {
            out.u8(chosen.len() as u8);
            chosen.iter().for_each(|&i| put(out, list[i]));
        }
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
