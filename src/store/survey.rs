//! What must be known of a cloud before its files are begun.

use super::cloud::ClassPoints;
use crate::error::{Error, Result};
use crate::geometry::Placement;
use crate::scene::PointSource;
use crate::semantics::ClassId;
use std::collections::BTreeMap;

/// Least and largest coordinates.
pub(super) type Bounds = [[f64; 3]; 2];

/// The points of a cloud, counted and measured.
#[derive(Clone, Debug, Default)]
pub(super) struct Survey {
    /// All points.
    pub(super) points: u64,
    /// Points by class; empty unless they were counted.
    pub(super) classes: BTreeMap<ClassId, ClassPoints>,
    /// Bounds of the points of each class where they go; empty unless they were measured.
    bounds: BTreeMap<ClassId, Bounds>,
}

impl Survey {
    /// Bounds of the points of `class`, or of all; `None` if there are none.
    pub(super) fn bounds(&self, class: Option<ClassId>) -> Option<Bounds> {
        match class {
            Some(class) => self.bounds.get(&class).copied(),
            None => self.bounds.values().copied().reduce(|mut all, other| {
                other.into_iter().for_each(|corner| widen(&mut all, corner));
                all
            }),
        }
    }
}

fn widen(bounds: &mut Bounds, point: [f64; 3]) {
    for axis in 0..3 {
        bounds[0][axis] = bounds[0][axis].min(point[axis]);
        bounds[1][axis] = bounds[1][axis].max(point[axis]);
    }
}

/// Goes through `source` as far as is needed: for the points of each class if it is to `count`, for the bounds after
/// `placement` if it is to `measure`.
///
/// # Errors
/// The cloud cannot be read; a coordinate that is to be measured is no number.
pub(super) fn survey(
    source: &dyn PointSource,
    count: bool,
    measure: bool,
    placement: &Placement,
) -> Result<Survey> {
    let mut survey = Survey { points: source.len(), ..Survey::default() };
    if !count && !measure {
        return Ok(survey);
    }
    let mut number = 0u64;
    source.for_each(&mut |point| {
        let id = ClassId(point.label);
        if count {
            let class = survey.classes.entry(id).or_default();
            class.points += 1;
            class.confidence_sum += f64::from(point.label_confidence);
        }
        if measure {
            let place = placement.place(point.position);
            if place.iter().any(|v| !v.is_finite()) {
                return Err(Error::invalid(format!(
                    "point {number} has a coordinate that is no number; LAS cannot hold it, write .ply"
                )));
            }
            widen(survey.bounds.entry(id).or_insert([place; 2]), place);
        }
        number += 1;
        Ok(())
    })?;
    Ok(survey)
}
