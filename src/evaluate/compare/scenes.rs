//! Two scenes: cameras, neighbours, sparse points, region.

use super::clouds::{diagonal, share};
use super::{
    Catalog, CloudComparison, Differences, Figure, Figures, Finder, FirstDifference, Shape, Tolerance,
    compare_clouds, file_name, relative, rotation_deg,
};
use crate::error::Result;
use crate::geometry::{Roi, Size};
use crate::scene::{Calibration, ImageId, Neighbor, PointCloud};

/// What a comparison of scenes reports. Images are compared by their position in the file; of their names and masks only
/// the file name counts.
pub const SCENE_FIGURES: Catalog = &[
    ("platforms.a", Shape::One),
    ("platforms.b", Shape::One),
    ("images.a", Shape::One),
    ("images.b", Shape::One),
    ("images.other_name", Shape::One),
    ("images.other_mask", Shape::One),
    ("images.other_id", Shape::One),
    ("images.calibrated_in_one", Shape::One),
    ("camera.size_differs", Shape::One),
    ("camera.k", Shape::Absolute),
    ("camera.rotation", Shape::Absolute),
    ("camera.center", Shape::Absolute),
    ("depth.min", Shape::Relative),
    ("depth.avg", Shape::Relative),
    ("depth.max", Shape::Relative),
    ("neighbors.lists", Shape::One),
    ("neighbors.same_order", Shape::One),
    ("neighbors.only_a", Shape::One),
    ("neighbors.only_b", Shape::One),
    ("neighbors.same_points", Shape::One),
    ("neighbors.score", Shape::Relative),
    ("neighbors.scale", Shape::Relative),
    ("neighbors.angle", Shape::Relative),
    ("neighbors.area", Shape::Relative),
    ("points.a", Shape::One),
    ("points.b", Shape::One),
    ("points.position", Shape::Absolute),
    ("points.views_same", Shape::One),
    ("points.weights", Shape::Relative),
    ("points.color", Shape::Absolute),
    ("points.normal", Shape::Absolute),
    ("roi.in_one", Shape::One),
    ("roi.rotation", Shape::One),
    ("roi.center", Shape::One),
    ("roi.extent", Shape::One),
    ("transform", Shape::One),
];

/// What of a scene is compared.
#[derive(Clone, Debug, Default)]
pub struct ComparedScene {
    /// Number of platforms.
    pub platforms: usize,
    /// Images in file order.
    pub images: Vec<ComparedImage>,
    /// The scene's points, views ascending.
    pub points: PointCloud,
    /// Region of interest.
    pub roi: Option<Roi>,
    /// Row-major 4×4.
    pub transform: [f64; 16],
}

/// What of an image is compared.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparedImage {
    /// Path as the scene names it.
    pub name: String,
    /// Mask path, empty = none.
    pub mask: String,
    /// Global ID.
    pub id: ImageId,
    /// Pose and intrinsics; `None` if uncalibrated.
    pub calibration: Option<Calibration>,
    /// Smallest, average and largest depth of the points seen; 0 = unknown.
    pub depths: [f32; 3],
    /// Neighbours, best first.
    pub neighbors: Vec<Neighbor>,
}

/// Compares two scenes: their numbers, what these do not say, and the first difference.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for bad tolerances.
pub fn compare_scenes(
    a: &ComparedScene,
    b: &ComparedScene,
    tolerance: &Tolerance,
) -> Result<(Figures, Vec<String>, Option<FirstDifference>)> {
    let points = compare_clouds(&a.points, &b.points, None, tolerance)?;
    let unit = scale(b);
    let mut first = Finder::default();
    let counts = (a.images.len(), b.images.len());
    first.note(counts.0 != counts.1, || "scene".to_owned(), "images", &counts.0, &counts.1);
    let mut images = Images::default();
    let mut neighbors = Neighbors::default();
    for (i, (ia, ib)) in a.images.iter().zip(&b.images).enumerate() {
        images.compare(i, ia, ib, unit, tolerance, &mut first);
        neighbors.compare(i, &ia.neighbors, &ib.neighbors, tolerance, &mut first);
    }
    let mut f = Figures::default();
    f.add("platforms.a", Figure::Count(a.platforms as u64));
    f.add("platforms.b", Figure::Count(b.platforms as u64));
    f.add("images.a", Figure::Count(counts.0 as u64));
    f.add("images.b", Figure::Count(counts.1 as u64));
    images.report(&mut f);
    neighbors.report(&mut f);
    report_points(&points, &mut f);
    let first = first.0.or_else(|| points.first.clone());
    let mut rest = Finder::default();
    compare_regions(a.roi.as_ref(), b.roi.as_ref(), unit, tolerance, &mut f, &mut rest);
    let transform = a.transform.iter().zip(b.transform).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    rest.note(transform > 0.0, || "scene".to_owned(), "transform", &a.transform, &b.transform);
    f.add("transform", Figure::Number(transform));
    let notes = points.notes().into_iter().map(|note| format!("points: {note}")).collect();
    Ok((f, notes, first.or(rest.0)))
}

/// Diagonal of the points or, without any, of the camera centres: what positions are held against.
fn scale(scene: &ComparedScene) -> f64 {
    let of_points = diagonal(&scene.points);
    if of_points > 0.0 {
        return of_points;
    }
    let centers: Vec<_> = scene.images.iter().filter_map(|i| Some(i.calibration.as_ref()?.center)).collect();
    let Some(start) = centers.first() else { return 0.0 };
    let (min, max) = centers.iter().fold((*start, *start), |(min, max), c| (min.inf(c), max.sup(c)));
    (max - min).norm()
}

/// Differences between the images of the same position.
#[derive(Default)]
struct Images {
    other_name: u64,
    other_mask: u64,
    other_id: u64,
    calibrated_in_one: u64,
    size_differs: u64,
    k: Vec<f64>,
    rotation: Vec<f64>,
    center: Vec<f64>,
    depths: [Vec<f64>; 3],
}

impl Images {
    fn compare(
        &mut self,
        i: usize,
        a: &ComparedImage,
        b: &ComparedImage,
        unit: f64,
        most: &Tolerance,
        first: &mut Finder,
    ) {
        let place = || format!("image {i}");
        let mut count =
            |differs: bool, name, counter: &mut u64, a: &dyn std::fmt::Debug, b: &dyn std::fmt::Debug| {
                *counter += u64::from(differs);
                first.note(differs, place, name, a, b);
            };
        let other = |a: &str, b: &str| file_name(a) != file_name(b);
        count(other(&a.name, &b.name), "name", &mut self.other_name, &a.name, &b.name);
        count(other(&a.mask, &b.mask), "mask", &mut self.other_mask, &a.mask, &b.mask);
        count(a.id != b.id, "id", &mut self.other_id, &a.id.0, &b.id.0);
        let calibrated = (a.calibration.is_some(), b.calibration.is_some());
        let in_one = calibrated.0 != calibrated.1;
        count(in_one, "calibrated", &mut self.calibrated_in_one, &calibrated.0, &calibrated.1);
        if let Some((ca, cb)) = a.calibration.as_ref().zip(b.calibration.as_ref()) {
            let size = |c: &Calibration| c.size.map(|Size { width, height }| (width, height));
            count(ca.size != cb.size, "size", &mut self.size_differs, &size(ca), &size(cb));
            let k = (ca.normalized_k - cb.normalized_k).abs().max();
            self.k.push(k);
            first.note(k > most.relative, place, "k", &ca.normalized_k, &cb.normalized_k);
            let angle = rotation_deg(&ca.rotation, &cb.rotation);
            self.rotation.push(angle);
            first.note(angle > most.angle, place, "rotation", &ca.rotation, &cb.rotation);
            let apart = (ca.center - cb.center).norm();
            self.center.push(apart);
            first.note(share(apart, unit) > most.position, place, "center", &ca.center, &cb.center);
        }
        for (kind, name) in ["min depth", "avg depth", "max depth"].into_iter().enumerate() {
            let difference = relative(a.depths[kind], b.depths[kind]);
            self.depths[kind].push(difference);
            first.note(difference > most.relative, place, name, &a.depths[kind], &b.depths[kind]);
        }
    }

    fn report(self, f: &mut Figures) {
        f.add("images.other_name", Figure::Count(self.other_name));
        f.add("images.other_mask", Figure::Count(self.other_mask));
        f.add("images.other_id", Figure::Count(self.other_id));
        f.add("images.calibrated_in_one", Figure::Count(self.calibrated_in_one));
        f.add("camera.size_differs", Figure::Count(self.size_differs));
        f.add("camera.k", Differences::of(self.k).map(Figure::Absolute));
        f.add("camera.rotation", Differences::of(self.rotation).map(Figure::Absolute));
        f.add("camera.center", Differences::of(self.center).map(Figure::Absolute));
        for (name, depths) in ["depth.min", "depth.avg", "depth.max"].into_iter().zip(self.depths) {
            f.add(name, Differences::of(depths).map(Figure::Relative));
        }
    }
}

/// Differences between the neighbour lists of images; entries are paired by the image that they name.
#[derive(Default)]
struct Neighbors {
    lists: usize,
    same_order: usize,
    only_a: u64,
    only_b: u64,
    paired: usize,
    same_points: usize,
    /// Score, scale, angle, area.
    values: [Vec<f64>; 4],
}

impl Neighbors {
    fn compare(&mut self, i: usize, a: &[Neighbor], b: &[Neighbor], most: &Tolerance, first: &mut Finder) {
        if a.is_empty() && b.is_empty() {
            return;
        }
        self.lists += 1;
        let order = |list: &[Neighbor]| list.iter().map(|n| n.view.0).collect::<Vec<_>>();
        let same = order(a) == order(b);
        self.same_order += usize::from(same);
        first.note(!same, || format!("image {i}"), "neighbors", &order(a), &order(b));
        let is_in = |list: &[Neighbor], n: &&Neighbor| list.iter().any(|m| m.view == n.view);
        self.only_a += a.iter().filter(|n| !is_in(b, n)).count() as u64;
        self.only_b += b.iter().filter(|n| !is_in(a, n)).count() as u64;
        for (k, na) in a.iter().enumerate() {
            let Some(nb) = b.iter().find(|n| n.view == na.view) else { continue };
            let place = || format!("image {i}, neighbor {k} (image {})", na.view.0);
            self.paired += 1;
            self.same_points += usize::from(na.points == nb.points);
            first.note(na.points != nb.points, place, "points", &na.points, &nb.points);
            let values = [
                ("score", na.score, nb.score),
                ("scale", na.scale, nb.scale),
                ("angle", na.angle, nb.angle),
                ("area", na.area, nb.area),
            ];
            for ((name, va, vb), column) in values.into_iter().zip(&mut self.values) {
                let difference = relative(va, vb);
                column.push(difference);
                first.note(difference > most.relative, place, name, &va, &vb);
            }
        }
    }

    fn report(self, f: &mut Figures) {
        f.add("neighbors.lists", Figure::Count(self.lists as u64));
        f.add("neighbors.same_order", Figure::share(self.same_order, self.lists));
        f.add("neighbors.only_a", Figure::Count(self.only_a));
        f.add("neighbors.only_b", Figure::Count(self.only_b));
        f.add("neighbors.same_points", Figure::share(self.same_points, self.paired));
        let names = ["neighbors.score", "neighbors.scale", "neighbors.angle", "neighbors.area"];
        for (name, values) in names.into_iter().zip(self.values) {
            f.add(name, Differences::of(values).map(Figure::Relative));
        }
    }
}

fn report_points(points: &CloudComparison, f: &mut Figures) {
    f.add("points.a", Figure::Count(points.points_a));
    f.add("points.b", Figure::Count(points.points_b));
    f.add("points.position", points.position.map(Figure::Absolute));
    f.add("points.views_same", points.views.map(|v| Figure::share(v.equal, v.compared)));
    f.add("points.weights", points.weights.map(Figure::Relative));
    f.add("points.color", points.color.map(Figure::Absolute));
    f.add("points.normal", points.normal.map(Figure::Absolute));
}

/// Regions: angle in degrees, distance of the centres and of the half extents in scene units.
fn compare_regions(
    a: Option<&Roi>,
    b: Option<&Roi>,
    unit: f64,
    most: &Tolerance,
    f: &mut Figures,
    first: &mut Finder,
) {
    let in_one = a.is_some() != b.is_some();
    f.add("roi.in_one", Figure::Count(in_one.into()));
    let place = || "region of interest".to_owned();
    first.note(in_one, place, "presence", &a.is_some(), &b.is_some());
    let Some((a, b)) = a.zip(b) else { return };
    let angle = rotation_deg(&a.rotation, &b.rotation);
    let center = (a.center - b.center).norm();
    let extent = (a.half_extent - b.half_extent).norm();
    f.add("roi.rotation", Figure::Number(angle));
    f.add("roi.center", Figure::Number(center));
    f.add("roi.extent", Figure::Number(extent));
    first.note(angle > most.angle, place, "rotation", &a.rotation, &b.rotation);
    first.note(share(center, unit) > most.position, place, "center", &a.center, &b.center);
    first.note(share(extent, unit) > most.position, place, "half extent", &a.half_extent, &b.half_extent);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{CloudLayout, CloudPoint, PointSink, ViewIndex};
    use nalgebra::{Matrix3, Vector3};

    const VIEWS: [ViewIndex; 2] = [ViewIndex(0), ViewIndex(1)];

    fn scene() -> ComparedScene {
        let layout =
            CloudLayout { views: true, weights: true, colors: true, normals: true, ..Default::default() };
        let mut points = PointCloud::new(layout);
        for x in [0.0, 10.0] {
            let weights: &[f32] = &[1.0, 2.0];
            points
                .push(&CloudPoint { position: [x, 0.0, 5.0], views: &VIEWS, weights, ..Default::default() })
                .unwrap();
        }
        let image = |i: u32| ComparedImage {
            name: format!("{i}.jpg"),
            mask: String::new(),
            id: ImageId(i + 7),
            calibration: Some(Calibration {
                normalized_k: Matrix3::identity(),
                rotation: Matrix3::identity(),
                center: Vector3::new(f64::from(i), 0.0, 0.0),
                size: Some(Size::new(640, 480)),
            }),
            depths: [1.0, 2.0, 3.0],
            neighbors: (0..3).filter(|n| *n != i).map(|n| neighbor(n, 100.0)).collect(),
        };
        let roi = Roi::axis_aligned([0.0; 3], [2.0; 3], 0.0);
        ComparedScene { platforms: 1, images: (0..3).map(image).collect(), points, roi, transform: [0.0; 16] }
    }

    fn neighbor(view: u32, score: f32) -> Neighbor {
        Neighbor { view: ViewIndex(view), points: 50, scale: 1.0, angle: 0.2, area: 0.5, score }
    }

    /// Numbers and first difference after a change of the second scene.
    fn changed(change: impl FnOnce(&mut ComparedScene)) -> (Figures, FirstDifference) {
        let (a, mut b) = (scene(), scene());
        change(&mut b);
        let (figures, _, first) = compare_scenes(&a, &b, &Tolerance::default()).unwrap();
        (figures, first.unwrap())
    }

    fn number(figures: &Figures, name: &str) -> f64 {
        let numbers = figures.numbers();
        numbers.iter().find(|(known, _)| known == name).unwrap_or_else(|| panic!("no {name}")).1
    }

    #[test]
    fn equal_scenes_differ_in_nothing_and_report_the_whole_catalog() {
        let (figures, notes, first) = compare_scenes(&scene(), &scene(), &Tolerance::default()).unwrap();
        assert_eq!((notes.len(), first), (0, None));
        let reported: Vec<String> = figures.numbers().into_iter().map(|(name, _)| name).collect();
        assert_eq!(reported, crate::evaluate::names(SCENE_FIGURES));
        for (name, value) in figures.numbers().iter().filter(|(name, _)| name.ends_with(".max")) {
            assert_eq!(*value, 0.0, "{name}");
        }
        assert_eq!(number(&figures, "neighbors.same_order"), 1.0);
    }

    #[test]
    fn cameras_are_compared() {
        let calibration = |b: &mut ComparedScene| b.images[1].calibration.clone().unwrap();
        let (f, first) = changed(|b| {
            let mut c = calibration(b);
            c.center.y = 2.0;
            b.images[1].calibration = Some(c);
        });
        assert_eq!((number(&f, "camera.center.max"), number(&f, "camera.center.equal")), (2.0, 2.0 / 3.0));
        assert_eq!((first.place.as_str(), first.attribute), ("image 1", "center"));
        let (f, first) = changed(|b| {
            let mut c = calibration(b);
            c.rotation = nalgebra::Rotation3::from_euler_angles(0.2, 0.0, 0.0).into_inner();
            (c.normalized_k[(0, 0)], c.size) = (1.25, None);
            b.images[1].calibration = Some(c);
        });
        assert!((number(&f, "camera.rotation.max") - 0.2f64.to_degrees()).abs() < 1e-9);
        assert_eq!((number(&f, "camera.k.max"), number(&f, "camera.size_differs")), (0.25, 1.0));
        assert_eq!(first.attribute, "size");
        let (f, first) = changed(|b| b.images[2].calibration = None);
        assert_eq!((number(&f, "images.calibrated_in_one"), first.attribute), (1.0, "calibrated"));
        assert_eq!(number(&f, "camera.k.compared"), 2.0);
    }

    #[test]
    fn names_ids_depths_and_counts_are_compared() {
        let (f, first) = changed(|b| b.images[0].name = "x".into());
        assert_eq!((number(&f, "images.other_name"), first.b.as_str()), (1.0, "\"x\""));
        let mut moved = scene();
        moved.images[0].name = "../images/0.jpg".into();
        assert_eq!(compare_scenes(&scene(), &moved, &Tolerance::default()).unwrap().2, None);
        let (f, _) = changed(|b| (b.images[0].mask, b.images[0].id) = ("m".into(), ImageId(1)));
        assert_eq!((number(&f, "images.other_mask"), number(&f, "images.other_id")), (1.0, 1.0));
        let (f, first) = changed(|b| b.images[0].depths[1] = 4.0);
        assert_eq!((number(&f, "depth.avg.max"), first.attribute), (0.5, "avg depth"));
        let (f, first) = changed(|b| b.images.truncate(2));
        assert_eq!((number(&f, "images.b"), first.place.as_str()), (2.0, "scene"));
        let (_, first) = changed(|b| b.transform[3] = 1.0);
        assert_eq!(first.attribute, "transform");
    }

    #[test]
    fn neighbours_are_paired_by_the_image_they_name() {
        let (f, first) = changed(|b| b.images[0].neighbors.reverse());
        assert!((number(&f, "neighbors.same_order") - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!((number(&f, "neighbors.score.max"), first.a.as_str()), (0.0, "[1, 2]"));
        let (f, first) = changed(|b| b.images[0].neighbors[1].score = 80.0);
        assert!((number(&f, "neighbors.score.max") - 0.2).abs() < 1e-6);
        assert_eq!(first.place, "image 0, neighbor 1 (image 2)");
        let (f, _) = changed(|b| b.images[0].neighbors[1].points = 51);
        assert!((number(&f, "neighbors.same_points") - 5.0 / 6.0).abs() < 1e-12);
        let (f, _) = changed(|b| b.images[0].neighbors[1] = neighbor(5, 1.0));
        assert_eq!((number(&f, "neighbors.only_a"), number(&f, "neighbors.only_b")), (1.0, 1.0));
    }

    #[test]
    fn points_and_regions_are_compared() {
        let (f, first) = changed(|b| {
            let mut moved = PointCloud::new(crate::scene::PointSource::layout(&b.points));
            for mut point in b.points.clone().iter() {
                point.views = &VIEWS[..1];
                point.weights = &[1.0];
                moved.push(&point).unwrap();
            }
            b.points = moved;
        });
        assert_eq!((number(&f, "points.views_same"), first.attribute), (0.0, "views"));
        let (f, first) = changed(|b| b.roi = None);
        assert_eq!((number(&f, "roi.in_one"), first.attribute), (1.0, "presence"));
        let (f, first) = changed(|b| b.roi = Roi::axis_aligned([0.0; 3], [2.0, 2.0, 4.0], 0.0));
        assert_eq!((number(&f, "roi.center"), number(&f, "roi.extent")), (1.0, 1.0));
        assert_eq!(first.place, "region of interest");
    }
}
