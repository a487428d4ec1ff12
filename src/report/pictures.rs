//! Maps as pictures: perceptual ramps for depths and confidences, directions and classes as colours.

use crate::evaluate::Presence;
use crate::scene::{ColorImage, ConfidenceMap, DepthMap, Grid, LabelMap, NormalMap};
use crate::semantics::{ClassId, ClassTable};

/// Colours of values from 0 to 1; lightness changes evenly, so that equal steps look equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ramp(&'static [[u8; 3]]);

impl Ramp {
    /// Depths, the near ones bright: viridis (van der Walt and Smith 2015) from its bright end.
    pub const DEPTH: Ramp = Ramp(&[
        [253, 231, 37],
        [170, 220, 50],
        [92, 200, 99],
        [39, 173, 129],
        [33, 144, 141],
        [44, 113, 142],
        [59, 81, 139],
        [71, 44, 122],
        [68, 1, 84],
    ]);
    /// Confidences, the good ones bright: magma of the same authors.
    pub const CONFIDENCE: Ramp = Ramp(&[
        [0, 0, 4],
        [28, 16, 68],
        [79, 18, 123],
        [129, 37, 129],
        [181, 54, 122],
        [229, 80, 100],
        [251, 135, 97],
        [254, 194, 135],
        [252, 253, 191],
    ]);

    /// Differences from −1 to 1, none of them in the middle: RdBu of ColorBrewer (Harrower and Brewer 2003), blue first.
    pub const DIFFERENCE: Ramp = Ramp(&[
        [33, 102, 172],
        [67, 147, 195],
        [146, 197, 222],
        [209, 229, 240],
        [247, 247, 247],
        [253, 219, 199],
        [244, 165, 130],
        [214, 96, 77],
        [178, 24, 43],
    ]);
    /// Differences without a sign: the second half of [`Ramp::DIFFERENCE`].
    pub const AMOUNT: Ramp =
        Ramp(&[[247, 247, 247], [253, 219, 199], [244, 165, 130], [214, 96, 77], [178, 24, 43]]);

    /// Evenly spaced colours, the first of 0, the last of 1.
    pub fn stops(&self) -> &'static [[u8; 3]] {
        self.0
    }

    /// The colour of `value`, which counts as 0 below 0 and where it is no number, and as 1 above 1.
    pub fn at(&self, value: f32) -> [u8; 3] {
        let last = self.0.len() - 1;
        let place = if value > 0.0 { value.min(1.0) * last as f32 } else { 0.0 };
        let below = (place as usize).min(last.saturating_sub(1));
        let (from, to) = (self.0[below], self.0[(below + 1).min(last)]);
        let share = place - below as f32;
        std::array::from_fn(|k| {
            let (from, to) = (f32::from(from[k]), f32::from(to[k]));
            (from + (to - from) * share).round() as u8
        })
    }
}

/// Colour of a pixel without a value.
pub const NOTHING: [u8; 3] = [206, 209, 213];

/// The same in pictures of differences, whose middle is nearly white.
const NO_DIFFERENCE: [u8; 3] = [150, 154, 160];
/// What only the first of two results has, and only the second (Okabe and Ito 2008: apart for every kind of eye).
pub(super) const ONLY_A: [u8; 3] = [230, 159, 0];
pub(super) const ONLY_B: [u8; 3] = [0, 114, 178];
/// Steps of the ramps in pictures of differences: few enough for the palette of a PNG.
const STEPS: f32 = 100.0;

/// Share of the depths at either end of all that do not count for the scale.
const OUTLIERS: f64 = 0.01;

/// A scale for depths: from the smallest to the largest of `depths`, but for one percent at either end, a little widened.
/// Sorts them. (0, 1) without depths.
pub fn depth_scale(depths: &mut [f32]) -> (f32, f32) {
    depths.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| depths.get((share * depths.len().saturating_sub(1) as f64).round() as usize);
    match (at(OUTLIERS), at(1.0 - OUTLIERS)) {
        (Some(&low), Some(&high)) => {
            let margin = (0.02 * (high - low)).max(1e-6 * high);
            ((low - margin).max(0.0), high + margin)
        }
        _ => (0.0, 1.0),
    }
}

/// Depths in the colours of [`Ramp::DEPTH`], which goes from `scale.0` to `scale.1`.
pub fn depth_picture(depth: &DepthMap, scale: (f32, f32)) -> ColorImage {
    let width = (scale.1 - scale.0).max(f32::MIN_POSITIVE);
    picture(depth, |_, &d| (d > 0.0).then(|| Ramp::DEPTH.at((d - scale.0) / width)))
}

/// Confidences in the colours of [`Ramp::CONFIDENCE`], from 0 to 1; nothing where there is no depth.
pub fn confidence_picture(confidence: &ConfidenceMap, depth: &DepthMap) -> ColorImage {
    picture(confidence, |i, &c| has_depth(depth, i).then(|| Ramp::CONFIDENCE.at(c)))
}

/// Normals as colours: red to the right, green up, blue towards the camera; nothing where there is no depth.
pub fn normal_picture(normals: &NormalMap, depth: &DepthMap) -> ColorImage {
    let channel = |v: f32| (127.5 + 127.5 * v.clamp(-1.0, 1.0)).round() as u8;
    picture(normals, |i, &[x, y, z]| has_depth(depth, i).then(|| [channel(x), channel(-y), channel(-z)]))
}

/// Labels in the colours of `table`.
pub fn label_picture(labels: &LabelMap, table: &ClassTable) -> ColorImage {
    picture(labels, |_, &id| Some(table.color(ClassId(id))))
}

/// Labels over the photograph, both equally strong; void pixels show the photograph. A photograph of another size is left
/// out.
pub fn label_overlay(labels: &LabelMap, table: &ClassTable, photograph: &ColorImage) -> ColorImage {
    if photograph.size() != labels.size() {
        return label_picture(labels, table);
    }
    picture(labels, |i, &id| {
        let below = photograph.data()[i];
        if ClassId(id) == ClassId::VOID {
            return Some(below);
        }
        let over = table.color(ClassId(id));
        Some(std::array::from_fn(|k| ((u16::from(over[k]) + u16::from(below[k])) / 2) as u8))
    })
}

/// The photograph in pale grey, if there is one of this size, with the pixels of `marked` in red.
pub fn marked_picture(marked: &Grid<bool>, photograph: Option<&ColorImage>) -> ColorImage {
    const RED: [u8; 3] = [230, 40, 30];
    let photograph = photograph.filter(|photograph| photograph.size() == marked.size());
    picture(marked, |i, &is_marked| match (is_marked, photograph) {
        (true, _) => Some(RED),
        (false, Some(photograph)) => {
            let [r, g, b] = photograph.data()[i].map(u32::from);
            Some([((3 * r + 6 * g + b) / 20 + 110) as u8; 3])
        }
        (false, None) => None,
    })
}

/// Differences from `-most` to `most` in the colours of [`Ramp::DIFFERENCE`]; grey where they are not numbers.
pub fn signed_picture(differences: &Grid<f32>, most: f32) -> ColorImage {
    steps(differences, most, |share| Ramp::DIFFERENCE.at(0.5 + 0.5 * share))
}

/// Differences from 0 to `most` in the colours of [`Ramp::AMOUNT`]; grey where they are not numbers.
pub fn amount_picture(differences: &Grid<f32>, most: f32) -> ColorImage {
    steps(differences, most, |share| Ramp::AMOUNT.at(share))
}

fn steps(differences: &Grid<f32>, most: f32, color: impl Fn(f32) -> [u8; 3]) -> ColorImage {
    let mut out = picture(differences, |_, &d| {
        let share = if d == 0.0 { 0.0 } else { (d / most).clamp(-1.0, 1.0) };
        (!d.is_nan()).then(|| color((share * STEPS).round() / STEPS))
    });
    for (pixel, d) in out.data_mut().iter_mut().zip(differences.data()) {
        if d.is_nan() {
            *pixel = NO_DIFFERENCE;
        }
    }
    out
}

/// Which of two maps has a depth: nearly white where both have, orange and blue for one alone, grey for none.
pub fn presence_picture(presence: &Grid<Presence>) -> ColorImage {
    picture(presence, |_, presence| {
        Some(match presence {
            Presence::Both => Ramp::AMOUNT.at(0.0),
            Presence::OnlyA => ONLY_A,
            Presence::OnlyB => ONLY_B,
            Presence::Neither => NO_DIFFERENCE,
        })
    })
}

fn has_depth(depth: &DepthMap, i: usize) -> bool {
    depth.data().get(i).is_some_and(|&d| d > 0.0)
}

/// A picture of the size of `map`, [`NOTHING`] where `color` gives none.
fn picture<T>(map: &Grid<T>, color: impl Fn(usize, &T) -> Option<[u8; 3]>) -> ColorImage {
    let mut out = ColorImage::filled(map.size(), NOTHING);
    for (i, (pixel, value)) in out.data_mut().iter_mut().zip(map.data()).enumerate() {
        *pixel = color(i, value).unwrap_or(NOTHING);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;

    #[test]
    fn ramps_go_from_stop_to_stop_and_no_further() {
        for ramp in [Ramp::DEPTH, Ramp::CONFIDENCE] {
            let stops = ramp.stops();
            assert_eq!((ramp.at(0.0), ramp.at(-3.0)), (stops[0], stops[0]));
            assert_eq!((ramp.at(1.0), ramp.at(7.0)), (stops[8], stops[8]));
            assert_eq!(ramp.at(0.5), stops[4]);
            let lightness = |c: [u8; 3]| c.iter().zip([2, 7, 1]).map(|(&v, w)| i32::from(v) * w).sum::<i32>();
            let light: Vec<i32> = (0..=20).map(|i| lightness(ramp.at(i as f32 / 20.0))).collect();
            let rising = light.windows(2).filter(|w| w[1] > w[0]).count();
            assert!(rising == 0 || rising == 20, "{light:?}");
        }
        assert_eq!(Ramp::DEPTH.at(0.0625), [212, 226, 44], "halfway, rounded");
        assert_eq!(Ramp::DEPTH.at(f32::NAN), Ramp::DEPTH.at(0.0));
    }

    #[test]
    fn a_scale_ignores_outliers() {
        let mut depths: Vec<f32> = (0..1000).map(|i| 10.0 + i as f32 / 1000.0).collect();
        depths[3] = 1e6;
        depths[7] = 0.001;
        let (low, high) = depth_scale(&mut depths);
        assert!((9.9..10.02).contains(&low) && (10.98..11.1).contains(&high), "{low} {high}");
        assert_eq!(depth_scale(&mut []), (0.0, 1.0));
        let (low, high) = depth_scale(&mut [5.0]);
        assert!(low < 5.0 && high > 5.0);
    }

    #[test]
    fn what_has_no_depth_has_no_colour() {
        let size = Size::new(2, 1);
        let depth = Grid::from_vec(size, vec![0.0, 2.0]).unwrap();
        let ones = Grid::from_vec(size, vec![1.0, 1.0]).unwrap();
        assert_eq!(depth_picture(&depth, (2.0, 4.0)).data(), [NOTHING, Ramp::DEPTH.at(0.0)]);
        assert_eq!(confidence_picture(&ones, &depth).data(), [NOTHING, Ramp::CONFIDENCE.at(1.0)]);
        let normals = Grid::from_vec(size, vec![[0.0, 0.0, -1.0]; 2]).unwrap();
        assert_eq!(normal_picture(&normals, &depth).data(), [NOTHING, [128, 128, 255]]);
    }

    #[test]
    fn differences_are_white_in_the_middle_and_have_few_colours() {
        let size = Size::new(5, 1);
        let differences = Grid::from_vec(size, vec![-3.0, 0.0, 0.5, f32::NAN, f32::INFINITY]).unwrap();
        let ramp = Ramp::DIFFERENCE;
        let expected = [ramp.at(0.0), ramp.at(0.5), ramp.at(0.75), NO_DIFFERENCE, ramp.at(1.0)];
        assert_eq!(signed_picture(&differences, 1.0).data(), expected);
        assert_eq!(amount_picture(&differences, 1.0).data()[1..3], [ramp.at(0.5), ramp.at(0.75)]);
        assert_eq!(signed_picture(&Grid::filled(size, 0.0), 0.0).data(), [ramp.at(0.5); 5]);
        let many = Grid::from_vec(Size::new(5000, 1), (0..5000).map(|i| i as f32 / 2500.0 - 1.0).collect());
        let colors: std::collections::BTreeSet<[u8; 3]> =
            signed_picture(&many.unwrap(), 1.0).data().iter().copied().collect();
        assert!((150..=201).contains(&colors.len()), "{}", colors.len());
        let presence = [Presence::Both, Presence::OnlyA, Presence::OnlyB, Presence::Neither, Presence::Both];
        let picture = presence_picture(&Grid::from_vec(size, presence.to_vec()).unwrap());
        assert_eq!(picture.data(), [ramp.at(0.5), ONLY_A, ONLY_B, NO_DIFFERENCE, ramp.at(0.5)]);
    }

    #[test]
    fn labels_lie_over_the_photograph_where_there_are_some() {
        let table = ClassTable::builtin("3dom-facade").unwrap();
        let labels = Grid::from_vec(Size::new(2, 1), vec![0, 1]).unwrap();
        let photograph = Grid::from_vec(Size::new(2, 1), vec![[10, 20, 30]; 2]).unwrap();
        assert_eq!(label_picture(&labels, &table).data(), [[0, 0, 0], [0, 0, 255]]);
        assert_eq!(label_overlay(&labels, &table, &photograph).data(), [[10, 20, 30], [5, 10, 142]]);
        let marks = Grid::from_vec(Size::new(2, 1), vec![true, false]).unwrap();
        assert_eq!(marked_picture(&marks, Some(&photograph)).data(), [[230, 40, 30], [119; 3]]);
        assert_eq!(marked_picture(&marks, None).data(), [[230, 40, 30], NOTHING]);
        let other = ColorImage::filled(Size::new(1, 1), [0; 3]);
        assert_eq!(label_overlay(&labels, &table, &other), label_picture(&labels, &table));
    }
}
