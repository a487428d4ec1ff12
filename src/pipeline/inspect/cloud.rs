//! What is in a PLY file.

use super::bytes_of;
use super::values::{Bounds, Range, RangeOf};
use crate::error::{Error, Result};
use semvs_formats::Limits;
use semvs_formats::ply::{Cloud, Encoding, Header, PointReader, PropertyType, TypeNames};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

/// A `.ply` file.
#[derive(Clone, Debug, Serialize)]
pub struct CloudFacts {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub bytes: u64,
    /// `ascii`, `binary little endian` or `binary big endian`.
    pub encoding: &'static str,
    /// Points.
    pub points: u64,
    /// Properties of a point in file order, such as `float32 x` or `list uint8 uint32 view_indices`.
    pub properties: Vec<String>,
    /// Other elements and their numbers of records.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub elements: BTreeMap<String, u64>,
    /// Header comments.
    pub comments: Vec<String>,
    /// Box around the points.
    pub bounds: Option<Bounds>,
    /// Images per point.
    pub views: Option<Range>,
    /// Points by class id.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub labels: BTreeMap<u16, u64>,
    /// How sure the labels are.
    pub label_confidence: Option<Range>,
}

/// Points read at a time.
const CHUNK: usize = 1 << 16;

pub(super) fn inspect(path: &Path) -> Result<CloudFacts> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    let broken = |e| Error::format(path, e);
    let mut reader = PointReader::new(file, &Limits::default()).map_err(broken)?;
    let mut facts = facts_of(reader.header(), path)?;
    let (mut views, mut confidence) = (RangeOf::new(), RangeOf::new());
    let mut chunk = Cloud::default();
    while reader.read(&mut chunk, CHUNK).map_err(broken)? > 0 {
        let positions: Vec<[f64; 3]> = match chunk.positions_f64.is_empty() {
            true => chunk.positions.iter().map(|p| p.map(f64::from)).collect(),
            false => chunk.positions_f64.clone(),
        };
        facts.points += positions.len() as u64;
        facts.bounds = Bounds::join(facts.bounds, Bounds::of(positions));
        if chunk.has_views() {
            (0..chunk.len()).for_each(|i| views.add(chunk.images_of(i).len() as f64));
        }
        chunk.view_counts.iter().for_each(|&n| views.add(f64::from(n)));
        chunk.labels.iter().for_each(|&label| *facts.labels.entry(label).or_default() += 1);
        chunk.label_confidence.iter().for_each(|&c| confidence.add(f64::from(c)));
        chunk.clear();
    }
    facts.views = views.range();
    facts.label_confidence = confidence.range();
    Ok(facts)
}

fn facts_of(header: &Header, path: &Path) -> Result<CloudFacts> {
    let vertex = header.element("vertex");
    let name = |p: &semvs_formats::ply::Property| match p.kind {
        PropertyType::Scalar(kind) => format!("{} {}", kind.name(TypeNames::Sized), p.name),
        PropertyType::List { count, item } => {
            format!("list {} {} {}", count.name(TypeNames::Sized), item.name(TypeNames::Sized), p.name)
        }
    };
    Ok(CloudFacts {
        file: path.display().to_string(),
        bytes: bytes_of(path)?,
        encoding: match header.encoding {
            Encoding::Ascii => "ascii",
            Encoding::LittleEndian => "binary little endian",
            Encoding::BigEndian => "binary big endian",
        },
        points: 0,
        properties: vertex.map(|v| v.properties.iter().map(name).collect()).unwrap_or_default(),
        elements: header
            .elements
            .iter()
            .filter(|e| e.name != "vertex")
            .map(|e| (e.name.clone(), e.count))
            .collect(),
        comments: header.comments.clone(),
        bounds: None,
        views: None,
        labels: BTreeMap::new(),
        label_confidence: None,
    })
}
