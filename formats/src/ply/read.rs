//! Streaming reader of the vertices.

use super::ascii::pack_line;
use super::cloud::Cloud;
use super::columns::Columns;
use super::header::{Element, Encoding, Header, broken};
use super::record::RecordLayout;
use crate::source::Source;
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
