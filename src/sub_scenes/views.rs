//! Which views go with which part.

use super::boxes::Part;
use std::collections::BTreeMap;

/// A view is left out of a chunk when its share of samples there is below this part of the largest share of any view.
const MIN_SHARE: f64 = 0.3;
/// A view with more than this part of its samples in a larger chunk is left out of smaller ones.
const COVERED: f64 = 0.9;
/// A chunk with so few views joins another.
const FEW_VIEWS: usize = 4;

/// A part of the scene and how many samples of each view are in it.
#[derive(Clone, Debug)]
pub(super) struct Content {
    pub(super) part: Part,
    pub(super) counts: BTreeMap<u32, u64>,
    pub(super) area: f64,
}

impl Default for Content {
    fn default() -> Self {
        Content { part: Part::WHOLE, counts: BTreeMap::new(), area: 0.0 }
    }
}

impl Content {
    fn samples(&self) -> u64 {
        self.counts.values().sum()
    }

    fn shared_views(&self, other: &Content) -> usize {
        self.counts.keys().filter(|view| other.counts.contains_key(view)).count()
    }
}

/// Leaves each chunk the views that matter there, and joins those with too few. `totals` are the samples of every view.
pub(super) fn assign_views(mut chunks: Vec<Content>, totals: &[u64]) -> Vec<Content> {
    let share = |view: u32, count: u64| count as f64 / totals[view as usize].max(1) as f64;
    for chunk in &mut chunks {
        let best = chunk.counts.iter().map(|(&v, &n)| share(v, n)).fold(0.0, f64::max);
        chunk.counts.retain(|&view, count| share(view, *count) >= MIN_SHARE * best);
    }
    let sizes: Vec<u64> = chunks.iter().map(Content::samples).collect();
    let before = chunks.clone();
    for (i, chunk) in chunks.iter_mut().enumerate() {
        chunk.counts.retain(|&view, _| {
            !before.iter().enumerate().any(|(k, other)| {
                let larger = (sizes[k], k) > (sizes[i], i);
                larger && other.counts.get(&view).is_some_and(|&n| share(view, n) > COVERED)
            })
        });
    }
    join_small(chunks)
}

/// Joins every chunk with few views to the one it shares most views with, the smallest first.
fn join_small(mut chunks: Vec<Content>) -> Vec<Content> {
    while chunks.len() > 1 {
        let small = (0..chunks.len()).filter(|&i| chunks[i].counts.len() <= FEW_VIEWS);
        let Some(small) = small.min_by_key(|&i| (chunks[i].samples(), i)) else { break };
        let chunk = chunks.remove(small);
        let Some(host) = chunks.iter_mut().reduce(|best, other| {
            let key = |c: &Content| (c.shared_views(&chunk), c.samples());
            if key(other) > key(best) { other } else { best }
        }) else {
            break;
        };
        host.part = host.part.union(&chunk.part);
        host.area += chunk.area;
        for (view, count) in chunk.counts {
            *host.counts.entry(view).or_default() += count;
        }
    }
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn content(low: f64, counts: &[(u32, u64)]) -> Content {
        let part = Part { low: [low, 0.0, 0.0], high: [low + 0.25, 1.0, 1.0] };
        Content { part, counts: counts.iter().copied().collect(), area: 1.0 }
    }

    fn views(content: &Content) -> Vec<u32> {
        content.counts.keys().copied().collect()
    }

    #[test]
    fn views_that_matter_little_are_left_out() {
        let totals = [100; 10];
        let a: Vec<(u32, u64)> = (0..6).map(|v| (v, 50)).chain([(6, 14), (7, 15)]).collect();
        let b: Vec<(u32, u64)> = (2..10).map(|v| (v, 40)).collect();
        let chunks = assign_views(vec![content(0.0, &a), content(0.25, &b)], &totals);
        assert_eq!(views(&chunks[0]), [0, 1, 2, 3, 4, 5, 7]);
        assert_eq!(views(&chunks[1]), [2, 3, 4, 5, 6, 7, 8, 9]);
    }

    #[test]
    fn views_that_a_larger_chunk_covers_stay_there() {
        let totals = [100; 12];
        let large: Vec<(u32, u64)> = (0..6).map(|v| (v, 95)).chain((6..8).map(|v| (v, 60))).collect();
        let small: Vec<(u32, u64)> =
            [(0, 5), (6, 10), (7, 10), (8, 12), (9, 12), (10, 12), (11, 12)].to_vec();
        let chunks = assign_views(vec![content(0.0, &small), content(0.25, &large)], &totals);
        assert_eq!(views(&chunks[0]), [6, 7, 8, 9, 10, 11]);
        assert_eq!(views(&chunks[1]), [0, 1, 2, 3, 4, 5, 6, 7]);
    }

    #[test]
    fn chunks_with_few_views_join_the_one_they_share_most_with() {
        let totals = [100; 20];
        let list = |range: std::ops::Range<u32>| range.map(|v| (v, 50)).collect::<Vec<_>>();
        let chunks = vec![
            content(0.0, &list(0..6)),
            content(0.25, &list(8..12)),
            content(0.5, &list(9..15)),
            content(0.75, &list(14..20)),
        ];
        let chunks = assign_views(chunks, &totals);
        assert_eq!(chunks.len(), 3);
        assert_eq!(views(&chunks[1]), [8, 9, 10, 11, 12, 13, 14]);
        assert_eq!((chunks[1].part.low[0], chunks[1].part.high[0], chunks[1].area), (0.25, 0.75, 2.0));
        let alone = assign_views(vec![content(0.0, &list(0..2)), content(0.25, &list(5..7))], &totals);
        assert_eq!(alone.len(), 1);
        assert_eq!(views(&alone[0]), [0, 1, 5, 6]);
    }
}
