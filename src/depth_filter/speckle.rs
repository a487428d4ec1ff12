//! Removal of small regions that are cut off from their surroundings by depth steps.

use super::DepthFilterOptions;
use crate::geometry::is_similar_depth;
use crate::scene::DepthEstimate;

/// Relative depth step between neighbouring pixels of one region, in units of the depth difference threshold.
const STEP_FACTOR: f32 = 0.7;

/// Clears depth, normal and confidence of every 4-connected region of fewer than `speckle_size` pixels; returns
/// the number of depths removed.
///
/// A pixel joins the region of its neighbour when their depths differ by less than 0.7 times the threshold
/// relative to the neighbour. That relation is not symmetric, so regions depend on the order of visits: seeds
/// column by column, then breadth first (left, right, up, down).
pub fn remove_speckles(estimate: &mut DepthEstimate, options: &DepthFilterOptions) -> usize {
    if options.speckle_size <= 1 {
        return 0;
    }
    let max_step = options.depth_diff_threshold * STEP_FACTOR;
    let (width, height) = (estimate.depth.width(), estimate.depth.height());
    let mut visited = vec![false; width * height];
    let mut region: Vec<u32> = Vec::new();
    let mut removed = 0;
    for x in 0..width {
        for y in 0..height {
            let seed = y * width + x;
            if visited[seed] {
                continue;
            }
            region.clear();
            region.push(seed as u32);
            visited[seed] = true;
            grow(estimate.depth.data(), width, height, max_step, &mut visited, &mut region);
            if region.len() < options.speckle_size as usize {
                removed += clear(estimate, &region);
            }
        }
    }
    removed
}

/// Extends `region` breadth first over all pixels that can be reached from its first.
fn grow(
    depth: &[f32],
    width: usize,
    height: usize,
    max_step: f32,
    visited: &mut [bool],
    region: &mut Vec<u32>,
) {
    let mut next = 0;
    while let Some(&pixel) = region.get(next) {
        next += 1;
        let i = pixel as usize;
        let (x, y) = (i % width, i / width);
        let current = depth[i];
        let mut visit = |j: usize| {
            if !visited[j] && depth[j] > 0.0 && is_similar_depth(current, depth[j], max_step) {
                visited[j] = true;
                region.push(j as u32);
            }
        };
        if x > 0 {
            visit(i - 1);
        }
        if x + 1 < width {
            visit(i + 1);
        }
        if y > 0 {
            visit(i - width);
        }
        if y + 1 < height {
            visit(i + width);
        }
    }
}

/// Empties the pixels of `region`; returns how many had a depth.
fn clear(estimate: &mut DepthEstimate, region: &[u32]) -> usize {
    let mut removed = 0;
    for &i in region {
        let depth = &mut estimate.depth.data_mut()[i as usize];
        removed += usize::from(*depth > 0.0);
        *depth = 0.0;
    }
    if let Some(normal) = &mut estimate.normal {
        region.iter().for_each(|&i| normal.data_mut()[i as usize] = [0.0; 3]);
    }
    if let Some(confidence) = &mut estimate.confidence {
        region.iter().for_each(|&i| confidence.data_mut()[i as usize] = 0.0);
    }
    removed
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synthetic::estimate_of_depths;

    /// A wall at depth 10 with a block of `width` × `height` pixels at depth 5 in the middle.
    fn wall_with_block(width: usize, height: usize) -> DepthEstimate {
        estimate_of_depths(40, 30, |x, y| {
            if (10..10 + width).contains(&x) && (8..8 + height).contains(&y) { 5.0 } else { 10.0 }
        })
    }

    #[test]
    fn a_region_below_the_size_goes_and_one_of_the_size_stays() {
        let options = DepthFilterOptions::default();
        let mut small = wall_with_block(11, 9);
        assert_eq!(remove_speckles(&mut small, &options), 99);
        assert_eq!(small.depth[(10, 8)], 0.0);
        assert_eq!(small.confidence.as_ref().unwrap()[(20, 16)], 0.0);
        assert_eq!(small.normal.as_ref().unwrap()[(20, 16)], [0.0; 3]);
        assert_eq!(small.depth[(21, 16)], 10.0);

        let mut large = wall_with_block(10, 10);
        let before = large.clone();
        assert_eq!(remove_speckles(&mut large, &options), 0);
        assert_eq!(large, before);
    }

    #[test]
    fn diagonal_pixels_are_not_connected() {
        let mut chess = estimate_of_depths(40, 30, |x, y| if (x + y) % 2 == 0 { 4.0 } else { 0.0 });
        assert_eq!(remove_speckles(&mut chess, &DepthFilterOptions::default()), 600);
        assert!(chess.depth.data().iter().all(|&d| d == 0.0));
    }

    #[test]
    fn a_slope_within_the_step_is_one_region() {
        let slope = estimate_of_depths(40, 3, |x, _| 10.0 * 1.0069_f32.powi(x as i32));
        let mut kept = slope.clone();
        assert_eq!(remove_speckles(&mut kept, &DepthFilterOptions::default()), 0);
        let mut steep = estimate_of_depths(40, 2, |x, _| 10.0 * 1.008_f32.powi(x as i32));
        assert_eq!(remove_speckles(&mut steep, &DepthFilterOptions::default()), 80);
    }
}
