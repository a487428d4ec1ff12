//! Nearest neighbours among points that do not change.

use rayon::prelude::*;

/// Points per leaf.
const LEAF: usize = 12;
/// Subtrees smaller than this are built by one thread.
const PARALLEL: usize = 1 << 14;

/// A k-d tree (Bentley 1975) of equal-sized leaves: split by count at the median along the widest side, so that any
/// number of equal coordinates is harmless.
pub(crate) struct NearestIndex {
    points: Vec<([f64; 3], u32)>,
    /// Inner nodes of the perfect tree, each before its left and then its right subtree.
    nodes: Vec<Node>,
    levels: u32,
    min: [f64; 3],
    max: [f64; 3],
}

#[derive(Clone, Copy, Default)]
struct Node {
    /// Largest coordinate of the left and smallest of the right subtree along `axis`.
    sides: (f64, f64),
    axis: u8,
}

/// A point that was found.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(crate) struct Nearest {
    /// Squared distance.
    pub(crate) squared: f64,
    /// Position in the slice that the index was built from; of equally near points the smallest.
    pub(crate) index: u32,
}

impl NearestIndex {
    /// An index of finite points; at most `u32::MAX` of them.
    pub(crate) fn new(points: &[[f64; 3]]) -> Self {
        let mut points: Vec<_> = points.iter().zip(0u32..).map(|(&p, i)| (p, i)).collect();
        let mut levels = 0;
        while points.len() >> levels > LEAF {
            levels += 1;
        }
        let mut nodes = vec![Node::default(); (1 << levels) - 1];
        let (min, max) = bounds(&points);
        build(&mut points, &mut nodes, (min, max));
        NearestIndex { points, nodes, levels, min, max }
    }

    /// For every point that this index was built from, in that order, the nearest of `others` that is nearer than
    /// `radius`.
    pub(crate) fn nearest_in(&self, others: &NearestIndex, radius: f64) -> Vec<Option<Nearest>> {
        // neighbouring queries one after the other walk through the same memory
        let found: Vec<_> = self.points.par_iter().map(|(p, _)| others.nearest_within(p, radius)).collect();
        let mut in_order = vec![None; found.len()];
        for ((_, index), nearest) in self.points.iter().zip(found) {
            in_order[*index as usize] = nearest;
        }
        in_order
    }

    /// The point nearest to `query` among those nearer than `radius`.
    pub(crate) fn nearest_within(&self, query: &[f64; 3], radius: f64) -> Option<Nearest> {
        let mut best = Nearest { squared: radius * radius, index: u32::MAX };
        self.search(query, &mut best);
        (best.index != u32::MAX).then_some(best)
    }

    /// The `count` points nearest to `query`, nearest first; fewer if there are no more.
    pub(crate) fn nearest_n(&self, query: &[f64; 3], count: usize) -> Vec<Nearest> {
        let mut several = Several { count, found: Vec::with_capacity(count + 1) };
        self.search(query, &mut several);
        several.found
    }

    fn search(&self, query: &[f64; 3], kept: &mut impl Keep) {
        // distance to the box of all points, per axis
        let offsets = std::array::from_fn(|k| (self.min[k] - query[k]).max(query[k] - self.max[k]).max(0.0));
        if !self.points.is_empty() && squared_length(&offsets) < kept.limit() {
            Search { query, offsets, kept }.descend(&self.points, &self.nodes, self.levels);
        }
    }
}

fn bounds(points: &[([f64; 3], u32)]) -> ([f64; 3], [f64; 3]) {
    points.iter().fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(min, max), (p, _)| {
        (std::array::from_fn(|k| min[k].min(p[k])), std::array::from_fn(|k| max[k].max(p[k])))
    })
}

/// Sorts `points` into the order of the leaves and fills the nodes above them.
fn build(points: &mut [([f64; 3], u32)], nodes: &mut [Node], (min, max): ([f64; 3], [f64; 3])) {
    let Some((node, below)) = nodes.split_first_mut() else { return };
    let side = |k: usize| max[k] - min[k];
    let axis = (0..3).fold(0, |widest, k| if side(k) > side(widest) { k } else { widest });
    let middle = points.len() / 2;
    let by_axis =
        |a: &([f64; 3], u32), b: &([f64; 3], u32)| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1));
    points.select_nth_unstable_by(middle, by_axis);
    let (left, right) = points.split_at_mut(middle);
    let (left_bounds, right_bounds) = (bounds(left), bounds(right));
    *node = Node { sides: (left_bounds.1[axis], right_bounds.0[axis]), axis: axis as u8 };
    let (left_nodes, right_nodes) = below.split_at_mut(below.len() / 2);
    if left.len() > PARALLEL {
        rayon::join(|| build(left, left_nodes, left_bounds), || build(right, right_nodes, right_bounds));
    } else {
        build(left, left_nodes, left_bounds);
        build(right, right_nodes, right_bounds);
    }
}

/// What a search keeps of the points it meets.
trait Keep {
    /// Squared distance beyond which no point is wanted.
    fn limit(&self) -> f64;
    /// Keeps a point, if it is wanted.
    fn offer(&mut self, candidate: Nearest);
}

impl Keep for Nearest {
    fn limit(&self) -> f64 {
        self.squared
    }

    fn offer(&mut self, candidate: Nearest) {
        let known = self.index != u32::MAX;
        if candidate.squared < self.squared || (known && candidate < *self) {
            *self = candidate;
        }
    }
}

/// The nearest points so far, nearest first.
struct Several {
    count: usize,
    found: Vec<Nearest>,
}

impl Keep for Several {
    fn limit(&self) -> f64 {
        let last = self.count.checked_sub(1).map(|last| self.found.get(last));
        last.map_or(0.0, |last| last.map_or(f64::INFINITY, |nearest| nearest.squared))
    }

    fn offer(&mut self, candidate: Nearest) {
        if candidate.squared.is_finite() && candidate.squared <= self.limit() {
            let at = self.found.partition_point(|nearer| *nearer < candidate);
            self.found.insert(at, candidate);
            self.found.truncate(self.count);
        }
    }
}

struct Search<'a, K> {
    query: &'a [f64; 3],
    /// Distance along each axis to the box that is being searched.
    offsets: [f64; 3],
    kept: &'a mut K,
}

impl<K: Keep> Search<'_, K> {
    fn descend(&mut self, points: &[([f64; 3], u32)], nodes: &[Node], levels: u32) {
        let (Some((node, below)), true) = (nodes.split_first(), levels > 0) else {
            for (point, index) in points {
                let squared = squared_length(&std::array::from_fn(|k| point[k] - self.query[k]));
                self.kept.offer(Nearest { squared, index: *index });
            }
            return;
        };
        let (left, right) = points.split_at(points.len() / 2);
        let (left_nodes, right_nodes) = below.split_at(below.len() / 2);
        let axis = usize::from(node.axis);
        let q = self.query[axis];
        let (to_left, to_right) = (q - node.sides.0, node.sides.1 - q);
        let left_first = to_left < to_right;
        let halves = [(left, left_nodes, to_left), (right, right_nodes, to_right)];
        for (points, nodes, distance) in if left_first { halves } else { [halves[1], halves[0]] } {
            let outer = self.offsets[axis];
            self.offsets[axis] = outer.max(distance);
            // equally near points are visited too: the one with the smallest index is wanted
            if squared_length(&self.offsets) <= self.kept.limit() {
                self.descend(points, nodes, levels - 1);
            }
            self.offsets[axis] = outer;
        }
    }
}

fn squared_length(v: &[f64; 3]) -> f64 {
    v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn brute(points: &[[f64; 3]], query: &[f64; 3], radius: f64) -> Option<Nearest> {
        let all = points.iter().zip(0..).map(|(p, index)| {
            let squared = squared_length(&std::array::from_fn(|k| p[k] - query[k]));
            Nearest { squared, index }
        });
        all.filter(|n| n.squared < radius * radius).min_by(|a, b| a.partial_cmp(b).unwrap())
    }

    /// Numbers on a coarse lattice, so that coordinates, points and distances coincide often.
    fn lattice(n: usize, steps: u64, flat: bool) -> Vec<[f64; 3]> {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % steps) as f64 / 8.0
        };
        (0..n).map(|_| [next(), next(), if flat { 1.0 } else { next() }]).collect()
    }

    #[test]
    fn the_nearest_point_is_found_and_ties_go_to_the_first() {
        let clouds = [
            (0, lattice(0, 9, false)),
            (1, lattice(1, 9, false)),
            (2, lattice(500, 9, true)),
            (3, vec![[2.0, 2.0, 2.0]; 300]),
            (4, lattice(3000, 40, false)),
            (5, lattice(2000, 1 << 20, false)),
        ];
        for (case, points) in clouds {
            let index = NearestIndex::new(&points);
            for query in lattice(300, 60, false) {
                for radius in [0.125, 0.6, 5.0, 1e9] {
                    let found = index.nearest_within(&query, radius);
                    assert_eq!(
                        found,
                        brute(&points, &query, radius),
                        "cloud {case}, {query:?} within {radius}"
                    );
                }
            }
        }
    }

    #[test]
    fn so_many_nearest_points_come_in_order() {
        for points in [lattice(5, 9, false), vec![[2.0; 3]; 300], lattice(3000, 40, false)] {
            let index = NearestIndex::new(&points);
            for query in lattice(100, 60, false) {
                let squared = |p: &[f64; 3]| squared_length(&std::array::from_fn(|k| p[k] - query[k]));
                let mut all: Vec<Nearest> =
                    points.iter().zip(0..).map(|(p, index)| Nearest { squared: squared(p), index }).collect();
                all.sort_by(|a, b| a.partial_cmp(b).unwrap());
                for count in [0, 1, 16] {
                    assert_eq!(index.nearest_n(&query, count), all[..count.min(all.len())], "{query:?}");
                }
            }
        }
    }

    #[test]
    fn points_that_are_nowhere_are_nobodys_neighbours() {
        let index = NearestIndex::new(&[[0.0; 3], [f64::NAN; 3], [f64::INFINITY; 3], [1.0; 3]]);
        let found: Vec<u32> = index.nearest_n(&[0.9; 3], 4).iter().map(|nearest| nearest.index).collect();
        assert_eq!(found, [3, 0]);
        assert_eq!(index.nearest_n(&[f64::NAN; 3], 4), []);
    }
}
