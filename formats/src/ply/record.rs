//! Where the values of an element's records lie, and their decoding column by column.

use super::header::{Element, PropertyType, ScalarType, broken};
use crate::Result;
use crate::source::grow;

/// Place of a property: `offset` bytes after an anchor. Anchor 0 is the start of the record, anchor k the end of
/// its k-th list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    anchor: usize,
    offset: usize,
    pub(super) kind: PropertyType,
}

/// The steps that walk over one record, and the place of every property.
pub(super) struct RecordLayout {
    places: Vec<Place>,
    lists: Vec<Place>,
    /// Bytes from the last anchor to the end of the record.
    tail: usize,
}

impl RecordLayout {
    pub(super) fn new(element: &Element) -> Self {
        let (mut places, mut lists) = (Vec::new(), Vec::new());
        let mut offset = 0;
        for property in &element.properties {
            let place = Place { anchor: lists.len(), offset, kind: property.kind };
            places.push(place);
            match property.kind {
                PropertyType::Scalar(t) => offset += t.bytes(),
                PropertyType::List { .. } => {
                    lists.push(place);
                    offset = 0;
                }
            }
        }
        RecordLayout { places, lists, tail: offset }
    }

    /// Place of property number `index`.
    pub(super) fn place(&self, index: usize) -> Place {
        self.places[index]
    }

    /// Anchors per record.
    fn anchors(&self) -> usize {
        self.lists.len() + 1
    }

    /// Walks over the record at `start`, appends its anchors and returns its end; `None` and nothing appended if it
    /// reaches beyond `bytes`. `at` is the offset of `bytes` in the file.
    pub(super) fn walk(
        &self,
        bytes: &[u8],
        start: usize,
        big_endian: bool,
        at: u64,
        anchors: &mut Vec<usize>,
    ) -> Result<Option<usize>> {
        let before = anchors.len();
        let mut anchor = start;
        anchors.push(anchor);
        for place in &self.lists {
            let PropertyType::List { count, item } = place.kind else { continue };
            let position = anchor.saturating_add(place.offset);
            let counted = match count {
                ScalarType::U8 => bytes.get(position).map(|&n| usize::from(n)),
                _ => match bytes.get(position..).and_then(|b| decode(b, count, big_endian)) {
                    Some(n) if n < 0.0 => {
                        return Err(broken(at + position as u64, "list", format!("a count of {n}")));
                    }
                    n => n.map(|n| n as usize),
                },
            };
            let Some(n) = counted else {
                anchors.truncate(before);
                return Ok(None);
            };
            let items = n.saturating_mul(item.bytes());
            anchor = items.saturating_add(position + count.bytes());
            anchors.push(anchor);
        }
        let end = anchor.saturating_add(self.tail);
        if end > bytes.len() {
            anchors.truncate(before);
            return Ok(None);
        }
        Ok(Some(end))
    }

    /// Records whose anchors [`RecordLayout::walk`] found in `bytes`.
    pub(super) fn block<'a>(&self, bytes: &'a [u8], anchors: &'a [usize], big_endian: bool) -> Block<'a> {
        Block { bytes, anchors, stride: self.anchors(), big_endian }
    }
}

/// Some complete records.
#[derive(Clone, Copy)]
pub(super) struct Block<'a> {
    bytes: &'a [u8],
    anchors: &'a [usize],
    stride: usize,
    big_endian: bool,
}

impl Block<'_> {
    pub(super) fn len(&self) -> usize {
        self.anchors.len() / self.stride
    }

    /// Calls `take` with the value of every record at a scalar's place.
    pub(super) fn scalars(&self, place: Place, take: impl FnMut(f64)) {
        let PropertyType::Scalar(kind) = place.kind else { return };
        let big = self.big_endian;
        match kind {
            ScalarType::I8 => self.each(place, |b| f64::from(i8::from_le_bytes(b)), take),
            ScalarType::U8 => self.each(place, |b| f64::from(u8::from_le_bytes(b)), take),
            ScalarType::I16 => self.each(place, |b| f64::from(i16::from_le_bytes(swap(b, big))), take),
            ScalarType::U16 => self.each(place, |b| f64::from(u16::from_le_bytes(swap(b, big))), take),
            ScalarType::I32 => self.each(place, |b| f64::from(i32::from_le_bytes(swap(b, big))), take),
            ScalarType::U32 => self.each(place, |b| f64::from(u32::from_le_bytes(swap(b, big))), take),
            ScalarType::F32 => self.each(place, |b| f64::from(f32::from_le_bytes(swap(b, big))), take),
            ScalarType::F64 => self.each(place, |b| f64::from_le_bytes(swap(b, big)), take),
        }
    }

    fn each<const N: usize>(&self, place: Place, decode: impl Fn([u8; N]) -> f64, mut take: impl FnMut(f64)) {
        for anchors in self.anchors.chunks_exact(self.stride) {
            let position = anchors[place.anchor] + place.offset;
            if let Some(bytes) = self.bytes[position..].first_chunk() {
                take(decode(*bytes));
            }
        }
    }

    /// Calls `take` with three neighbouring values of `N` bytes of every record, as they are stored, and returns true
    /// if the places are three such neighbours in a little-endian file; else does nothing.
    pub(super) fn packed<const N: usize>(
        &self,
        [a, b, c]: [Place; 3],
        kind: ScalarType,
        mut take: impl FnMut(&[[u8; N]; 3]),
    ) -> bool {
        let follows = |p: Place, k| p == Place { offset: a.offset + k * N, ..a };
        if a.kind != PropertyType::Scalar(kind) || !follows(b, 1) || !follows(c, 2) || self.big_endian {
            return false;
        }
        for anchors in self.anchors.chunks_exact(self.stride) {
            let position = anchors[a.anchor] + a.offset;
            if let ([x, y, z, ..], _) = self.bytes[position..].as_chunks::<N>() {
                take(&[*x, *y, *z]);
            }
        }
        true
    }

    /// The bytes of the entries of record `index` at a list's place.
    fn list_bytes(&self, index: usize, place: Place, count: ScalarType) -> &[u8] {
        let anchors = &self.anchors[index * self.stride..(index + 1) * self.stride];
        let first = anchors[place.anchor] + place.offset + count.bytes();
        &self.bytes[first..anchors[place.anchor + 1]]
    }

    /// [`Block::list`] of entries of the type `T` itself, where the file is little-endian and they are stored so.
    pub(super) fn plain_list<T, const N: usize>(
        &self,
        index: usize,
        place: Place,
        kind: ScalarType,
        out: &mut Vec<T>,
        convert: impl Fn([u8; N]) -> T,
    ) -> Option<usize> {
        let PropertyType::List { count, item } = place.kind else { return None };
        if item != kind || self.big_endian {
            return None;
        }
        let bytes = self.list_bytes(index, place, count);
        entries(bytes, out, convert);
        Some(bytes.len() / N)
    }

    /// Appends the entries of record `index` at a list's place and returns their number.
    pub(super) fn list<T>(
        &self,
        index: usize,
        place: Place,
        out: &mut Vec<T>,
        convert: impl Fn(f64) -> T,
    ) -> usize {
        let PropertyType::List { count, item } = place.kind else { return 0 };
        let bytes = self.list_bytes(index, place, count);
        let big = self.big_endian;
        match item {
            ScalarType::I8 => entries(bytes, out, |b| convert(f64::from(i8::from_le_bytes(b)))),
            ScalarType::U8 => entries(bytes, out, |b| convert(f64::from(u8::from_le_bytes(b)))),
            ScalarType::I16 => entries(bytes, out, |b| convert(f64::from(i16::from_le_bytes(swap(b, big))))),
            ScalarType::U16 => entries(bytes, out, |b| convert(f64::from(u16::from_le_bytes(swap(b, big))))),
            ScalarType::I32 => entries(bytes, out, |b| convert(f64::from(i32::from_le_bytes(swap(b, big))))),
            ScalarType::U32 => entries(bytes, out, |b| convert(f64::from(u32::from_le_bytes(swap(b, big))))),
            ScalarType::F32 => entries(bytes, out, |b| convert(f64::from(f32::from_le_bytes(swap(b, big))))),
            ScalarType::F64 => entries(bytes, out, |b| convert(f64::from_le_bytes(swap(b, big)))),
        }
        bytes.len() / item.bytes()
    }
}

/// Appends the decoded values of `bytes`.
fn entries<const N: usize, T>(bytes: &[u8], out: &mut Vec<T>, decode: impl Fn([u8; N]) -> T) {
    grow(out, bytes.len() / N);
    out.extend(bytes.as_chunks().0.iter().map(|b| decode(*b)));
}

/// Most significant byte first to least significant byte first, if `big`.
#[inline]
fn swap<const N: usize>(mut bytes: [u8; N], big: bool) -> [u8; N] {
    if big {
        bytes.reverse();
    }
    bytes
}

/// The first value of `bytes`, or `None` if there are too few.
#[inline]
fn decode(bytes: &[u8], kind: ScalarType, big: bool) -> Option<f64> {
    Some(match kind {
        ScalarType::I8 => f64::from(i8::from_le_bytes(*bytes.first_chunk()?)),
        ScalarType::U8 => f64::from(*bytes.first()?),
        ScalarType::I16 => f64::from(i16::from_le_bytes(swap(*bytes.first_chunk()?, big))),
        ScalarType::U16 => f64::from(u16::from_le_bytes(swap(*bytes.first_chunk()?, big))),
        ScalarType::I32 => f64::from(i32::from_le_bytes(swap(*bytes.first_chunk()?, big))),
        ScalarType::U32 => f64::from(u32::from_le_bytes(swap(*bytes.first_chunk()?, big))),
        ScalarType::F32 => f64::from(f32::from_le_bytes(swap(*bytes.first_chunk()?, big))),
        ScalarType::F64 => f64::from_le_bytes(swap(*bytes.first_chunk()?, big)),
    })
}

/// Appends `value` as the binary encoding stores it, least significant byte first; false if the type cannot hold it.
pub(super) fn encode(value: f64, kind: ScalarType, out: &mut Vec<u8>) -> bool {
    let range = match kind {
        ScalarType::I8 => f64::from(i8::MIN)..=f64::from(i8::MAX),
        ScalarType::U8 => 0.0..=f64::from(u8::MAX),
        ScalarType::I16 => f64::from(i16::MIN)..=f64::from(i16::MAX),
        ScalarType::U16 => 0.0..=f64::from(u16::MAX),
        ScalarType::I32 => f64::from(i32::MIN)..=f64::from(i32::MAX),
        ScalarType::U32 => 0.0..=f64::from(u32::MAX),
        ScalarType::F32 | ScalarType::F64 => f64::NEG_INFINITY..=f64::INFINITY,
    };
    if kind.is_integer() && !(range.contains(&value) && value.fract() == 0.0) {
        return false;
    }
    match kind {
        ScalarType::I8 => out.extend((value as i8).to_le_bytes()),
        ScalarType::U8 => out.push(value as u8),
        ScalarType::I16 => out.extend((value as i16).to_le_bytes()),
        ScalarType::U16 => out.extend((value as u16).to_le_bytes()),
        ScalarType::I32 => out.extend((value as i32).to_le_bytes()),
        ScalarType::U32 => out.extend((value as u32).to_le_bytes()),
        ScalarType::F32 => out.extend((value as f32).to_le_bytes()),
        ScalarType::F64 => out.extend(value.to_le_bytes()),
    }
    true
}
