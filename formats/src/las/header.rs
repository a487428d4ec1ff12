//! The header of a LAS file: public header block and variable length records.

use super::Frame;
use crate::{Error, Result};
use laz::{LazItemRecordBuilder, LazItemType, LazVlr};

/// An attribute of every point that the record format lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Extra {
    /// `NormalX`, `NormalY`, `NormalZ`, 32-bit real: the names that CloudCompare and PDAL know.
    Normal,
    /// `label`, 16-bit: class id, 0 = void.
    Label,
    /// `label_confidence`, 32-bit real, 0..1.
    LabelConfidence,
    /// `confidence`, 32-bit real.
    Confidence,
    /// `views`, 16-bit: number of views that see the point.
    Views,
}

/// Type codes of extra bytes.
const U16: u8 = 3;
const F32: u8 = 9;

impl Extra {
    /// Names, type code and description of the dimensions it stands for.
    fn dimensions(self) -> (&'static [&'static str], u8, &'static str) {
        match self {
            Extra::Normal => (&["NormalX", "NormalY", "NormalZ"], F32, "unit normal"),
            Extra::Label => (&["label"], U16, "class id, 0 = void"),
            Extra::LabelConfidence => (&["label_confidence"], F32, "share of votes for the label"),
            Extra::Confidence => (&["confidence"], F32, "confidence of the depth"),
            Extra::Views => (&["views"], U16, "number of images that see it"),
        }
    }

    /// Bytes per point.
    pub(super) fn len(self) -> usize {
        let (names, kind, _) = self.dimensions();
        names.len() * if kind == U16 { 2 } else { 4 }
    }
}

/// What is stored of every point besides position and classification.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layout {
    /// Compress the points (LAZ). Default: false.
    pub compressed: bool,
    /// Colours: record format 7 in place of 6.
    pub colors: bool,
    /// Further attributes in file order.
    pub extras: Vec<Extra>,
    /// What classification codes mean, for the file's table of classifications; of a code given twice the first counts.
    pub class_names: Vec<(u8, String)>,
}

impl Layout {
    /// Bytes of a point before compression.
    pub(super) fn record_len(&self) -> usize {
        let fixed = if self.colors { 36 } else { 30 };
        fixed + self.extra_len()
    }

    fn extra_len(&self) -> usize {
        self.extras.iter().map(|extra| extra.len()).sum()
    }

    /// What the compressor makes of a record.
    pub(super) fn laz(&self) -> LazVlr {
        let mut items = LazItemRecordBuilder::new();
        items.add_item(LazItemType::Point14);
        if self.colors {
            items.add_item(LazItemType::RGB14);
        }
        if self.extra_len() > 0 {
            items.add_item(LazItemType::Byte14(self.extra_len() as u16));
        }
        LazVlr::from_laz_items(items.build())
    }

    /// The variable length records.
    fn records(&self) -> Result<Vec<Record>> {
        let mut records = Vec::new();
        if !self.class_names.is_empty() {
            records.push(self.class_lookup());
        }
        if !self.extras.is_empty() {
            records.push(self.extra_bytes());
        }
        if self.compressed {
            let mut data = Vec::new();
            self.laz().write_to(&mut data).map_err(|e| Error::Unsupported(e.to_string()))?;
            let (user, id) = (LazVlr::USER_ID, LazVlr::RECORD_ID);
            records.push(Record { user, id, description: "compressed points", data });
        }
        Ok(records)
    }

    /// 256 entries of a code and 15 bytes of text.
    fn class_lookup(&self) -> Record {
        const ENTRY: usize = 16;
        let mut data = vec![0; 256 * ENTRY];
        for code in 0..=u8::MAX {
            let entry = &mut data[usize::from(code) * ENTRY..][..ENTRY];
            entry[0] = code;
            if let Some((_, name)) = self.class_names.iter().find(|(named, _)| *named == code) {
                put_text(&mut entry[1..], name);
            }
        }
        Record { user: "LASF_Spec", id: 0, description: "classification lookup", data }
    }

    /// 192 bytes per dimension.
    fn extra_bytes(&self) -> Record {
        const ENTRY: usize = 192;
        let mut data = Vec::new();
        for extra in &self.extras {
            let (names, kind, description) = extra.dimensions();
            for name in names {
                let mut entry = [0; ENTRY];
                entry[2] = kind;
                put_text(&mut entry[4..36], name);
                put_text(&mut entry[ENTRY - 32..], description);
                data.extend(entry);
            }
        }
        Record { user: "LASF_Spec", id: 4, description: "extra bytes", data }
    }
}

/// Copies as much of `text` as fits, cut between characters.
fn put_text(out: &mut [u8], text: &str) {
    let mut end = text.len().min(out.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    out[..end].copy_from_slice(&text.as_bytes()[..end]);
}

/// A variable length record.
struct Record {
    user: &'static str,
    id: u16,
    description: &'static str,
    data: Vec<u8>,
}

/// Bytes of a variable length record before its data.
const RECORD_HEADER: usize = 54;
/// Bytes of the public header block of LAS 1.4.
const PUBLIC_HEADER: usize = 375;

/// What a file says of itself; all of it is known before the first point.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// How coordinates are stored.
    pub frame: Frame,
    /// Least and largest coordinates.
    pub bounds: [[f64; 3]; 2],
    /// Number of points.
    pub points: u64,
    /// Program that makes the file; 32 bytes of it are kept.
    pub software: String,
}

impl Header {
    /// The bytes before the first point.
    pub(super) fn encode(&self, layout: &Layout) -> Result<Vec<u8>> {
        /// A well-known text describes the coordinate system: the rule for these record formats, also without one.
        const WKT: u16 = 16;
        /// Every point is the only return of its pulse.
        const RETURNS: usize = 15;
        let records = layout.records()?;
        let to_points: usize = records.iter().map(|r| RECORD_HEADER + r.data.len()).sum();
        let mut out = Vec::with_capacity(PUBLIC_HEADER + to_points);
        out.extend(b"LASF");
        out.extend(0_u16.to_le_bytes());
        out.extend(WKT.to_le_bytes());
        out.extend([0; 16]);
        out.extend([1, 4]);
        out.extend(text::<32>("photogrammetry"));
        out.extend(text::<32>(&self.software));
        // Day and year of creation are left open.
        out.extend([0; 4]);
        out.extend((PUBLIC_HEADER as u16).to_le_bytes());
        out.extend(((PUBLIC_HEADER + to_points) as u32).to_le_bytes());
        out.extend((records.len() as u32).to_le_bytes());
        let format: u8 = if layout.colors { 7 } else { 6 };
        out.push(if layout.compressed { format | 0x80 } else { format });
        out.extend((layout.record_len() as u16).to_le_bytes());
        // Counts of older versions, which must be 0 with these record formats.
        out.extend([0; 4 * 6]);
        out.extend([self.frame.scale; 3].into_iter().chain(self.frame.offset).flat_map(f64::to_le_bytes));
        for axis in 0..3 {
            for bound in [self.bounds[1][axis], self.bounds[0][axis]] {
                let steps = self.frame.quantize(axis, bound).unwrap_or_default();
                out.extend(self.frame.coordinate(axis, steps).to_le_bytes());
            }
        }
        // No waveforms and no records behind the points.
        out.extend([0; 8 + 8 + 4]);
        out.extend([self.points; 2].into_iter().flat_map(u64::to_le_bytes));
        out.extend([0; 8 * (RETURNS - 1)]);
        for record in records {
            out.extend(0_u16.to_le_bytes());
            out.extend(text::<16>(record.user));
            out.extend(record.id.to_le_bytes());
            out.extend((record.data.len() as u16).to_le_bytes());
            out.extend(text::<32>(record.description));
            out.extend(record.data);
        }
        Ok(out)
    }
}

/// `text` in a field of `N` bytes.
fn text<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    put_text(&mut field, text);
    field
}
