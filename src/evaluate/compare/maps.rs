//! Two depth maps of the same view.

use super::{
    Catalog, Differences, Figure, Figures, Finder, FirstDifference, Shape, Tolerance, angle_deg, file_name,
    relative,
};
use crate::error::{Error, Result};
use crate::geometry::Camera;
use crate::scene::DepthEstimate;

/// What a comparison of folders of depth maps reports once; two files are folders of one.
pub const FOLDER_FIGURES: Catalog =
    &[("maps.both", Shape::One), ("maps.only_a", Shape::One), ("maps.only_b", Shape::One)];

/// What is reported of every pair of depth maps.
pub const MAP_FIGURES: Catalog = &[
    ("header.differing", Shape::One),
    ("planes.differing", Shape::One),
    ("camera.k", Shape::One),
    ("camera.rotation", Shape::One),
    ("camera.center", Shape::One),
    ("depth_range", Shape::One),
    ("valid.a", Shape::One),
    ("valid.b", Shape::One),
    ("valid.both", Shape::One),
    ("valid.iou", Shape::One),
    ("valid.same", Shape::One),
    ("depth", Shape::Relative),
    ("confidence", Shape::Relative),
    ("normal", Shape::Absolute),
];

/// The figures of folders with so many maps in both, in the first alone, in the second alone.
pub fn folder_figures(both: usize, only_a: usize, only_b: usize) -> Figures {
    let mut f = Figures::default();
    f.add("maps.both", Figure::Count(both as u64));
    f.add("maps.only_a", Figure::Count(only_a as u64));
    f.add("maps.only_b", Figure::Count(only_b as u64));
    f
}

/// How two depth maps of the same size differ.
#[derive(Clone, Debug, PartialEq)]
pub struct MapComparison {
    /// Columns of both.
    pub width: u32,
    /// Rows of both.
    pub height: u32,
    /// Fields of the header that differ, with both values. Of the image name only the file name counts.
    pub header: Vec<String>,
    /// Planes that only one of the two has: `normal`, `confidence`.
    pub planes: Vec<&'static str>,
    /// Largest difference of an entry of the intrinsic matrices, pixels.
    pub camera_k: f64,
    /// Angle between the rotations, degrees.
    pub camera_rotation: f64,
    /// Distance of the camera centres, scene units.
    pub camera_center: f64,
    /// Larger relative difference of the two ends of the depth range.
    pub depth_range: f64,
    /// Pixels valid in the first.
    pub valid_a: usize,
    /// Pixels valid in the second.
    pub valid_b: usize,
    /// Pixels valid in both.
    pub valid_both: usize,
    /// Relative differences of the depths valid in both.
    pub depth: Option<Differences>,
    /// Angles between the normals of pixels valid in both, degrees.
    pub normal: Option<Differences>,
    /// Relative differences of the confidences of pixels valid in both.
    pub confidence: Option<Differences>,
    /// The first pixel that differs by more than the tolerances.
    pub first: Option<FirstDifference>,
}

impl MapComparison {
    /// The numbers under their names.
    pub fn figures(&self) -> Figures {
        let pixels = self.width as usize * self.height as usize;
        let any = self.valid_a + self.valid_b - self.valid_both;
        let unequal = any - self.valid_both;
        let mut f = Figures::default();
        f.add("header.differing", Figure::Count(self.header.len() as u64));
        f.add("planes.differing", Figure::Count(self.planes.len() as u64));
        f.add("camera.k", Figure::Number(self.camera_k));
        f.add("camera.rotation", Figure::Number(self.camera_rotation));
        f.add("camera.center", Figure::Number(self.camera_center));
        f.add("depth_range", Figure::Number(self.depth_range));
        f.add("valid.a", Figure::Count(self.valid_a as u64));
        f.add("valid.b", Figure::Count(self.valid_b as u64));
        f.add("valid.both", Figure::Count(self.valid_both as u64));
        f.add("valid.iou", Figure::share(self.valid_both, any));
        f.add("valid.same", Figure::share(pixels - unequal, pixels));
        f.add("depth", self.depth.map(Figure::Relative));
        f.add("confidence", self.confidence.map(Figure::Relative));
        f.add("normal", self.normal.map(Figure::Absolute));
        f
    }

    /// What the numbers do not say.
    pub fn notes(&self) -> Vec<String> {
        let planes = self.planes.iter().map(|plane| format!("only one has a {plane} map"));
        self.header.iter().cloned().chain(planes).collect()
    }
}

/// Compares two depth maps pixel by pixel; depths that are not finite and positive are invalid.
///
/// # Errors
/// [`Error::Invalid`] for maps of different sizes and bad tolerances.
pub fn compare_maps(a: &DepthEstimate, b: &DepthEstimate, tolerance: &Tolerance) -> Result<MapComparison> {
    tolerance.check()?;
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
    let (mut valid_a, mut valid_b, mut first) = (0, 0, Finder::default());
    let width = size_a.width.max(1) as usize;
    for (i, (&da, &db)) in a.depth.data().iter().zip(b.depth.data()).enumerate() {
        let [in_a, in_b] = [da, db].map(valid);
        valid_a += usize::from(in_a);
        valid_b += usize::from(in_b);
        let place = || format!("pixel ({}, {})", i % width, i / width);
        if !(in_a && in_b) {
            first.note(in_a != in_b, place, "depth", &da, &db);
            continue;
        }
        let difference = relative(da, db);
        depth.push(difference);
        first.note(difference > tolerance.relative, place, "depth", &da, &db);
        if let Some((na, nb)) = normals.map(|(a, b)| (a.data()[i], b.data()[i])) {
            let difference = angle_deg(na, nb);
            normal.push(difference);
            first.note(difference > tolerance.angle, place, "normal", &na, &nb);
        }
        if let Some((ca, cb)) = confidences.map(|(a, b)| (a.data()[i], b.data()[i])) {
            let difference = relative(ca, cb);
            confidence.push(difference);
            first.note(difference > tolerance.relative, place, "confidence", &ca, &cb);
        }
    }
    let planes = [
        ("normal", &a.normal.is_some(), &b.normal.is_some()),
        ("confidence", &a.confidence.is_some(), &b.confidence.is_some()),
    ];
    let (camera_k, camera_rotation, camera_center) = camera_differences(&a.camera, &b.camera);
    Ok(MapComparison {
        width: size_a.width,
        height: size_a.height,
        header: header_differences(a, b),
        planes: planes.into_iter().filter(|(_, a, b)| a != b).map(|(name, ..)| name).collect(),
        camera_k,
        camera_rotation,
        camera_center,
        depth_range: relative(a.depth_range.0, b.depth_range.0)
            .max(relative(a.depth_range.1, b.depth_range.1)),
        valid_a,
        valid_b,
        valid_both: depth.len(),
        depth: Differences::of(depth),
        normal: Differences::of(normal),
        confidence: Differences::of(confidence),
        first: first.0,
    })
}

/// Largest difference of the intrinsics in pixels, angle between the rotations in degrees, distance of the centres.
fn camera_differences(a: &Camera, b: &Camera) -> (f64, f64, f64) {
    let k = (a.k() - b.k()).abs().max();
    (k, super::rotation_deg(a.rotation(), b.rotation()), (a.center() - b.center()).norm())
}

fn header_differences(a: &DepthEstimate, b: &DepthEstimate) -> Vec<String> {
    let ids = |e: &DepthEstimate| e.source_ids.iter().map(|id| id.0).collect::<Vec<_>>();
    let mut differences = Vec::new();
    let mut field = |differs: bool, name: &str, a: &dyn std::fmt::Debug, b: &dyn std::fmt::Debug| {
        if differs {
            differences.push(format!("{name}: {a:?} in A, {b:?} in B"));
        }
    };
    field(a.image_id != b.image_id, "image id", &a.image_id.0, &b.image_id.0);
    field(file_name(&a.image_name) != file_name(&b.image_name), "image name", &a.image_name, &b.image_name);
    field(a.source_ids != b.source_ids, "source ids", &ids(a), &ids(b));
    field(a.depth_range != b.depth_range, "depth range", &a.depth_range, &b.depth_range);
    if a.camera != b.camera {
        differences.push("camera: see camera.k, camera.rotation, camera.center".to_owned());
    }
    differences
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
        let c = compare_maps(&map, &map, &Tolerance::default()).unwrap();
        assert_eq!((c.valid_a, c.valid_b, c.valid_both), (2, 2, 2));
        assert_eq!((c.depth.unwrap().max, c.normal.unwrap().max, c.confidence.unwrap().max), (0.0, 0.0, 0.0));
        assert_eq!((&c.first, c.header.len(), c.planes.len()), (&None, 0, 0));
        assert_eq!((c.camera_k, c.camera_rotation, c.camera_center, c.depth_range), (0.0, 0.0, 0.0, 0.0));
        let reported: Vec<String> = c.figures().numbers().into_iter().map(|(name, _)| name).collect();
        assert_eq!(reported, crate::evaluate::names(MAP_FIGURES));
        let folder: Vec<String> =
            folder_figures(3, 1, 2).numbers().into_iter().map(|(name, _)| name).collect();
        assert_eq!(folder, crate::evaluate::names(FOLDER_FIGURES));
    }

    #[test]
    fn differences_are_counted_and_the_first_is_named() {
        let a = estimate(3, &[1.0, 2.0, 0.0, 4.0, 5.0, 6.0]);
        let mut b = estimate(3, &[1.0, 2.5, 3.0, 4.0, 0.0, 6.0]);
        b.normal.as_mut().unwrap()[(2, 1)] = [0.0, -1.0, 0.0];
        b.confidence = None;
        b.source_ids.clear();
        b.image_name = "images/3.jpg".into();
        let c = compare_maps(&a, &b, &Tolerance::default()).unwrap();
        assert_eq!((c.valid_a, c.valid_b, c.valid_both), (5, 5, 4));
        let figures = c.figures();
        assert_eq!(figures.get("valid.same"), Some(Figure::Number(4.0 / 6.0)));
        assert_eq!(figures.get("valid.iou"), Some(Figure::Number(4.0 / 6.0)));
        let depth = c.depth.unwrap();
        assert_eq!((depth.compared, depth.equal, depth.max), (4, 3, 0.2));
        assert_eq!((c.normal.unwrap().equal, c.normal.unwrap().max), (3, 90.0));
        assert_eq!((c.confidence, c.notes().len()), (None, 2));
        assert_eq!(c.notes()[0], "source ids: [1] in A, [] in B");
        let first = c.first.unwrap();
        assert_eq!(
            (first.place.as_str(), first.attribute, first.a.as_str(), first.b.as_str()),
            ("pixel (1, 0)", "depth", "2.0", "2.5")
        );
        let lenient = Tolerance { relative: 0.3, ..Default::default() };
        let first = compare_maps(&a, &b, &lenient).unwrap().first.unwrap();
        assert_eq!(first.place, "pixel (2, 0)", "valid in one alone");
    }

    #[test]
    fn cameras_and_ranges_are_measured() {
        let a = estimate(2, &[1.0; 4]);
        let mut b = a.clone();
        let turned = nalgebra::Rotation3::from_euler_angles(0.0, 0.0, 0.01).into_inner();
        let k = Matrix3::new(1.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        b.camera = Camera::new(a.depth.size(), k, turned, Vector3::new(3.0, 0.0, 4.0));
        b.depth_range = (1.0, 10.0);
        let c = compare_maps(&a, &b, &Tolerance::default()).unwrap();
        assert_eq!((c.camera_k, c.camera_center), (0.5, 5.0));
        assert!((c.camera_rotation - 0.01f64.to_degrees()).abs() < 1e-9, "{}", c.camera_rotation);
        assert!((c.depth_range - 0.1).abs() < 1e-9 && c.header.len() == 2, "{c:?}");
    }

    #[test]
    fn maps_of_different_sizes_cannot_be_compared() {
        let error = compare_maps(&estimate(2, &[1.0; 4]), &estimate(4, &[1.0; 4]), &Tolerance::default());
        assert!(error.unwrap_err().to_string().contains("2 x 2 and of 4 x 1"));
    }
}
