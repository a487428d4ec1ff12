//! The label of a point from the labels of the pixels it is made of.

use super::ClassId;

/// What the pixels of a point say about its class.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LabelVote {
    /// The winning class; void if no pixel had a class.
    pub label: ClassId,
    /// Winning weight over the weight of all labelled pixels, dissenters included: 0 for void, 1 for unanimous.
    pub confidence: f32,
}

/// A weighted vote over the pixels of one point. Reusable, so that fusion allocates nothing per point.
///
/// Sums are taken in the order of the calls; that order must not depend on threads.
#[derive(Clone, Debug, Default)]
pub struct Vote {
    weights: Vec<(ClassId, f64)>,
    dissent: f64,
    doubt: f64,
}

impl Vote {
    /// Forgets all pixels.
    pub fn clear(&mut self) {
        self.weights.clear();
        self.dissent = 0.0;
        self.doubt = 0.0;
    }

    /// Counts a pixel that is merged into the point, the reference pixel included, with its fusion weight (> 0).
    pub fn support(&mut self, label: impl Into<ClassId>, weight: f32) {
        self.support_partly(label, weight, 1.0);
    }

    /// The same for a pixel whose label is certain to the degree of `certainty`, 0..1: the rest of its weight speaks for
    /// no class and lowers the confidence.
    pub fn support_partly(&mut self, label: impl Into<ClassId>, weight: f32, certainty: f32) {
        let label = label.into();
        if label.is_void() {
            return;
        }
        self.doubt += f64::from(weight * (1.0 - certainty));
        let weight = weight * certainty;
        match self.weights.iter_mut().find(|(id, _)| *id == label) {
            Some((_, sum)) => *sum += f64::from(weight),
            None => self.weights.push((label, f64::from(weight))),
        }
    }

    /// Counts a pixel that agrees in depth and normal but was kept out by its label: it lowers the confidence only.
    pub fn dissent(&mut self, label: impl Into<ClassId>, weight: f32) {
        if !label.into().is_void() {
            self.dissent += f64::from(weight);
        }
    }

    /// The outcome. A tie goes to the reference pixel's label, then to the smaller id.
    pub fn outcome(&self, reference: impl Into<ClassId>) -> LabelVote {
        let reference = reference.into();
        let rank = |id: ClassId| (id != reference, id);
        let mut total = self.dissent + self.doubt;
        let mut best: Option<(ClassId, f64)> = None;
        for &(id, weight) in &self.weights {
            total += weight;
            let wins =
                best.is_none_or(|(other, most)| weight > most || (weight == most && rank(id) < rank(other)));
            if wins {
                best = Some((id, weight));
            }
        }
        match best {
            Some((label, weight)) if total > 0.0 => LabelVote { label, confidence: (weight / total) as f32 },
            _ => LabelVote::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vote(pixels: &[(u16, f32)], reference: u16) -> LabelVote {
        let mut vote = Vote::default();
        for &(label, weight) in pixels {
            vote.support(label, weight);
        }
        vote.outcome(reference)
    }

    #[test]
    fn the_heavier_class_wins_with_its_share() {
        let outcome = vote(&[(1, 1.0), (2, 2.0), (1, 0.5), (0, 100.0)], 1);
        assert_eq!(outcome.label, ClassId(2));
        assert_eq!(outcome.confidence, (2.0f64 / 3.5) as f32);
    }

    #[test]
    fn a_tie_goes_to_the_reference_then_to_the_smaller_id() {
        assert_eq!(vote(&[(2, 1.0), (3, 1.0), (4, 1.0)], 3).label, ClassId(3));
        assert_eq!(vote(&[(4, 1.0), (3, 1.0), (2, 1.0)], 3).label, ClassId(3));
        assert_eq!(vote(&[(4, 1.0), (2, 1.0), (3, 1.0)], 0).label, ClassId(2));
        assert_eq!(vote(&[(4, 1.0), (2, 1.0), (3, 1.5)], 4).label, ClassId(3));
    }

    #[test]
    fn dissenters_lower_the_confidence_but_have_no_vote() {
        let mut vote = Vote::default();
        vote.support(1, 1.0);
        vote.dissent(2, 3.0);
        vote.dissent(0, 50.0);
        assert_eq!(vote.outcome(1), LabelVote { label: ClassId(1), confidence: 0.25 });
    }

    #[test]
    fn doubtful_labels_have_less_weight_and_less_confidence() {
        let mut vote = Vote::default();
        vote.support_partly(1, 2.0, 0.25);
        vote.support_partly(2, 1.0, 0.75);
        vote.support_partly(0, 9.0, 0.5);
        assert_eq!(vote.outcome(1), LabelVote { label: ClassId(2), confidence: 0.25 });
        vote.clear();
        vote.support_partly(1, 2.0, 0.5);
        assert_eq!(vote.outcome(1), LabelVote { label: ClassId(1), confidence: 0.5 });
    }

    #[test]
    fn no_class_at_all_is_void_without_confidence() {
        assert_eq!(vote(&[(0, 1.0), (0, 2.0)], 0), LabelVote::default());
        let mut used = Vote::default();
        used.support(5, 1.0);
        used.dissent(6, 1.0);
        used.clear();
        assert_eq!(used.outcome(5), LabelVote::default());
        used.dissent(6, 1.0);
        assert_eq!(used.outcome(0), LabelVote::default());
    }
}
