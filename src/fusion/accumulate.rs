//! Third pass: position, colour, normal and weights of the points that were decided on. Rows are independent.

use super::color::nearest_view_color;
use super::correspond::RowMatches;
use super::merge::{Claim, Member, RowClaims};
use super::options::AttributeSource;
use super::participant::{Participant, Pixel};
use crate::error::Result;
use crate::scene::{CloudPoint, PointCloud, PointSink, ViewIndex};

/// Weighted sums over the pixels of a point, and its views in ascending order.
#[derive(Default)]
pub(super) struct Accumulator {
    position: [f64; 3],
    color: [f32; 3],
    normal: [f32; 3],
    weight: f64,
    views: Vec<ViewIndex>,
    weights: Vec<f32>,
}

impl Accumulator {
    /// Appends the points of row `y` to `out`.
    ///
    /// # Errors
    /// Those of `out`.
    pub(super) fn emit_row(
        &mut self,
        views: &[Participant<'_>],
        y: u32,
        row: &RowMatches,
        claims: &RowClaims,
        colors: AttributeSource,
        out: &mut PointCloud,
    ) -> Result<()> {
        let mut start = 0;
        for claim in &claims.claims {
            let members = &claims.members[start..claim.members_end];
            start = claim.members_end;
            self.seed(&views[0], y * views[0].width + row.columns[claim.column]);
            for member in members {
                self.add(&views[member.view as usize], member.pixel);
            }
            out.push(&self.point(views, members, claim, colors))?;
        }
        Ok(())
    }

    fn seed(&mut self, view: &Participant<'_>, pixel: u32) {
        let i = pixel as usize;
        let weight = view.pixels[i].weight;
        self.position = view.point(pixel).map(|v| f64::from(v as f32 * weight));
        self.color = view.color.map_or([0.0; 3], |c| c[i].map(|v| f32::from(v) * weight));
        self.normal = view.pixels[i].normal.map(|v| v * weight);
        self.weight = f64::from(weight);
        self.views.clear();
        self.weights.clear();
        self.views.push(view.view);
        self.weights.push(weight);
    }

    fn add(&mut self, view: &Participant<'_>, pixel: u32) {
        let i = pixel as usize;
        let Pixel { weight, normal, .. } = view.pixels[i];
        let point = view.point(pixel);
        for axis in 0..3 {
            self.position[axis] += point[axis] * f64::from(weight);
            self.normal[axis] += normal[axis] * weight;
        }
        if let Some(color) = view.color {
            self.color.iter_mut().zip(color[i]).for_each(|(sum, c)| *sum += f32::from(c) * weight);
        }
        self.weight += f64::from(weight);
        self.views.push(view.view);
        self.weights.push(weight);
        // Few views: the new one is moved to its place step by step.
        let mut at = self.views.len() - 1;
        while at > 0 && self.views[at - 1] > self.views[at] {
            self.views.swap(at - 1, at);
            self.weights.swap(at - 1, at);
            at -= 1;
        }
    }

    fn point(
        &self,
        views: &[Participant<'_>],
        members: &[Member],
        claim: &Claim,
        colors: AttributeSource,
    ) -> CloudPoint<'_> {
        let inverse = 1.0 / self.weight;
        let position = self.position.map(|v| (v * inverse) as f32);
        let inverse = inverse as f32;
        let color = match colors {
            AttributeSource::None => [0; 3],
            AttributeSource::DuringFusion => self.color.map(|v| (v * inverse + 0.5).floor() as u8),
            AttributeSource::AfterFusion => {
                let mut seeing: Vec<_> = members.iter().map(|m| &views[m.view as usize]).collect();
                seeing.push(&views[0]);
                seeing.sort_unstable_by_key(|view| view.view);
                nearest_view_color(position, &seeing)
            }
        };
        CloudPoint {
            position,
            normal: normalized(self.normal.map(|v| v * inverse)),
            color,
            views: &self.views,
            weights: &self.weights,
            confidence: 0.0,
            label: claim.label.label.0,
            label_confidence: claim.label.confidence,
        }
    }
}

/// `v` at length 1, zero if it is zero.
fn normalized(v: [f32; 3]) -> [f32; 3] {
    let norm = v.iter().map(|&c| f64::from(c) * f64::from(c)).sum::<f64>().sqrt();
    if norm > 0.0 { v.map(|c| (f64::from(c) * (1.0 / norm)) as f32) } else { v }
}
