//! Two clouds whose points should come in the same order.

use super::{Agreement, CompareOptions, Differences, FirstDifference, angle_deg, distance, relative};
use crate::error::Result;
use crate::scene::{CloudLayout, CloudPoint, PointCloud, PointSource};
use serde::Serialize;

/// How two clouds differ, point by point in file order. Of clouds of different length the points up to the end of the
/// shorter are compared. An attribute that only one cloud has is not compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
    /// Distances of the positions, scene units.
    pub position: Option<Differences>,
    /// Distances of the positions as a share of `diagonal`.
    pub position_relative: Option<Differences>,
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
    /// The first point that differs by more than the tolerances, or that only one cloud has.
    pub first: Option<FirstDifference>,
}

/// Compares two clouds point by point.
///
/// # Errors
/// [`Error::Invalid`](crate::Error::Invalid) for bad tolerances.
pub fn compare_clouds(a: &PointCloud, b: &PointCloud, options: &CompareOptions) -> Result<CloudComparison> {
    options.check()?;
    let diagonal = diagonal(b);
    let both = common(a.layout(), b.layout());
    let mut found = Found { both, diagonal, options, columns: Columns::default(), first: None };
    for (index, (pa, pb)) in a.iter().zip(b.iter()).enumerate() {
        found.compare(index, &pa, &pb);
    }
    let Found { columns: c, mut first, .. } = found;
    if a.len() != b.len() && first.is_none() {
        let index = a.len().min(b.len()) as usize;
        first = Some(FirstDifference::new(index, "points", &a.len(), &b.len()));
    }
    let position_relative = c.position.iter().map(|d| share(*d, diagonal)).collect();
    Ok(CloudComparison {
        points_a: a.len(),
        points_b: b.len(),
        only_a: missing(a.layout(), b.layout()),
        only_b: missing(b.layout(), a.layout()),
        diagonal,
        position: Differences::of(c.position),
        position_relative: Differences::of(position_relative),
        color: Differences::of(c.color),
        normal: Differences::of(c.normal),
        views: both.views.then_some(c.views),
        weights: Differences::of(c.weights),
        confidence: Differences::of(c.confidence),
        label: both.labels.then_some(c.label),
        label_confidence: Differences::of(c.label_confidence),
        first,
    })
}

/// Differences of every point compared.
#[derive(Default)]
struct Columns {
    position: Vec<f64>,
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
    options: &'a CompareOptions,
    columns: Columns,
    first: Option<FirstDifference>,
}

impl Found<'_> {
    fn compare(&mut self, index: usize, a: &CloudPoint<'_>, b: &CloudPoint<'_>) {
        let (options, columns, first) = (self.options, &mut self.columns, &mut self.first);
        let mut differs = |is: bool, what: &'static str, a: &dyn std::fmt::Debug, b: &dyn std::fmt::Debug| {
            if is && first.is_none() {
                *first = Some(FirstDifference::new(index, what, &a, &b));
            }
        };
        let apart = distance(a.position, b.position);
        columns.position.push(apart);
        differs(share(apart, self.diagonal) > options.position, "position", &a.position, &b.position);
        if self.both.colors {
            let levels = a.color.iter().zip(b.color).map(|(a, b)| a.abs_diff(b)).max().unwrap_or(0);
            columns.color.push(levels.into());
            differs(levels > options.color, "color", &a.color, &b.color);
        }
        if self.both.normals {
            let angle = angle_deg(a.normal, b.normal);
            columns.normal.push(angle);
            differs(angle > options.normal_deg, "normal", &a.normal, &b.normal);
        }
        let same_views = a.views == b.views;
        if self.both.views {
            columns.views.count(same_views);
            differs(!same_views, "views", &a.views, &b.views);
        }
        if self.both.weights && same_views {
            let largest = a.weights.iter().zip(b.weights).map(|(a, b)| relative(*a, *b)).fold(0.0, f64::max);
            columns.weights.push(largest);
            differs(largest > options.confidence, "weights", &a.weights, &b.weights);
        }
        if self.both.confidence {
            let difference = relative(a.confidence, b.confidence);
            columns.confidence.push(difference);
            differs(difference > options.confidence, "confidence", &a.confidence, &b.confidence);
        }
        if self.both.labels {
            columns.label.count(a.label == b.label);
            differs(a.label != b.label, "label", &a.label, &b.label);
            let difference = f64::from((a.label_confidence - b.label_confidence).abs());
            columns.label_confidence.push(difference);
            let beyond = difference > options.confidence;
            differs(beyond, "label_confidence", &a.label_confidence, &b.label_confidence);
        }
    }
}

/// `distance` as a share of `diagonal`; of a cloud without extent any distance is infinite.
fn share(distance: f64, diagonal: f64) -> f64 {
    if distance == 0.0 { 0.0 } else { distance / diagonal }
}

/// Diagonal of the bounding box of the finite points.
fn diagonal(cloud: &PointCloud) -> f64 {
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
        compare_clouds(a, b, &CompareOptions::default()).unwrap()
    }

    #[test]
    fn equal_clouds_differ_in_nothing() {
        let c = compared(&cloud(all(), |_| {}), &cloud(all(), |_| {}));
        assert_eq!((c.points_a, c.points_b, c.diagonal, &c.first), (3, 3, 10.0, &None));
        for d in
            [c.position, c.position_relative, c.color, c.normal, c.weights, c.confidence, c.label_confidence]
        {
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
            assert_eq!(first.index, 1);
            (first.attribute, c)
        };
        let (what, c) = first(&|p| p.position[1] = 1.0);
        assert_eq!((what, c.position.unwrap().max), ("position", 1.0));
        assert!((c.position_relative.unwrap().max - 1.0 / c.diagonal).abs() < 1e-12);
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
        let options = CompareOptions { position: 0.06, ..Default::default() };
        assert_eq!(compare_clouds(&a, &b, &options).unwrap().first.unwrap().attribute, "color");
        let options = CompareOptions { color: 1, ..options };
        assert_eq!(compare_clouds(&a, &b, &options).unwrap().first, None);
    }

    #[test]
    fn missing_points_and_attributes_are_named() {
        let a = cloud(CloudLayout { weights: false, ..all() }, |_| {});
        let mut b = cloud(CloudLayout { labels: false, ..all() }, |_| {});
        b.push(&CloudPoint { position: [9.0; 3], views: &VIEWS, weights: &[1.0; 3], ..Default::default() })
            .unwrap();
        let c = compared(&a, &b);
        assert_eq!((c.only_a, c.only_b, c.label, c.weights), (vec!["labels"], vec!["weights"], None, None));
        let first = c.first.clone().unwrap();
        assert_eq!(
            (first.index, first.attribute, first.a.as_str(), first.b.as_str()),
            (3, "points", "3", "4")
        );
        let json = serde_json::to_string(&compared(&a, &a)).unwrap();
        assert!(
            json.contains("\"views\":{\"compared\":3,\"equal\":3}") && json.contains("\"label\":"),
            "{json}"
        );
    }
}
