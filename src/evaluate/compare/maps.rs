//! Two depth maps of the same view.

use super::{CompareOptions, Differences, FirstDifference, angle_deg, relative};
use crate::error::{Error, Result};
use crate::scene::DepthEstimate;
use serde::Serialize;

/// How two depth maps of the same size differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MapComparison {
    /// Columns of both.
    pub width: u32,
    /// Rows of both.
    pub height: u32,
    /// Fields of the header that differ: `image_id`, `image_name`, `source_ids`, `camera`, `depth_range`.
    pub header: Vec<&'static str>,
    /// Planes that only one of the two has: `normal`, `confidence`.
    pub planes: Vec<&'static str>,
    /// Pixels valid in the first.
    pub valid_a: usize,
    /// Pixels valid in the second.
    pub valid_b: usize,
    /// Pixels valid in both.
    pub valid_both: usize,
    /// Share of all pixels that are valid in both or in neither.
    pub same_validity: f64,
    /// Relative differences of the depths valid in both.
    pub depth: Option<Differences>,
    /// Angles between the normals of pixels valid in both, degrees.
    pub normal: Option<Differences>,
    /// Relative differences of the confidences of pixels valid in both.
    pub confidence: Option<Differences>,
    /// The first pixel that differs by more than the tolerances.
    pub first: Option<FirstDifference>,
}

/// Compares two depth maps pixel by pixel; depths that are not finite and positive are invalid.
///
/// # Errors
/// [`Error::Invalid`] for maps of different sizes and bad tolerances.
pub fn compare_maps(a: &DepthEstimate, b: &DepthEstimate, options: &CompareOptions) -> Result<MapComparison> {
    options.check()?;
    let (size_a, size_b) = (a.depth.size(), b.depth.size());
    if size_a != size_b {
        return Err(Error::invalid(format!(
            "maps of {} x {} and of {} x {} pixels cannot be compared; use maps of one resolution",
            size_a.width, size_a.height, size_b.width, size_b.height
        )));
    }
    let valid = |depth: f32| depth.is_finite() && depth > 0.0;
    let normals = a.normal.as_ref().zip(b.normal.as_ref());
    let confidences = a.confidence.as_ref().zip(b.confidence.as_ref());
    let (mut depth, mut normal, mut confidence) = (Vec::new(), Vec::new(), Vec::new());
    let (mut valid_a, mut valid_b, mut first) = (0, 0, None);
    for (i, (&da, &db)) in a.depth.data().iter().zip(b.depth.data()).enumerate() {
        let [in_a, in_b] = [da, db].map(valid);
        valid_a += usize::from(in_a);
        valid_b += usize::from(in_b);
        let mut differs = |is: bool, what: &'static str, a: &dyn std::fmt::Debug, b: &dyn std::fmt::Debug| {
            if is && first.is_none() {
                first = Some(FirstDifference::new(i, what, &a, &b));
            }
        };
        if !(in_a && in_b) {
            differs(in_a != in_b, "depth", &da, &db);
            continue;
        }
        let difference = relative(da, db);
        depth.push(difference);
        differs(difference > options.depth, "depth", &da, &db);
        if let Some((na, nb)) = normals.map(|(a, b)| (a.data()[i], b.data()[i])) {
            let difference = angle_deg(na, nb);
            normal.push(difference);
            differs(difference > options.normal_deg, "normal", &na, &nb);
        }
        if let Some((ca, cb)) = confidences.map(|(a, b)| (a.data()[i], b.data()[i])) {
            let difference = relative(ca, cb);
            confidence.push(difference);
            differs(difference > options.confidence, "confidence", &ca, &cb);
        }
    }
    let valid_both = depth.len();
    let unequal = valid_a + valid_b - 2 * valid_both;
    let pixels = size_a.area();
    Ok(MapComparison {
        width: size_a.width,
        height: size_a.height,
        header: header_differences(a, b),
        planes: [
            ("normal", a.normal.is_some() != b.normal.is_some()),
            ("confidence", a.confidence.is_some() != b.confidence.is_some()),
        ]
        .into_iter()
        .filter_map(|(name, differs)| differs.then_some(name))
        .collect(),
        valid_a,
        valid_b,
        valid_both,
        same_validity: if pixels > 0 { (pixels - unequal) as f64 / pixels as f64 } else { 1.0 },
        depth: Differences::of(depth),
        normal: Differences::of(normal),
        confidence: Differences::of(confidence),
        first,
    })
}

fn header_differences(a: &DepthEstimate, b: &DepthEstimate) -> Vec<&'static str> {
    let fields = [
        ("image_id", a.image_id != b.image_id),
        ("image_name", a.image_name != b.image_name),
        ("source_ids", a.source_ids != b.source_ids),
        ("camera", a.camera != b.camera),
        ("depth_range", a.depth_range != b.depth_range),
    ];
    fields.into_iter().filter_map(|(name, differs)| differs.then_some(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Camera, Size};
    use crate::scene::{Grid, ImageId};
    use nalgebra::{Matrix3, Vector3};

    fn estimate(width: u32, depth: &[f32]) -> DepthEstimate {
        let size = Size { width, height: depth.len() as u32 / width };
        DepthEstimate {
            image_id: ImageId(3),
            image_name: "3.jpg".into(),
            source_ids: vec![ImageId(1)],
            camera: Camera::new(size, Matrix3::identity(), Matrix3::identity(), Vector3::zeros()),
            depth_range: (1.0, 9.0),
            depth: Grid::from_vec(size, depth.to_vec()).unwrap(),
            normal: Some(Grid::filled(size, [0.0, 0.0, -1.0])),
            confidence: Some(Grid::filled(size, 0.5)),
        }
    }

    #[test]
    fn equal_maps_differ_in_nothing() {
        let map = estimate(2, &[1.0, 0.0, 2.0, f32::NAN]);
        let c = compare_maps(&map, &map, &CompareOptions::default()).unwrap();
        assert_eq!((c.valid_a, c.valid_b, c.valid_both, c.same_validity), (2, 2, 2, 1.0));
        assert_eq!((c.depth.unwrap().max, c.normal.unwrap().max, c.confidence.unwrap().max), (0.0, 0.0, 0.0));
        assert_eq!((c.first, c.header.len(), c.planes.len()), (None, 0, 0));
    }

    #[test]
    fn differences_are_counted_and_the_first_is_named() {
        let a = estimate(3, &[1.0, 2.0, 0.0, 4.0, 5.0, 6.0]);
        let mut b = estimate(3, &[1.0, 2.5, 3.0, 4.0, 0.0, 6.0]);
        b.normal.as_mut().unwrap()[(2, 1)] = [0.0, -1.0, 0.0];
        b.confidence = None;
        b.source_ids.clear();
        let c = compare_maps(&a, &b, &CompareOptions::default()).unwrap();
        assert_eq!((c.valid_a, c.valid_b, c.valid_both, c.same_validity), (5, 5, 4, 4.0 / 6.0));
        let depth = c.depth.unwrap();
        assert_eq!((depth.compared, depth.equal, depth.max), (4, 3, 0.2));
        assert_eq!((c.normal.unwrap().equal, c.normal.unwrap().max), (3, 90.0));
        assert_eq!((c.confidence, c.header, c.planes), (None, vec!["source_ids"], vec!["confidence"]));
        let first = c.first.unwrap();
        assert_eq!(
            (first.index, first.attribute, first.a.as_str(), first.b.as_str()),
            (1, "depth", "2.0", "2.5")
        );
        let lenient = CompareOptions { depth: 0.3, ..Default::default() };
        assert_eq!(compare_maps(&a, &b, &lenient).unwrap().first.unwrap().index, 2, "valid in one alone");
    }

    #[test]
    fn maps_of_different_sizes_cannot_be_compared() {
        let error =
            compare_maps(&estimate(2, &[1.0; 4]), &estimate(4, &[1.0; 4]), &CompareOptions::default());
        assert!(error.unwrap_err().to_string().contains("2 x 2 and of 4 x 1"));
    }
}
