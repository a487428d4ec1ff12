//! Streaming reader of the vertices.

use super::ascii::pack_line;
use super::cloud::Cloud;
use super::header::{Element, Encoding, Header, PropertyType, ScalarType, broken};
use super::record::{Block, Place, RecordLayout};
use crate::source::{Source, grow};
use crate::{Error, Limits, Result};
use std::io::Read;

/// Points decoded at a time.
const CHUNK: usize = 8192;
/// Longest record of one point, as bytes or as a text line.
const MAX_RECORD: u64 = 4 << 20;
/// Packed bytes of text lines after which they are decoded.
const MAX_PACKED: usize = 1 << 20;
/// Bytes of values that a cloud may have however small its file is.
const FREE_VALUES: u64 = 16 << 20;
/// Bytes of values for each byte of the file beyond that; only 8-bit coordinates take more.
const MOST_VALUES: u64 = 3;

/// Reads a whole cloud.
///
/// Properties are matched by name, in any order and of any type; unknown ones and other elements are skipped.
///
/// # Errors
/// [`Error::Format`] for a broken header, a file that ends early, colours or normals that are incomplete, a label or
/// view index out of range, and weights that do not match the views; [`Error::Limits`] when the cloud outgrows them.
pub fn read_cloud(reader: impl Read, limits: &Limits) -> Result<Cloud> {
    let mut points = PointReader::new(reader, limits)?;
    let mut cloud = Cloud { comments: points.header().comments.clone(), ..Cloud::default() };
    while points.read(&mut cloud, CHUNK)? > 0 {
        points.check_limit(cloud.bytes())?;
    }
    Ok(cloud)
}

/// Reads the vertices of a PLY file chunk by chunk.
pub struct PointReader<R> {
    source: Source<R>,
    limits: Limits,
    header: Header,
    element: Element,
    layout: RecordLayout,
    columns: Columns,
    remaining: u64,
    packed: Vec<u8>,
    anchors: Vec<usize>,
}

impl<R: Read> PointReader<R> {
    /// Reads the header and goes to the first vertex. No buffering is needed around `reader`.
    ///
    /// # Errors
    /// [`Error::Format`] for a broken header or one without vertex positions, [`Error::Limits`].
    pub fn new(reader: R, limits: &Limits) -> Result<Self> {
        let mut source = Source::new(reader);
        let header = Header::read(&mut source, limits)?;
        let Some(index) = header.elements.iter().position(|e| e.name == "vertex") else {
            return Err(broken(source.offset(), "header", "there is no element \"vertex\""));
        };
        for element in &header.elements[..index] {
            skip(&mut source, element, header.encoding)?;
        }
        let element = header.elements[index].clone();
        let layout = RecordLayout::new(&element);
        let columns = Columns::new(&element, &layout, source.offset())?;
        let remaining = element.count;
        let (packed, anchors) = (Vec::new(), Vec::new());
        Ok(PointReader {
            source,
            limits: *limits,
            header,
            element,
            layout,
            columns,
            remaining,
            packed,
            anchors,
        })
    }

    /// The header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// Points not read yet, by the header's word.
    pub fn remaining(&self) -> u64 {
        self.remaining
    }

    /// Appends up to `max` points to `cloud`, which is empty or holds earlier points of this file; returns how many,
    /// 0 only after the last.
    ///
    /// # Errors
    /// As [`read_cloud`].
    pub fn read(&mut self, cloud: &mut Cloud, max: usize) -> Result<usize> {
        let mut wanted = usize::try_from(self.remaining).unwrap_or(usize::MAX).min(max);
        let mut read = 0;
        while wanted > 0 {
            self.anchors.clear();
            let at = self.source.offset();
            let found = match self.header.encoding {
                Encoding::Ascii => self.pack_lines(wanted.min(CHUNK))?,
                _ => self.find_records(wanted.min(CHUNK))?,
            };
            let (bytes, big_endian) = match self.header.encoding {
                Encoding::Ascii => (self.packed.as_slice(), false),
                encoding => (self.source.window(), encoding == Encoding::BigEndian),
            };
            let block = self.layout.block(bytes, &self.anchors, big_endian);
            let first = self.element.count - self.remaining;
            self.columns.decode(block, cloud, first, at)?;
            if self.header.encoding != Encoding::Ascii {
                self.source.consume(found.bytes);
            }
            self.remaining -= found.records as u64;
            wanted -= found.records;
            read += found.records;
        }
        Ok(read)
    }

    /// Anchors of 1 to `max` complete records at the start of the window.
    fn find_records(&mut self, max: usize) -> Result<Found> {
        let big_endian = self.header.encoding == Encoding::BigEndian;
        let mut found = Found { records: 0, bytes: 0 };
        while found.records < max {
            let (window, at) = (self.source.window(), self.source.offset());
            match self.layout.walk(window, found.bytes, big_endian, at, &mut self.anchors)? {
                Some(end) => found = Found { records: found.records + 1, bytes: end },
                None if found.records > 0 => break,
                None => {
                    self.check_limit(self.source.window().len() as u64)?;
                    check_record(&self.source, &self.element)?;
                    if !self.source.fill()? {
                        return Err(self.ended());
                    }
                }
            }
        }
        Ok(found)
    }

    /// Packs the next `n` text lines.
    fn pack_lines(&mut self, n: usize) -> Result<Found> {
        self.packed.clear();
        let mut line = Vec::new();
        let mut found = Found { records: 0, bytes: 0 };
        while found.records < n && self.packed.len() < MAX_PACKED {
            let offset = self.source.offset();
            if !self.source.line(&mut line, MAX_RECORD, "vertex")? && line.is_empty() {
                return Err(self.ended());
            }
            if line.iter().all(u8::is_ascii_whitespace) {
                continue;
            }
            pack_line(&line, &self.element, offset, &mut self.packed)?;
            let end = self.layout.walk(&self.packed, found.bytes, false, offset, &mut self.anchors)?;
            found = Found { records: found.records + 1, bytes: end.unwrap_or(self.packed.len()) };
        }
        Ok(found)
    }

    fn ended(&self) -> Error {
        let (read, declared) = (self.element.count - self.remaining, self.element.count);
        let what = format!("the file ends after about {read} of {declared} points");
        broken(self.source.offset(), "vertex", what)
    }

    /// Refuses values that take more than the limits allow, or far more than the bytes that they were read from.
    fn check_limit(&self, needed: u64) -> Result<()> {
        let sound = self.source.offset().saturating_mul(MOST_VALUES).saturating_add(FREE_VALUES);
        let limit = self.limits.max_bytes.min(sound);
        if needed > limit {
            return Err(Error::Limits { field: "vertex".into(), needed, limit });
        }
        Ok(())
    }
}

/// Refuses a record that does not end within the window, if that is long.
fn check_record<R: Read>(source: &Source<R>, element: &Element) -> Result<()> {
    let (needed, limit) = (source.window().len() as u64, MAX_RECORD);
    if needed >= limit {
        return Err(Error::Limits { field: format!("a record of element {}", element.name), needed, limit });
    }
    Ok(())
}

/// Complete records at the start of a window.
struct Found {
    records: usize,
    bytes: usize,
}

/// Consumes all records of an element.
fn skip<R: Read>(source: &mut Source<R>, element: &Element, encoding: Encoding) -> Result<()> {
    if element.properties.is_empty() {
        return Ok(());
    }
    let layout = RecordLayout::new(element);
    let ended = |source: &Source<R>| {
        let what = format!("the file ends within the {} records of this element", element.count);
        broken(source.offset(), &element.name, what)
    };
    let (mut line, mut anchors) = (Vec::new(), Vec::new());
    for _ in 0..element.count {
        if encoding == Encoding::Ascii {
            while line.iter().all(u8::is_ascii_whitespace) {
                if !source.line(&mut line, MAX_RECORD, &element.name)? && line.is_empty() {
                    return Err(ended(source));
                }
            }
            line.clear();
            continue;
        }
        let bytes = loop {
            anchors.clear();
            let big_endian = encoding == Encoding::BigEndian;
            match layout.walk(source.window(), 0, big_endian, source.offset(), &mut anchors)? {
                Some(bytes) => break bytes,
                None if check_record(source, element).is_err() => return check_record(source, element),
                None if source.fill()? => {}
                None => return Err(ended(source)),
            }
        };
        source.consume(bytes);
    }
    Ok(())
}

/// The properties that a [`Cloud`] has a column for.
struct Columns {
    position: [Place; 3],
    wide: bool,
    color: Option<[Place; 3]>,
    normal: Option<[Place; 3]>,
    label: Option<Place>,
    label_confidence: Option<Place>,
    confidence: Option<Place>,
    value: Option<Place>,
    view_count: Option<Place>,
    views: Option<Place>,
    weights: Option<Place>,
}

impl Columns {
    fn new(element: &Element, layout: &RecordLayout, offset: u64) -> Result<Self> {
        let find = |name: &str| {
            let index = element.properties.iter().position(|p| p.name == name)?;
            Some(layout.place(index))
        };
        let scalar = |name: &str| find(name).filter(|p| matches!(p.kind, PropertyType::Scalar(_)));
        let list = |name: &str| find(name).filter(|p| matches!(p.kind, PropertyType::List { .. }));
        let triple = |names: [&str; 3]| match names.map(scalar) {
            [Some(a), Some(b), Some(c)] => Ok(Some([a, b, c])),
            [None, None, None] => Ok(None),
            _ => Err(broken(offset, "vertex", format!("{} must be there together", names.join(", ")))),
        };
        let Some(position) = triple(["x", "y", "z"])? else {
            return Err(broken(offset, "vertex", "there are no properties x, y, z"));
        };
        let color = match triple(["red", "green", "blue"])? {
            None => triple(["diffuse_red", "diffuse_green", "diffuse_blue"])?,
            color => color,
        };
        let wide = |p: &Place| {
            use ScalarType::{F64, I32, U32};
            matches!(p.kind, PropertyType::Scalar(F64 | I32 | U32))
        };
        Ok(Columns {
            position,
            wide: position.iter().any(wide),
            color,
            normal: triple(["nx", "ny", "nz"])?,
            label: scalar("label"),
            label_confidence: scalar("label_confidence"),
            confidence: scalar("confidence"),
            value: scalar("value"),
            view_count: scalar("views"),
            views: list("view_indices"),
            weights: list("view_weights").filter(|_| list("view_indices").is_some()),
        })
    }

    /// Appends the points of `block`; `first` is the number of its first point and `at` its place in the file.
    fn decode(&self, block: Block<'_>, cloud: &mut Cloud, first: u64, at: u64) -> Result<()> {
        triples(block, self.position, &mut cloud.positions, 0.0, |v| v as f32);
        if self.wide {
            triples(block, self.position, &mut cloud.positions_f64, 0.0, |v| v);
        }
        if let Some(places) = self.color {
            triples(block, places, &mut cloud.colors, 0, |v| v as u8);
        }
        if let Some(places) = self.normal {
            triples(block, places, &mut cloud.normals, 0.0, |v| v as f32);
        }
        let floats = [
            (self.label_confidence, &mut cloud.label_confidence),
            (self.confidence, &mut cloud.confidence),
            (self.value, &mut cloud.value),
        ];
        for (place, column) in floats {
            if let Some(place) = place {
                grow(column, block.len());
                block.scalars(place, |v| column.push(v as f32));
            }
        }
        let integers =
            [(self.label, f64::from(u16::MAX), "label"), (self.view_count, f64::from(u32::MAX), "views")];
        for (place, max, name) in integers {
            let Some(place) = place else { continue };
            if name == "label" {
                grow(&mut cloud.labels, block.len());
            } else {
                grow(&mut cloud.view_counts, block.len());
            }
            let mut index = 0;
            let mut bad = None;
            block.scalars(place, |v| {
                if !is_index(v, max) {
                    bad = bad.or(Some((index, v)));
                }
                index += 1;
                if name == "label" { cloud.labels.push(v as u16) } else { cloud.view_counts.push(v as u32) }
            });
            if let Some((index, value)) = bad {
                let field = format!("vertex[{}].{name}", first + index);
                return Err(broken(at, field, format!("{value} is not an integer in 0..={max}")));
            }
        }
        self.decode_views(block, cloud, first, at)
    }

    fn decode_views(&self, block: Block<'_>, cloud: &mut Cloud, first: u64, at: u64) -> Result<()> {
        let Some(views) = self.views else { return Ok(()) };
        let unsigned = {
            use ScalarType::{U8, U16, U32};
            matches!(views.kind, PropertyType::List { item: U8 | U16 | U32, .. })
        };
        let lists = &mut cloud.views;
        if lists.offsets.is_empty() {
            lists.offsets.push(0);
        }
        grow(&mut lists.offsets, block.len());
        for index in 0..block.len() {
            let field = |name| format!("vertex[{}].{name}", first + index as u64);
            let count = block.list(index, views, &mut lists.images, |v| v as u32);
            if !unsigned {
                let mut stored = Vec::with_capacity(count);
                block.list(index, views, &mut stored, |v| v);
                if let Some(v) = stored.iter().find(|v| !is_index(**v, f64::from(u32::MAX))) {
                    return Err(broken(at, field("view_indices"), format!("{v} is not an image index")));
                }
            }
            if let Some(weights) = self.weights {
                let weights = block.list(index, weights, &mut lists.weights, |w| w as f32);
                if weights != count {
                    let what = format!("{weights} weights for {count} views");
                    return Err(broken(at, field("view_weights"), what));
                }
            }
            lists.offsets.push(lists.images.len() as u64);
        }
        Ok(())
    }
}

fn is_index(value: f64, max: f64) -> bool {
    (0.0..=max).contains(&value) && value.fract() == 0.0
}

/// Appends three properties of every record as one array.
fn triples<T: Copy>(
    block: Block<'_>,
    places: [Place; 3],
    out: &mut Vec<[T; 3]>,
    zero: T,
    convert: impl Fn(f64) -> T,
) {
    let first = out.len();
    grow(out, block.len());
    out.resize(first + block.len(), [zero; 3]);
    for (component, place) in places.into_iter().enumerate() {
        let mut rows = out[first..].iter_mut();
        block.scalars(place, |v| {
            if let Some(row) = rows.next() {
                row[component] = convert(v);
            }
        });
    }
}
