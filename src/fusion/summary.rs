//! What fusion has done, in numbers.

use crate::semantics::LabelVote;

/// The outcome of a fusion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FusionSummary {
    /// Views that started points.
    pub maps: usize,
    /// Depths visited: those of the maps less the ones that earlier points had invalidated.
    pub depths: u64,
    /// Points.
    pub points: u64,
    /// By class id, ascending; empty without labels.
    pub classes: Vec<ClassCounts>,
}

/// What became of the pixels of one class.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ClassCounts {
    /// Class id, 0 = void.
    pub id: u16,
    /// Pixels with this label in the maps of the views that started points.
    pub pixels: u64,
    /// Those that have a depth.
    pub depths: u64,
    /// Points with this label.
    pub points: u64,
    /// Sum of the label confidences of those points.
    pub label_confidence_sum: f64,
    /// Free pixels that started no point because this class, or the class voted for, is not kept.
    pub rejected_by_class: u64,
    /// Pixels whose point failed only because labels of other views differ.
    pub rejected_by_consistency: u64,
}

impl ClassCounts {
    /// Mean label confidence of the points, 0 without points.
    pub fn mean_label_confidence(&self) -> f64 {
        if self.points == 0 { 0.0 } else { self.label_confidence_sum / self.points as f64 }
    }

    fn is_empty(&self) -> bool {
        *self == ClassCounts { id: self.id, ..ClassCounts::default() }
    }
}

/// Counts in the making.
#[derive(Clone, Debug, Default)]
pub(super) struct Tally {
    pub(super) points: u64,
    labelled: bool,
    by_class: Vec<ClassCounts>,
    /// Pixels invalidated in the current step, by participant.
    pub(super) invalidated: Vec<u64>,
}

impl Tally {
    pub(super) fn new(labelled: bool) -> Self {
        Tally { labelled, ..Tally::default() }
    }

    /// The counts of class `id`.
    #[inline]
    pub(super) fn class(&mut self, id: u16) -> &mut ClassCounts {
        let i = usize::from(id);
        while self.by_class.len() <= i {
            let id = self.by_class.len() as u16;
            self.by_class.push(ClassCounts { id, ..ClassCounts::default() });
        }
        &mut self.by_class[i]
    }

    #[inline]
    pub(super) fn add_point(&mut self, vote: LabelVote) {
        self.points += 1;
        if self.labelled {
            let class = self.class(vote.label.0);
            class.points += 1;
            class.label_confidence_sum += f64::from(vote.confidence);
        }
    }

    pub(super) fn into_summary(self, maps: usize, depths: u64) -> FusionSummary {
        let classes = self.by_class.into_iter().filter(|c| !c.is_empty()).collect();
        FusionSummary { maps, depths, points: self.points, classes }
    }
}
