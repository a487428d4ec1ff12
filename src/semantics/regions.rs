//! Connected regions of the classes that are planar, each on its own.

use super::ClassPolicy;
use crate::scene::LabelMap;

/// How the pixels of a class are drawn towards planes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanePrior {
    /// Largest angle in degrees, above 0, at most 90, between the normal of a pixel and the plane that it takes part in
    /// fitting. Default 30.
    pub max_normal_deviation: f32,
    /// Pixels of the smallest region that is fitted, at the size of the depth map, at least 1. Default 100.
    pub min_region: u32,
}

impl Default for PlanePrior {
    fn default() -> Self {
        PlanePrior { max_normal_deviation: 30.0, min_region: 100 }
    }
}

/// One connected region of a class whose pixels are drawn towards planes.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarRegion {
    /// Row-major places of its pixels in the depth map, ascending.
    pub pixels: Vec<u32>,
    /// How.
    pub prior: PlanePrior,
}

/// The regions of `labels`, connected over the eight pixels around each, that `policy` wants drawn towards planes, in
/// the order of their first pixels. Classes that are not estimated have none.
pub fn planar_regions(labels: &LabelMap, policy: &ClassPolicy) -> Vec<PlanarRegion> {
    let (width, height) = (labels.width(), labels.height());
    let ids = labels.data();
    let mut taken = vec![false; ids.len()];
    let mut regions = Vec::new();
    for first in 0..ids.len() {
        let prior = policy.plane_prior(ids[first]).filter(|_| policy.is_estimated(ids[first]));
        let Some(prior) = prior.filter(|_| !taken[first]) else { continue };
        taken[first] = true;
        let mut pixels = vec![first as u32];
        let mut next = 0;
        while let Some(&at) = pixels.get(next) {
            next += 1;
            let (x, y) = (at as usize % width, at as usize / width);
            for yy in y.saturating_sub(1)..=(y + 1).min(height - 1) {
                for xx in x.saturating_sub(1)..=(x + 1).min(width - 1) {
                    let i = yy * width + xx;
                    if !taken[i] && ids[i] == ids[first] {
                        taken[i] = true;
                        pixels.push(i as u32);
                    }
                }
            }
        }
        if pixels.len() >= prior.min_region as usize {
            pixels.sort_unstable();
            regions.push(PlanarRegion { pixels, prior });
        }
    }
    regions
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Size;
    use crate::scene::Grid;
    use crate::semantics::{ClassRules, ClassTable};

    const TABLE: &str = "[[class]]\nid = 1\nname = \"wall\"\n[[class]]\nid = 4\nname = \"window\"\nprior = \"plane\"\n\
                         min-region = 3\n";

    fn regions(rules: &ClassRules) -> Vec<Vec<u32>> {
        let table = ClassTable::from_toml(TABLE, std::path::Path::new("t.toml")).unwrap();
        let policy = ClassPolicy::new(&table, rules).unwrap();
        #[rustfmt::skip]
        let ids = vec![
            4, 1, 4, 4, 1,
            1, 4, 1, 1, 1,
            1, 1, 1, 4, 4,
            1, 1, 1, 1, 1,
            4, 4, 4, 1, 1,
        ];
        let labels = Grid::from_vec(Size::new(5, 5), ids).unwrap();
        planar_regions(&labels, &policy).into_iter().map(|region| region.pixels).collect()
    }

    #[test]
    fn regions_touch_at_corners_and_small_ones_are_left_out() {
        assert_eq!(regions(&ClassRules::default()), [vec![0, 2, 3, 6], vec![20, 21, 22]]);
    }

    #[test]
    fn what_is_not_estimated_is_not_fitted() {
        let rules = ClassRules { exclude: vec!["window".into()], ..ClassRules::default() };
        assert!(regions(&rules).is_empty());
    }
}
