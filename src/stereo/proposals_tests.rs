use super::*;
use crate::geometry::Size;
use crate::scene::Grid;
use crate::scene::synthetic::{Plane, camera, view_of_plane};
use crate::stereo::ReferenceImage;
use crate::stereo::problem::StereoProblem;
use std::sync::Arc;

/// What 8 significant bits of slope and rounding leave of an inverse depth near 1/8, relatively.
const ROUNDED: f32 = 2e-3;

fn surface() -> Plane {
    Plane::slanted(8.0, 0.2, -0.1)
}

fn reference() -> Camera {
    camera(64, 48, [0.0; 3], 0.05)
}

/// A source that is turned, elsewhere and of another size and focal length.
fn source() -> Camera {
    camera(90, 60, [0.9, -0.3, 0.4], -0.12)
}

fn level(depth_range: (f32, f32)) -> (StereoProblem, Level) {
    let image = |camera: Camera, id| ReferenceImage {
        gray: Arc::new(Grid::filled(camera.size(), 0.5f32)),
        camera,
        id: crate::scene::ImageId(id),
    };
    let problem = StereoProblem {
        reference: image(reference(), 0),
        image_name: "0.png".to_owned(),
        sources: vec![image(source(), 1).as_source(0)],
        depth_range,
        sparse: Vec::new(),
        skip: None,
        labels: None,
        regions: Vec::new(),
    };
    let level = Level::new(&problem, 0);
    (problem, level)
}

/// The proposals of the source for a reference that has `found` everywhere, or nothing.
fn proposals(
    level: &Level,
    skip: Option<&Grid<bool>>,
    found: Option<f32>,
    confidence: Option<f32>,
) -> Proposals {
    let mut map = view_of_plane(1, source(), surface());
    map.confidence = confidence.map(|c| Grid::filled(map.depth.size(), c));
    let state = State::from_planes(level, skip, |_, _| {
        found.map(|depth| (InversePlane { w: 1.0 / depth, wx: 0.0, wy: 0.0 }, 0.3))
    });
    Proposals::new(level, &state, &reference(), std::iter::once(&SourcePlanes::new(&map)))
}

fn all(proposals: &Proposals) -> Vec<Proposal> {
    proposals.cells.as_flattened().iter().filter(|p| p.votes > 0).copied().collect()
}

#[test]
fn the_surface_that_a_turned_source_sees_is_proposed_where_it_is() {
    let (_, level) = level((2.0, 30.0));
    let truth = view_of_plane(0, reference(), surface());
    let found = all(&proposals(&level, None, Some(4.0), None));
    assert!(found.len() > 100, "{}", found.len());
    for p in &found {
        let here = (p.x as usize, p.y as usize);
        assert!((p.plane.w * truth.depth[here] - 1.0).abs() < ROUNDED, "{p:?} {}", truth.depth[here]);
        // The slopes, too: the plane holds elsewhere.
        let there = (32, 24);
        let w = p.plane.moved(32.0 - p.x as f32, 24.0 - p.y as f32).w;
        assert!((w * truth.depth[there] - 1.0).abs() < 10.0 * ROUNDED, "{p:?} {w} {}", truth.depth[there]);
    }
}

#[test]
fn only_news_of_sure_pixels_is_proposed() {
    let (_, level) = level((2.0, 30.0));
    let of = |found, confidence| all(&proposals(&level, None, found, confidence)).len();
    assert!(of(Some(4.0), Some(0.051)) > 100);
    assert_eq!(of(Some(4.0), Some(0.049)), 0, "unsure");
    assert!(of(None, None) > 100, "a hole knows nothing");
    let truth = view_of_plane(0, reference(), surface());
    let state = State::from_planes(&level, None, |x, y| {
        Some((InversePlane { w: 1.0 / truth.depth[(x, y)], wx: 0.0, wy: 0.0 }, 0.3))
    });
    let map = SourcePlanes::new(&view_of_plane(1, source(), surface()));
    assert_eq!(all(&Proposals::new(&level, &state, &reference(), std::iter::once(&map))).len(), 0, "known");
    let skip = Grid::filled(Size::new(64, 48), true);
    assert_eq!(all(&proposals(&level, Some(&skip), None, None)).len(), 0, "not wanted");
    let (_, narrow) = self::level((2.0, 4.0));
    assert_eq!(all(&proposals(&narrow, None, None, None)).len(), 0, "out of the depth range");
}

#[test]
fn the_back_of_a_surface_is_not_proposed() {
    let (_, level) = level((2.0, 30.0));
    let map = SourcePlanes::new(&view_of_plane(1, source(), surface()));
    let front = SourceView::new(&reference(), &map);
    let plane = map.trusted(45, 30).unwrap();
    assert!(front.seen_in(&level, 45.0, 30.0, plane).is_some());
    // From behind the wall, looking back at it.
    let behind = camera(64, 48, [0.5, 0.0, 16.0], std::f64::consts::PI);
    assert!(SourceView::new(&behind, &map).seen_in(&level, 45.0, 30.0, plane).is_none());
}

#[test]
fn most_votes_stay_and_tiles_find_theirs() {
    let plane = |w| InversePlane { w, wx: 0.0, wy: 0.0 };
    let mut proposals = Proposals::none(Size::new(20, 9));
    assert_eq!((proposals.columns, proposals.rows), (5, 3));
    proposals.add(17, 8, plane(1.0), 0.1);
    proposals.add(18, 8, plane(2.0), 0.1);
    for _ in 0..3 {
        proposals.add(19, 8, plane(3.0), 0.1);
        proposals.add(16, 8, plane(3.02), 0.1);
    }
    let cell = proposals.cells[14];
    assert_eq!((cell[0].plane.w, cell[0].votes), (3.02, 5), "the first two have lost their votes");
    let mut out = Vec::new();
    let mut tile = Tile::boxed(1);
    for (x0, y0, expected) in [(8, 6, 1), (-8, -4, 0), (16, 8, 1), (0, 0, 0), (12, 1, 1)] {
        (tile.x0, tile.y0) = (x0, y0);
        proposals.on(&tile, &mut out);
        assert_eq!(out.len(), expected, "tile at {x0}, {y0}");
    }
    assert_eq!(Proposals::none(Size::new(1, 1)).cells.len(), 1);
}
