//! A second vote on the labels of a finished cloud, over the points around each point.

use super::LabelVote;
use crate::geometry::NearestIndex;
use rayon::prelude::*;

/// Cosine of the largest angle between the normals of points that are one surface, 25°.
const MIN_COS_NORMAL: f32 = 0.906;

/// The label of every point by the vote of itself and its `count` nearest points whose normals are similar, each with its
/// label confidence; a tie goes to the point's own label, then to the smaller id. The new confidence is the mean, over all
/// who were asked, of the confidence in the winner.
///
/// Points across an edge have other normals and no vote; along a border of classes on one surface the vote takes the side
/// of the majority, which keeps straight borders where they are. `normals` may be empty: then all near points are asked.
/// The vote reads the labels as they came, so that the order of points does not matter.
pub fn smooth_labels(
    positions: &[[f64; 3]],
    normals: &[[f32; 3]],
    labels: &[LabelVote],
    count: usize,
) -> Vec<LabelVote> {
    let index = NearestIndex::new(positions);
    let similar = |a: usize, b: usize| match (normals.get(a), normals.get(b)) {
        (Some(a), Some(b)) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > MIN_COS_NORMAL,
        _ => true,
    };
    let vote = |i: usize| {
        let own = labels[i];
        let around = index.nearest_n(&positions[i], count + 1);
        let others = around.iter().map(|n| n.index as usize).filter(|&j| j != i && similar(i, j));
        let mut asked = 0u32;
        let mut sums: Vec<(super::ClassId, f32)> = Vec::with_capacity(4);
        for vote in others.take(count).map(|j| labels[j]).chain([own]).filter(|v| !v.label.is_void()) {
            asked += 1;
            match sums.iter_mut().find(|(id, _)| *id == vote.label) {
                Some((_, sum)) => *sum += vote.confidence,
                None => sums.push((vote.label, vote.confidence)),
            }
        }
        let rank = |id| (id != own.label, id);
        let better = |a: (super::ClassId, f32), b: (super::ClassId, f32)| {
            if b.1 > a.1 || (b.1 == a.1 && rank(b.0) < rank(a.0)) { b } else { a }
        };
        match sums.into_iter().reduce(better) {
            Some((label, sum)) => LabelVote { label, confidence: sum / asked as f32 },
            None => own,
        }
    };
    (0..positions.len()).into_par_iter().map(vote).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::semantics::ClassId;

    /// A grid of 20 by 20 points in a plane; the left half is class 1, the right half class 4.
    fn board() -> (Vec<[f64; 3]>, Vec<LabelVote>) {
        let at = |i: usize| (i % 20, i / 20);
        let position = |i| [at(i).0 as f64, at(i).1 as f64, 0.0];
        let label = |i| LabelVote { label: ClassId(if at(i).0 < 10 { 1 } else { 4 }), confidence: 0.9 };
        ((0..400).map(position).collect(), (0..400).map(label).collect())
    }

    #[test]
    fn single_errors_go_and_the_border_stays() {
        let (positions, right) = board();
        let normals = vec![[0.0, 0.0, 1.0]; 400];
        let mut labels = right.clone();
        for wrong in [45, 173, 311] {
            labels[wrong] = LabelVote { label: ClassId(5), confidence: 0.6 };
        }
        let smooth = smooth_labels(&positions, &normals, &labels, 8);
        let same = |(a, b): (&LabelVote, &LabelVote)| a.label == b.label;
        assert!(smooth.iter().zip(&right).all(same));
        assert!(smooth[45].confidence < smooth[55].confidence && smooth[55].confidence > 0.89);
    }

    #[test]
    fn points_across_an_edge_have_no_vote() {
        let (mut positions, mut labels) = board();
        // The right half is folded up; one point there lies among the other half's.
        let mut normals = vec![[0.0, 0.0, 1.0f32]; 400];
        for i in (0..400).filter(|i| i % 20 >= 10) {
            normals[i] = [1.0, 0.0, 0.0];
        }
        positions[215] = [5.0, 10.1, 0.0];
        labels[215].confidence = 0.5;
        let smooth = smooth_labels(&positions, &normals, &labels, 8);
        assert_eq!(smooth[215].label, ClassId(4));
        let blind = smooth_labels(&positions, &[], &labels, 8);
        assert_eq!(blind[215].label, ClassId(1));
    }

    #[test]
    fn void_has_no_vote_but_takes_a_label() {
        let (positions, mut labels) = board();
        labels[44] = LabelVote::default();
        let smooth = smooth_labels(&positions, &[], &labels, 8);
        assert_eq!(smooth[44].label, ClassId(1));
        let all_void = smooth_labels(&positions, &[], &[LabelVote::default(); 400], 8);
        assert!(all_void.iter().all(|v| *v == LabelVote::default()));
    }
}
