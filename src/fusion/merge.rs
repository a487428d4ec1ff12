//! Second pass: decides in raster order which pixels become points, and claims them. This is the only part of a
//! view's turn that depends on what came before.

use super::correspond::{Relation, RowMatches};
use super::participant::Participant;
use super::state::PixelStates;
use super::summary::Tally;
use crate::semantics::{ClassPolicy, Consistency, LabelVote, Vote};

/// A pixel of the step's `view`-th participant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Member {
    pub(super) view: u32,
    pub(super) pixel: u32,
}

/// A point that has been decided on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Claim {
    /// Position among the row's columns.
    pub(super) column: usize,
    /// End of its part of [`RowClaims::members`], which starts where the previous one's ends.
    pub(super) members_end: usize,
    pub(super) label: LabelVote,
}

/// The points of one row and the neighbour pixels that support them.
#[derive(Default)]
pub(super) struct RowClaims {
    pub(super) claims: Vec<Claim>,
    pub(super) members: Vec<Member>,
}

/// Decides row by row.
pub(super) struct Merger<'a> {
    pub(super) min_views: usize,
    /// `None`: labels take no part.
    pub(super) policy: Option<&'a ClassPolicy>,
    /// Members that the candidate at hand has claimed.
    claimed: Vec<Member>,
    behind: Vec<Member>,
    dissenters: Vec<Member>,
    /// How many of those no point has claimed.
    unclaimed_dissenters: usize,
    vote: Vote,
}

/// What became of a candidate.
enum Outcome {
    Point(LabelVote),
    TooFewViews,
    InconsistentLabels,
    ExcludedLabel,
}

impl<'a> Merger<'a> {
    pub(super) fn new(min_views: usize, policy: Option<&'a ClassPolicy>) -> Self {
        Merger {
            min_views,
            policy,
            claimed: Vec::new(),
            behind: Vec::new(),
            dissenters: Vec::new(),
            unclaimed_dissenters: 0,
            vote: Vote::default(),
        }
    }

    /// Turns the candidates of row `y` into points; `states`, parallel to `views`, remember the pixels that points
    /// claim or push away. `invalidated` counts the latter by view.
    pub(super) fn merge_row(
        &mut self,
        views: &[Participant<'_>],
        y: u32,
        row: &RowMatches,
        states: &mut [PixelStates],
        out: &mut RowClaims,
        tally: &mut Tally,
    ) {
        out.claims.clear();
        out.members.clear();
        for (i, &x) in row.columns.iter().enumerate() {
            let own = y * views[0].width + x;
            let start = out.members.len();
            self.collect(row, i, views.len() - 1, states, out);
            match self.judge(views, own, &out.members[start..]) {
                Outcome::Point(label) => {
                    states[0].claim(own);
                    for hidden in &self.behind {
                        states[hidden.view as usize].invalidate(hidden.pixel);
                        tally.invalidated[hidden.view as usize] += 1;
                    }
                    tally.add_point(label);
                    out.claims.push(Claim { column: i, members_end: out.members.len(), label });
                    continue;
                }
                Outcome::TooFewViews => {}
                Outcome::InconsistentLabels => {
                    tally.class(views[0].label(own as usize)).rejected_by_consistency += 1;
                }
                Outcome::ExcludedLabel => tally.class(views[0].label(own as usize)).rejected_by_class += 1,
            }
            out.members.truncate(start);
            for member in &self.claimed {
                states[member.view as usize].give_back(member.pixel);
            }
        }
    }

    /// Gathers the pixels that support candidate `i`, claims the free ones of them, and notes the others of interest.
    fn collect(
        &mut self,
        row: &RowMatches,
        i: usize,
        neighbors: usize,
        states: &mut [PixelStates],
        out: &mut RowClaims,
    ) {
        self.claimed.clear();
        self.behind.clear();
        self.dissenters.clear();
        self.unclaimed_dissenters = 0;
        for neighbor in 0..neighbors {
            let Some((relation, pixel)) = row.get(neighbor, i) else { continue };
            let states = &mut states[neighbor + 1];
            if !states.supports(pixel) {
                continue;
            }
            let member = Member { view: neighbor as u32 + 1, pixel };
            match relation {
                Relation::Agrees => {
                    if states.is_free(pixel) {
                        states.claim(pixel);
                        self.claimed.push(member);
                    }
                    out.members.push(member);
                }
                Relation::Dissents => {
                    self.unclaimed_dissenters += usize::from(states.is_free(pixel));
                    self.dissenters.push(member);
                }
                Relation::Behind if states.is_free(pixel) => self.behind.push(member),
                Relation::Behind => {}
            }
        }
    }

    /// Depths that have made a point already are no news: where they are needed, one view more is asked for.
    fn are_enough(&self, unclaimed: usize, all: usize) -> bool {
        unclaimed >= self.min_views || all > self.min_views
    }

    fn judge(&mut self, views: &[Participant<'_>], own: u32, members: &[Member]) -> Outcome {
        let (unclaimed, all) = (self.claimed.len() + 1, members.len() + 1);
        let enough = self.are_enough(unclaimed, all);
        let Some(policy) = self.policy else {
            return if enough { Outcome::Point(LabelVote::default()) } else { Outcome::TooFewViews };
        };
        if !enough {
            let (unclaimed, all) = (unclaimed + self.unclaimed_dissenters, all + self.dissenters.len());
            let missed = self.are_enough(unclaimed, all);
            return if missed { Outcome::InconsistentLabels } else { Outcome::TooFewViews };
        }
        if policy.consistency() == Consistency::Strict && !self.dissenters.is_empty() {
            return Outcome::InconsistentLabels;
        }
        let pixel = |m: &Member| (&views[m.view as usize], m.pixel as usize);
        self.vote.clear();
        let own_pixel = std::iter::once((&views[0], own as usize));
        for (view, pixel) in own_pixel.chain(members.iter().map(pixel)) {
            self.vote.support_partly(view.label(pixel), view.pixels[pixel].weight, view.certainty(pixel));
        }
        for (view, pixel) in self.dissenters.iter().map(pixel) {
            self.vote.dissent(view.label(pixel), view.pixels[pixel].weight);
        }
        let label = self.vote.outcome(views[0].label(own as usize));
        if policy.is_candidate(label.label) { Outcome::Point(label) } else { Outcome::ExcludedLabel }
    }
}
