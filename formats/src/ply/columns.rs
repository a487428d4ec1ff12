//! The columns of a cloud, from the records of its vertices.

use super::cloud::Cloud;
use super::header::{Element, PropertyType, ScalarType, broken};
use super::record::{Block, Place, RecordLayout};
use crate::Result;
use crate::source::grow;

/// The properties that a [`Cloud`] has a column for.
pub(super) struct Columns {
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
    pub(super) fn new(element: &Element, layout: &RecordLayout, offset: u64) -> Result<Self> {
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
    pub(super) fn decode(&self, block: Block<'_>, cloud: &mut Cloud, first: u64, at: u64) -> Result<()> {
        vectors(block, self.position, &mut cloud.positions);
        if self.wide {
            triples(block, self.position, &mut cloud.positions_f64, 0.0, |v| v);
        }
        if let Some(places) = self.color {
            grow(&mut cloud.colors, block.len());
            if !block.packed::<1>(places, ScalarType::U8, |c| cloud.colors.push(c.map(|[v]| v))) {
                triples(block, places, &mut cloud.colors, 0, |v| v as u8);
            }
        }
        if let Some(places) = self.normal {
            vectors(block, places, &mut cloud.normals);
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
            let count = block
                .plain_list(index, views, ScalarType::U32, &mut lists.images, u32::from_le_bytes)
                .unwrap_or_else(|| block.list(index, views, &mut lists.images, |v| v as u32));
            if !unsigned {
                let mut stored = Vec::with_capacity(count);
                block.list(index, views, &mut stored, |v| v);
                if let Some(v) = stored.iter().find(|v| !is_index(**v, f64::from(u32::MAX))) {
                    return Err(broken(at, field("view_indices"), format!("{v} is not an image index")));
                }
            }
            if let Some(weights) = self.weights {
                let weights = block
                    .plain_list(index, weights, ScalarType::F32, &mut lists.weights, f32::from_le_bytes)
                    .unwrap_or_else(|| block.list(index, weights, &mut lists.weights, |w| w as f32));
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

/// Appends three properties of every record as a vector.
fn vectors(block: Block<'_>, places: [Place; 3], out: &mut Vec<[f32; 3]>) {
    grow(out, block.len());
    if !block.packed::<4>(places, ScalarType::F32, |v| out.push(v.map(f32::from_le_bytes))) {
        triples(block, places, out, 0.0, |v| v as f32);
    }
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
