//! Two clouds: point by point where they have the same order, by nearest points in any case.

use super::{
    Agreement, Catalog, Differences, Figure, Figures, Finder, FirstDifference, Shape, Tolerance, angle_deg,
    distance, relative,
};
use crate::error::Result;
use crate::geometry::NearestIndex;
use crate::scene::{Calibration, CloudLayout, CloudPoint, PointCloud, PointSource};
use nalgebra::Vector3;

/// What a comparison of clouds reports.
pub const CLOUD_FIGURES: Catalog = &[
    ("points.a", Shape::One),
    ("points.b", Shape::One),
    ("points.difference", Shape::One),
    ("attributes.only_a", Shape::One),
    ("attributes.only_b", Shape::One),
    ("order.same", Shape::One),
    ("position", Shape::Absolute),
    ("position_of_diagonal", Shape::Relative),
    ("position_of_depth", Shape::Relative),
    ("normal", Shape::Absolute),
    ("color", Shape::Absolute),
    ("views.same", Shape::One),
    ("weights", Shape::Relative),
    ("confidence", Shape::Relative),
    ("label.same", Shape::One),
    ("label_confidence", Shape::Absolute),
    ("nearest.a_to_b", Shape::Absolute),
    ("nearest.b_to_a", Shape::Absolute),
];

/// Distance of two points of the same number that count as the same point when the order is judged, as a share of
/// the diagonal.
const SAME_POINT: f64 = 1e-3;
/// Share of points in the same order from which clouds are compared point by point.
const SAME_ORDER: f64 = 0.5;

/// How two clouds differ. Point by point are compared clouds of the same length of which at least half the points lie
/// within 0.1 % of the diagonal of the other cloud's point of that number. An attribute that only one cloud has is not
/// compared.
#[derive(Clone, Debug, PartialEq)]
pub struct CloudComparison {
    /// Points of the first.
    pub points_a: u64,
    /// Points of the second.
    pub points_b: u64,
    /// Attributes that only the first has.
    pub only_a: Vec<&'static str>,
    /// Attributes that only the second has.
    pub only_b: Vec<&'static str>,
    /// Diagonal of the second cloud's bounding box, scene units.
    pub diagonal: f64,
    /// Share of the points that lie within 0.1 % of the diagonal of the other's point of that number; `None` for
    /// clouds of different length.
    pub same_order: Option<f64>,
    /// Distances of the positions, scene units.
    pub position: Option<Differences>,
    /// Distances of the positions as a share of `diagonal`.
    pub position_of_diagonal: Option<Differences>,
    /// Distances of the positions as a share of the depth of the second cloud's point in the nearest view that sees it
    /// (in the nearest of all views, of points without views); only with cameras.
    pub position_of_depth: Option<Differences>,
    /// Largest difference of the three colour channels, levels.
    pub color: Option<Differences>,
    /// Angles between the normals, degrees.
    pub normal: Option<Differences>,
    /// Whether the same views see the point.
    pub views: Option<Agreement>,
    /// Largest relative difference of the weights, where the views are the same.
    pub weights: Option<Differences>,
    /// Relative differences of the confidences.
    pub confidence: Option<Differences>,
    /// Whether the labels are the same.
    pub label: Option<Agreement>,
    /// Differences of the label confidences.
    pub label_confidence: Option<Differences>,
    /// Distances from the first's finite points to the nearest of the second, scene units.
    pub a_to_b: Option<Differences>,
    /// Distances from the second's finite points to the nearest of the first, scene units.
    pub b_to_a: Option<Differences>,
    /// The first point that differs by more than the tolerances; of clouds of different length or order, their counts
    /// or order.
    pub first: Option<FirstDifference>,
}

impl CloudComparison {
    /// The numbers under their names.
    pub fn figures(&self) -> Figures {
        let (a, b) = (self.points_a, self.points_b);
        let share = |agreement: Agreement| Figure::share(agreement.equal, agreement.compared);
        let mut f = Figures::default();
        f.add("points.a", Figure::Count(a));
        f.add("points.b", Figure::Count(b));
        f.add("points.difference", Figure::Number(a.abs_diff(b) as f64 / a.max(b).max(1) as f64));
        f.add("attributes.only_a", Figure::Count(self.only_a.len() as u64));
        f.add("attributes.only_b", Figure::Count(self.only_b.len() as u64));
        f.add("order.same", self.same_order.map(Figure::Number));
        f.add("position", self.position.map(Figure::Absolute));
        f.add("position_of_diagonal", self.position_of_diagonal.map(Figure::Relative));
        f.add("position_of_depth", self.position_of_depth.map(Figure::Relative));
        f.add("normal", self.normal.map(Figure::Absolute));
        f.add("color", self.color.map(Figure::Absolute));
        f.add("views.same", self.views.map(share));
        f.add("weights", self.weights.map(Figure::Relative));
        f.add("confidence", self.confidence.map(Figure::Relative));
        f.add("label.same", self.label.map(share));
        f.add("label_confidence", self.label_confidence.map(Figure::Absolute));
        f.add("nearest.a_to_b", self.a_to_b.map(Figure::Absolute));
        f.add("nearest.b_to_a", self.b_to_a.map(Figure::Absolute));
        f
    }

    /// What the numbers do not say.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (which, only) in [("A", &self.only_a), ("B", &self.only_b)] {
            if !only.is_empty() {
                notes.push(format!("only {which} has {}", only.join(", ")));
            }
        }
        if self.same_order.is_none() {
            notes.push("different numbers of points: compared by nearest points only".to_owned());
        } else if self.same_order.is_some_and(|share| share < SAME_ORDER) {
            notes.push("another order of points: compared by nearest points only".to_owned());
        }
        notes
    }
}

/// Compares two clouds; `cameras`, by view, give positions their depths.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for bad tolerances.
pub fn compare_clouds(
    a: &PointCloud,
    b: &PointCloud,
    cameras: Option<&[Option<Calibration>]>,
    tolerance: &Tolerance,
) -> Result<CloudComparison> {
    tolerance.check()?;
    let diagonal = diagonal(b);
    let same_order = (a.len() == b.len()).then(|| order_share(a, b, diagonal));
    let in_order = same_order.is_some_and(|share| share >= SAME_ORDER);
    let both = common(a.layout(), b.layout());
    let mut found =
        Found { both, diagonal, cameras, tolerance, columns: Columns::default(), first: Finder::default() };
    if in_order {
        a.iter().zip(b.iter()).enumerate().for_each(|(index, (pa, pb))| found.compare(index, &pa, &pb));
    }
    let Found { columns: c, mut first, .. } = found;
    match same_order {
        None => first.note(true, || "cloud".to_owned(), "points", &a.len(), &b.len()),
        Some(share) => first.note(!in_order, || "cloud".to_owned(), "order", &share, &1.0),
    }
    let [a_to_b, b_to_a] = nearest_distances(a, b);
    let position_of_diagonal = c.position.iter().map(|d| share(*d, diagonal)).collect();
    Ok(CloudComparison {
        points_a: a.len(),
        points_b: b.len(),
        only_a: missing(a.layout(), b.layout()),
        only_b: missing(b.layout(), a.layout()),
        diagonal,
        same_order,
        position: Differences::of(c.position),
        position_of_diagonal: Differences::of(position_of_diagonal),
        position_of_depth: Differences::of(c.position_of_depth),
        color: Differences::of(c.color),
        normal: Differences::of(c.normal),
        views: (both.views && in_order).then_some(c.views),
        weights: Differences::of(c.weights),
        confidence: Differences::of(c.confidence),
        label: (both.labels && in_order).then_some(c.label),
        label_confidence: Differences::of(c.label_confidence),
        a_to_b,
        b_to_a,
        first: first.0,
    })
}

/// Share of the points near the other cloud's point of the same number; 1 of clouds without points.
fn order_share(a: &PointCloud, b: &PointCloud, diagonal: f64) -> f64 {
    let near = |(a, b): &(CloudPoint<'_>, CloudPoint<'_>)| {
        share(distance(a.position, b.position), diagonal) <= SAME_POINT
    };
    if a.is_empty() { 1.0 } else { a.iter().zip(b.iter()).filter(near).count() as f64 / a.len() as f64 }
}

/// Distances from each cloud to the other; `None` if one of them has no finite point.
fn nearest_distances(a: &PointCloud, b: &PointCloud) -> [Option<Differences>; 2] {
    let finite = |cloud: &PointCloud| -> Vec<[f64; 3]> {
        let finite = cloud.iter().filter(|p| p.position.iter().all(|v| v.is_finite()));
        finite.map(|p| p.position.map(f64::from)).collect()
    };
    let [a, b] = [finite(a), finite(b)].map(|points| NearestIndex::new(&points));
    [(&a, &b), (&b, &a)].map(|(from, to)| {
        let nearest = from.nearest_in(to, f64::INFINITY);
        Differences::of(nearest.into_iter().flatten().map(|n| n.squared.sqrt()).collect())
    })
}

/// Differences of every point compared.
#[derive(Default)]
struct Columns {
    position: Vec<f64>,
    position_of_depth: Vec<f64>,
    color: Vec<f64>,
    normal: Vec<f64>,
    views: Agreement,
    weights: Vec<f64>,
    confidence: Vec<f64>,
    label: Agreement,
    label_confidence: Vec<f64>,
}

struct Found<'a> {
    both: CloudLayout,
    diagonal: f64,
    cameras: Option<&'a [Option<Calibration>]>,
    tolerance: &'a Tolerance,
    columns: Columns,
    first: Finder,
}

impl Found<'_> {
    fn compare(&mut self, index: usize, a: &CloudPoint<'_>, b: &CloudPoint<'_>) {
        let (most, columns, first) = (self.tolerance, &mut self.columns, &mut self.first);
        let place = || format!("point {index}");
        let apart = distance(a.position, b.position);
        columns.position.push(apart);
        let is_apart = share(apart, self.diagonal) > most.position;
        first.note(is_apart, place, "position", &a.position, &b.position);
        if let Some(cameras) = self.cameras {
            columns.position_of_depth.push(share(apart, depth_of(b, cameras)));
        }
        if self.both.colors {
            let levels = a.color.iter().zip(b.color).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0).into();
            columns.color.push(levels);
            first.note(levels > most.color, place, "color", &a.color, &b.color);
        }
        if self.both.normals {
            let angle = angle_deg(a.normal, b.normal);
            columns.normal.push(angle);
            first.note(angle > most.angle, place, "normal", &a.normal, &b.normal);
        }
        let same_views = a.views == b.views;
        if self.both.views {
            columns.views.count(same_views);
            let ids = |p: &CloudPoint<'_>| p.views.iter().map(|v| v.0).collect::<Vec<_>>();
            if !same_views {
                first.note(true, place, "views", &ids(a), &ids(b));
            }
        }
        if self.both.weights && same_views {
            let largest = a.weights.iter().zip(b.weights).map(|(a, b)| relative(*a, *b)).fold(0.0, f64::max);
            columns.weights.push(largest);
            first.note(largest > most.relative, place, "weights", &a.weights, &b.weights);
        }
        if self.both.confidence {
            let difference = relative(a.confidence, b.confidence);
            columns.confidence.push(difference);
            first.note(difference > most.relative, place, "confidence", &a.confidence, &b.confidence);
        }
        if self.both.labels {
            columns.label.count(a.label == b.label);
            first.note(a.label != b.label, place, "label", &a.label, &b.label);
            let (ca, cb) = (a.label_confidence, b.label_confidence);
            let difference = f64::from((ca - cb).abs());
            columns.label_confidence.push(difference);
            first.note(difference > most.relative, place, "label_confidence", &ca, &cb);
        }
    }
}

/// Depth of a point in the nearest view that sees it, or of all views if it has none; 0 if it is before no camera.
fn depth_of(point: &CloudPoint<'_>, cameras: &[Option<Calibration>]) -> f64 {
    let position = Vector3::from(point.position.map(f64::from));
    let depth = |c: &Calibration| (c.rotation.row(2) * (position - c.center)).x;
    let seeing: Vec<&Calibration> = match point.views {
        [] => cameras.iter().flatten().collect(),
        views => views.iter().filter_map(|v| cameras.get(v.index())?.as_ref()).collect(),
    };
    let nearest = seeing.into_iter().map(depth).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
    if nearest.is_finite() { nearest } else { 0.0 }
}

/// `distance` as a share of `whole`; infinite if that is 0, unless there is no distance.
pub(super) fn share(distance: f64, whole: f64) -> f64 {
    if distance == 0.0 { 0.0 } else { distance / whole }
}

/// Diagonal of the bounding box of the finite points.
pub(super) fn diagonal(cloud: &PointCloud) -> f64 {
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for point in cloud.iter().filter(|p| p.position.iter().all(|v| v.is_finite())) {
        for k in 0..3 {
            min[k] = min[k].min(point.position[k]);
            max[k] = max[k].max(point.position[k]);
        }
    }
    if min[0] <= max[0] { distance(min, max) } else { 0.0 }
}

fn common(a: CloudLayout, b: CloudLayout) -> CloudLayout {
    CloudLayout {
        normals: a.normals && b.normals,
        colors: a.colors && b.colors,
        views: a.views && b.views,
        weights: a.weights && b.weights,
        confidence: a.confidence && b.confidence,
        labels: a.labels && b.labels,
    }
}

/// Names of the attributes that `here` has and `there` has not.
fn missing(here: CloudLayout, there: CloudLayout) -> Vec<&'static str> {
    let attributes = [
        ("normals", here.normals, there.normals),
        ("colors", here.colors, there.colors),
        ("views", here.views, there.views),
        ("weights", here.weights, there.weights),
        ("confidence", here.confidence, there.confidence),
        ("labels", here.labels, there.labels),
    ];
    attributes.into_iter().filter_map(|(name, here, there)| (here && !there).then_some(name)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{PointSink, ViewIndex};

    const VIEWS: [ViewIndex; 3] = [ViewIndex(0), ViewIndex(2), ViewIndex(5)];

    fn all() -> CloudLayout {
        CloudLayout {
            normals: true,
            colors: true,
            views: true,
            weights: true,
            confidence: true,
            labels: true,
        }
    }

    /// Three points along x, the second changed by `change`.
    fn cloud(layout: CloudLayout, change: impl Fn(&mut CloudPoint<'_>)) -> PointCloud {
        let mut cloud = PointCloud::new(layout);
        for i in 0..3u8 {
            let mut point = CloudPoint {
                position: [f32::from(i) * 5.0, 0.0, 0.0],
                normal: [0.0, 0.0, 1.0],
                color: [10, 20, 30],
                views: &VIEWS[..2],
                weights: &[0.5, 0.25],
                confidence: 1.0,
                label: 4,
                label_confidence: 0.75,
            };
            if i == 1 {
                change(&mut point);
            }
            cloud.push(&point).unwrap();
        }
        cloud
    }

    fn compared(a: &PointCloud, b: &PointCloud) -> CloudComparison {
        compare_clouds(a, b, None, &Tolerance::default()).unwrap()
    }

    #[test]
    fn equal_clouds_differ_in_nothing() {
        let c = compared(&cloud(all(), |_| {}), &cloud(all(), |_| {}));
        assert_eq!((c.points_a, c.points_b, c.diagonal, &c.first), (3, 3, 10.0, &None));
        for d in [
            c.position,
            c.position_of_diagonal,
            c.color,
            c.normal,
            c.weights,
            c.confidence,
            c.label_confidence,
            c.a_to_b,
            c.b_to_a,
        ] {
            assert_eq!(d.map(|d| (d.compared, d.equal, d.max)), Some((3, 3, 0.0)));
        }
        for agreement in [c.views, c.label] {
            assert_eq!(agreement, Some(Agreement { compared: 3, equal: 3 }));
        }
    }

    #[test]
    fn every_attribute_is_compared() {
        let a = cloud(all(), |_| {});
        let first = |change: &dyn Fn(&mut CloudPoint<'_>)| {
            let c = compared(&a, &cloud(all(), change));
            let first = c.first.clone().unwrap();
            assert_eq!(first.place, "point 1");
            (first.attribute, c)
        };
        let (what, c) = first(&|p| p.position[1] = 1.0);
        assert_eq!((what, c.position.unwrap().max), ("position", 1.0));
        assert!((c.position_of_diagonal.unwrap().max - 1.0 / c.diagonal).abs() < 1e-12);
        let (what, c) = first(&|p| p.color[2] = 27);
        assert_eq!((what, c.color.unwrap().max), ("color", 3.0));
        let (what, c) = first(&|p| p.normal = [0.0, 1.0, 0.0]);
        assert_eq!((what, c.normal.unwrap().max), ("normal", 90.0));
        let (what, c) = first(&|p| p.views = &VIEWS[1..]);
        assert_eq!(
            (what, c.views, c.weights.unwrap().compared),
            ("views", Some(Agreement { compared: 3, equal: 2 }), 2)
        );
        let (what, c) = first(&|p| p.weights = &[0.5, 0.125]);
        assert_eq!((what, c.weights.unwrap().max), ("weights", 0.5));
        let (what, c) = first(&|p| p.confidence = 2.0);
        assert_eq!((what, c.confidence.unwrap().max), ("confidence", 0.5));
        let (what, c) = first(&|p| p.label = 0);
        assert_eq!((what, c.label), ("label", Some(Agreement { compared: 3, equal: 2 })));
        let (what, c) = first(&|p| p.label_confidence = 0.5);
        assert_eq!((what, c.label_confidence.unwrap().max), ("label_confidence", 0.25));
    }

    #[test]
    fn tolerances_pass_over_small_differences() {
        let (a, b) = (cloud(all(), |_| {}), cloud(all(), |p| (p.position[0], p.color[0]) = (5.5, 11)));
        let tolerance = Tolerance { position: 0.06, ..Default::default() };
        assert_eq!(compare_clouds(&a, &b, None, &tolerance).unwrap().first.unwrap().attribute, "color");
        let tolerance = Tolerance { color: 1.0, ..tolerance };
        assert_eq!(compare_clouds(&a, &b, None, &tolerance).unwrap().first, None);
    }

    #[test]
    fn distances_are_held_against_the_depth_in_the_nearest_view_that_sees_the_point() {
        let camera = |z: f64| {
            Some(Calibration {
                normalized_k: nalgebra::Matrix3::identity(),
                rotation: nalgebra::Matrix3::identity(),
                center: Vector3::new(0.0, 0.0, z),
                size: None,
            })
        };
        // The points are at z = 0 and seen by views 0 and 2, at depths of 8 and 4.
        let cameras = [camera(-8.0), camera(-1.0), camera(-4.0)];
        let (a, b) = (cloud(all(), |_| {}), cloud(all(), |p| p.position[0] = 5.5));
        let of_depth = |a: &PointCloud, b: &PointCloud| {
            let c = compare_clouds(a, b, Some(&cameras), &Tolerance::default()).unwrap();
            c.position_of_depth.unwrap().max
        };
        assert_eq!(of_depth(&a, &b), 0.5 / 4.0);
        let bare = CloudLayout::default();
        let (a, b) = (cloud(bare, |_| {}), cloud(bare, |p| p.position[0] = 5.5));
        assert_eq!(of_depth(&a, &b), 0.5);
    }

    #[test]
    fn clouds_of_other_order_or_length_are_compared_by_nearest_points() {
        let a = cloud(all(), |_| {});
        let mut reversed = PointCloud::new(all());
        (0..3).rev().for_each(|i| reversed.push(&a.point(i)).unwrap());
        let c = compared(&a, &reversed);
        assert_eq!((c.same_order, c.position, c.label), (Some(1.0 / 3.0), None, None));
        assert_eq!((c.a_to_b.unwrap().max, c.first.as_ref().unwrap().attribute), (0.0, "order"));
        assert!(c.notes()[0].contains("order"));

        let mut b = cloud(all(), |_| {});
        b.push(&CloudPoint { position: [10.0, 3.0, 4.0], ..Default::default() }).unwrap();
        b.push(&CloudPoint { position: [f32::NAN; 3], ..Default::default() }).unwrap();
        let c = compared(&a, &b);
        assert_eq!((c.same_order, c.position, c.label), (None, None, None));
        let (to_b, to_a) = (c.a_to_b.unwrap(), c.b_to_a.unwrap());
        assert_eq!((to_b.compared, to_b.max, to_a.compared, to_a.max), (3, 0.0, 4, 5.0));
        let first = c.first.unwrap();
        assert_eq!((first.attribute, first.a.as_str(), first.b.as_str()), ("points", "3", "5"));
        let none = PointCloud::new(all());
        assert_eq!((compared(&a, &none).a_to_b, compared(&none, &none).first), (None, None));
    }

    #[test]
    fn attributes_of_one_cloud_alone_are_named() {
        let a = cloud(CloudLayout { weights: false, ..all() }, |_| {});
        let c = compared(&a, &cloud(CloudLayout { labels: false, ..all() }, |_| {}));
        assert_eq!((&c.only_a, &c.only_b), (&vec!["labels"], &vec!["weights"]));
        assert_eq!((c.label, c.weights, c.notes()[0].as_str()), (None, None, "only A has labels"));
    }

    #[test]
    fn all_figures_are_in_the_catalog() {
        let camera = Calibration {
            normalized_k: nalgebra::Matrix3::identity(),
            rotation: nalgebra::Matrix3::identity(),
            center: Vector3::zeros(),
            size: None,
        };
        let cameras = [Some(camera)];
        let a = cloud(all(), |_| {});
        let c = compare_clouds(&a, &a, Some(&cameras), &Tolerance::default()).unwrap();
        let reported: Vec<String> = c.figures().numbers().into_iter().map(|(name, _)| name).collect();
        assert_eq!(reported, crate::evaluate::names(CLOUD_FIGURES));
    }
}
