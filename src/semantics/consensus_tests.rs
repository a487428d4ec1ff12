use super::*;
use crate::geometry::Size;
use crate::scene::DepthEstimate;
use crate::scene::synthetic::{Plane, row_of_views};
use proptest::prelude::*;

const WALL: u16 = 1;
const SKY: u16 = 2;
const WINDOW: u16 = 4;

/// Views of a slanted wall, each with its own labels.
struct TestViews {
    estimates: Vec<DepthEstimate>,
    labels: Vec<LabelMap>,
    distances: Vec<Grid<u8>>,
}

impl TestViews {
    fn new(count: u32, label: impl Fn(usize, usize, usize) -> u16) -> Self {
        let estimates = row_of_views(count, 48, 36, 0.2, Plane::slanted(8.0, 0.15, -0.1));
        let labels: Vec<LabelMap> = (0..estimates.len())
            .map(|view| {
                let at = |i: usize| label(view, i % 48, i / 48);
                Grid::from_vec(Size::new(48, 36), (0..48 * 36).map(at).collect()).unwrap()
            })
            .collect();
        let distances = labels.iter().map(|labels| border_distance(labels, 8)).collect();
        TestViews { estimates, labels, distances }
    }

    fn witness(&self, i: usize) -> Witness<'_> {
        Witness {
            camera: &self.estimates[i].camera,
            depth: &self.estimates[i].depth,
            labels: &self.labels[i],
            border_distance: &self.distances[i],
        }
    }

    fn consensus(&self, i: usize) -> Consensus {
        self.with(i, &ConsensusOptions::default())
    }

    fn with(&self, i: usize, options: &ConsensusOptions) -> Consensus {
        let others: Vec<Witness<'_>> =
            (0..self.labels.len()).filter(|&j| j != i).map(|j| self.witness(j)).collect();
        label_consensus(&self.witness(i), &others, options)
    }
}

/// A pixel of the middle, which all views see.
const MIDDLE: (usize, usize) = (24, 18);

#[test]
fn the_others_correct_a_blob_in_one_view() {
    let views = TestViews::new(5, |view, x, y| {
        if view == 2 && (15..33).contains(&x) && (10..26).contains(&y) { WINDOW } else { WALL }
    });
    let corrected = views.consensus(2);
    let wrong = corrected.labels.data().iter().filter(|l| **l != WALL).count();
    assert_eq!(wrong, 0, "four views outvote one");
    assert!(corrected.confidence[MIDDLE] < 0.97 && corrected.confidence[MIDDLE] > 0.9);
    let untouched = views.consensus(0);
    assert!(untouched.labels.data().iter().all(|l| *l == WALL));
}

#[test]
fn a_surface_that_no_other_view_measures_keeps_its_label() {
    let mut views = TestViews::new(4, |view, _, _| if view == 0 { WINDOW } else { WALL });
    for estimate in &mut views.estimates[1..] {
        estimate.depth.data_mut().iter_mut().for_each(|d| *d *= 0.9);
    }
    let alone = views.consensus(0);
    assert!(alone.labels.data().iter().all(|l| *l == WINDOW), "what is nearer there is another surface");
    let single = 1.0f32.exp() / (1.0 + 1.0f32.exp());
    assert!((alone.confidence[MIDDLE] - single).abs() < 1e-6);
}

#[test]
fn a_view_without_depth_there_has_a_vote_only_if_asked() {
    let mut views = TestViews::new(5, |view, _, _| if view == 0 { WINDOW } else { SKY });
    views.estimates[1..].iter_mut().for_each(|e| e.depth.data_mut().fill(0.0));
    assert_eq!(views.consensus(0).labels[MIDDLE], WINDOW);
    let part = ConsensusOptions { without_depth: 0.3, ..ConsensusOptions::default() };
    assert_eq!(views.with(0, &part).labels[MIDDLE], SKY, "four times 0.3 are more than 1");
}

#[test]
fn void_has_no_vote_and_no_depth_no_confidence() {
    let mut views = TestViews::new(3, |view, _, _| if view == 1 { WALL } else { 0 });
    views.estimates[0].depth[(3, 4)] = 0.0;
    let filled = views.consensus(0);
    assert_eq!(filled.labels[MIDDLE], WALL);
    assert_eq!((filled.labels[(3, 4)], filled.confidence[(3, 4)]), (0, 0.0));
    let void = TestViews::new(3, |_, _, _| 0).consensus(0);
    assert!(void.labels.data().iter().all(|l| *l == 0) && void.confidence.data().iter().all(|c| *c == 0.0));
}

#[test]
fn pixels_at_a_border_have_less_say() {
    // In view 0 the middle is deep in the wall; in views 1 and 2 a window begins right there.
    let views = TestViews::new(3, |view, x, _| if view > 0 && (20..26).contains(&x) { WINDOW } else { WALL });
    let wide = ConsensusOptions { border: 8, ..ConsensusOptions::default() };
    assert_eq!(views.with(0, &wide).labels[MIDDLE], WALL, "two weak votes do not outweigh a whole one");
    let equal = ConsensusOptions { border: 1, ..ConsensusOptions::default() };
    assert_eq!(views.with(0, &equal).labels[MIDDLE], WINDOW);
}

#[test]
fn certainty_grows_with_votes_and_falls_with_dissent() {
    let agree = |count| TestViews::new(count, |_, _, _| WALL).consensus(0).confidence[MIDDLE];
    assert!(agree(2) < agree(3) && agree(3) < agree(5) && agree(5) > 0.98);
    let views = TestViews::new(6, |view, _, _| if view < 2 { WINDOW } else { WALL });
    let divided = views.consensus(0);
    assert_eq!(divided.labels[MIDDLE], WALL);
    let expected = 1.0 / (1.0 + (-2.0f32).exp() + (-4.0f32).exp());
    assert!((divided.confidence[MIDDLE] - expected).abs() < 1e-6, "{}", divided.confidence[MIDDLE]);
}

#[test]
fn a_tie_goes_to_the_own_label_then_to_the_smaller_id() {
    let mut ballot = Ballot::default();
    for label in [9, 4, 7] {
        ballot.add(label, 1.0);
    }
    assert_eq!(ballot.outcome(7).unwrap().0, 7);
    assert_eq!(ballot.outcome(1).unwrap().0, 4);
    assert_eq!(Ballot::default().outcome(3), None);
}

/// The distance as it is defined.
fn slow_distance(labels: &LabelMap, most: u8) -> Vec<u8> {
    let (w, h) = (labels.width() as isize, labels.height() as isize);
    let pixels = || (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
    let at = |(x, y): (isize, isize)| labels[(x as usize, y as usize)];
    pixels()
        .map(|p| {
            let others = pixels().filter(|q| at(*q) != at(p));
            let distance = |q: (isize, isize)| (q.0 - p.0).abs().max((q.1 - p.1).abs());
            others.map(distance).min().map_or(most, |d| d.min(isize::from(most)) as u8)
        })
        .collect()
}

proptest! {
    #[test]
    fn border_distances_are_those_of_the_definition(
        width in 1u32..12,
        height in 1u32..12,
        cells in prop::collection::vec(0u16..3, 144),
        most in 1u8..7,
    ) {
        // Blocks of two by two, so that there is an inside.
        let at = |i: u32| cells[((i / width / 3) * 12 + i % width / 3) as usize];
        let labels = Grid::from_vec(Size::new(width, height), (0..width * height).map(at).collect()).unwrap();
        prop_assert_eq!(border_distance(&labels, most).into_vec(), slow_distance(&labels, most));
    }

    #[test]
    fn a_majority_of_right_views_is_enough(wrong in prop::collection::vec(any::<bool>(), 7)) {
        // Each view errs as a whole or not at all.
        let views = TestViews::new(7, |view, _, _| if wrong[view] { WINDOW } else { WALL });
        let expected = if wrong.iter().filter(|w| **w).count() > 3 { WINDOW } else { WALL };
        for view in 0..7 {
            prop_assert_eq!(views.consensus(view).labels[MIDDLE], expected);
        }
    }
}
