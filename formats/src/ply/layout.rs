//! Which columns a written cloud has, in which order and under which type names.

use super::header::{Element, Encoding, Header, Property, PropertyType, ScalarType, TypeNames};

/// One or more properties that are written together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// `x y z`, 32-bit.
    Position,
    /// `x y z`, 64-bit; from [`Cloud::positions_f64`](super::Cloud::positions_f64) if there, else widened.
    PositionF64,
    /// `red green blue`, 8-bit.
    Color,
    /// `nx ny nz`, 32-bit.
    Normal,
    /// `label`, 8-bit; ids above 255 are an error.
    LabelU8,
    /// `label`, 16-bit.
    LabelU16,
    /// `label_confidence`, 32-bit.
    LabelConfidence,
    /// `views`, 8-bit: the number of views, at most 255; the count that OpenDroneMap's point filter reads.
    ViewCount,
    /// `view_indices`: list of 32-bit image indices, at most 255.
    ViewIndices,
    /// `view_weights`: list of 32-bit weights, one per index.
    ViewWeights,
    /// `confidence`, 32-bit, of a scale export.
    Confidence,
    /// `value`, 32-bit, of a scale export.
    Value,
}

impl Field {
    fn properties(self) -> (&'static [&'static str], PropertyType) {
        use ScalarType::{F32, F64, U8, U16, U32};
        let scalar = PropertyType::Scalar;
        match self {
            Field::Position => (&["x", "y", "z"], scalar(F32)),
            Field::PositionF64 => (&["x", "y", "z"], scalar(F64)),
            Field::Color => (&["red", "green", "blue"], scalar(U8)),
            Field::Normal => (&["nx", "ny", "nz"], scalar(F32)),
            Field::LabelU8 => (&["label"], scalar(U8)),
            Field::LabelU16 => (&["label"], scalar(U16)),
            Field::LabelConfidence => (&["label_confidence"], scalar(F32)),
            Field::ViewCount => (&["views"], scalar(U8)),
            Field::ViewIndices => (&["view_indices"], PropertyType::List { count: U8, item: U32 }),
            Field::ViewWeights => (&["view_weights"], PropertyType::List { count: U8, item: F32 }),
            Field::Confidence => (&["confidence"], scalar(F32)),
            Field::Value => (&["value"], scalar(F32)),
        }
    }
}

/// How a cloud is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// [`Encoding::LittleEndian`] or [`Encoding::Ascii`]; big-endian files are read, not written.
    pub encoding: Encoding,
    /// Names of the types in the header.
    pub type_names: TypeNames,
    /// Columns in file order.
    pub fields: Vec<Field>,
    /// Header comments, one line each.
    pub comments: Vec<String>,
}

impl Layout {
    fn new(type_names: TypeNames, fields: Vec<Field>) -> Self {
        Layout { encoding: Encoding::LittleEndian, type_names, fields, comments: Vec::new() }
    }

    /// The layout of OpenMVS's dense clouds: position, colour, normal, lists of views and their weights.
    pub fn openmvs(colors: bool, normals: bool, weights: bool) -> Self {
        let fields = [
            (Field::Position, true),
            (Field::Color, colors),
            (Field::Normal, normals),
            (Field::ViewIndices, true),
            (Field::ViewWeights, weights),
        ];
        Layout::new(TypeNames::Sized, fields.into_iter().filter(|f| f.1).map(|f| f.0).collect())
    }

    /// A layout without lists that every viewer opens: position, colour, normal.
    pub fn plain(colors: bool, normals: bool) -> Self {
        let fields = [(Field::Position, true), (Field::Color, colors), (Field::Normal, normals)];
        Layout::new(TypeNames::Legacy, fields.into_iter().filter(|f| f.1).map(|f| f.0).collect())
    }

    /// The only layout that OpenDroneMap's point filter reads. It takes no comments and no other properties.
    pub fn odm() -> Self {
        let fields = vec![Field::Position, Field::Color, Field::Normal, Field::ViewCount];
        Layout::new(TypeNames::Sized, fields)
    }

    /// The layout of COLMAP's `fused.ply`: position, normal, colour.
    pub fn colmap() -> Self {
        Layout::new(TypeNames::Legacy, vec![Field::Position, Field::Normal, Field::Color])
    }

    /// The same with a label (8-bit unless `wide`) and, if asked for, its confidence, after the colours and normals and
    /// before everything else.
    pub fn with_label(mut self, wide: bool, confidence: bool) -> Self {
        use Field::{Color, Normal, Position, PositionF64};
        let geometry = |f: &Field| matches!(f, Position | PositionF64 | Color | Normal);
        let at = self.fields.iter().take_while(|f| geometry(f)).count();
        if confidence {
            self.fields.insert(at, Field::LabelConfidence);
        }
        self.fields.insert(at, if wide { Field::LabelU16 } else { Field::LabelU8 });
        self
    }

    /// The same with 64-bit positions.
    pub fn with_f64_positions(mut self) -> Self {
        for field in &mut self.fields {
            if *field == Field::Position {
                *field = Field::PositionF64;
            }
        }
        self
    }

    /// The same with header comments.
    pub fn with_comments(mut self, comments: impl IntoIterator<Item = String>) -> Self {
        self.comments.extend(comments);
        self
    }

    /// The header of a file of `count` points.
    pub fn header(&self, count: u64) -> Header {
        let property = |(names, kind): (&'static [&'static str], PropertyType)| {
            names.iter().map(move |&name| Property { name: name.to_owned(), kind })
        };
        let properties = self.fields.iter().flat_map(|f| property(f.properties())).collect();
        let vertex = Element { name: "vertex".into(), count, properties };
        Header { encoding: self.encoding, comments: self.comments.clone(), elements: vec![vertex] }
    }
}
