//! The order in which views start points.

/// Indices of `scores` by decreasing score, views of score 0 left out, equal scores in the order that OpenMVS's
/// build leaves them in: that of an introsort (Musser 1997) of all views with the thresholds and pivot rule of
/// the GNU C++ library, which keeps equal elements in place among up to 16 and mixes them among more.
pub(super) fn by_decreasing_score(scores: &[usize]) -> Vec<usize> {
    let mut items: Vec<usize> = (0..scores.len()).collect();
    let before = |a: usize, b: usize| scores[a] > scores[b];
    if items.len() > INSERTION_LIMIT {
        partition_long_ranges(&mut items, 2 * (usize::BITS - 1 - scores.len().leading_zeros()), &before);
    }
    let guarded = items.len().min(INSERTION_LIMIT);
    for i in 1..guarded {
        let item = items[i];
        if before(item, items[0]) {
            items.copy_within(0..i, 1);
            items[0] = item;
        } else {
            insert_before_lesser(&mut items, i, &before);
        }
    }
    for i in guarded..items.len() {
        insert_before_lesser(&mut items, i, &before);
    }
    items.retain(|&i| scores[i] > 0);
    items
}

/// Ranges up to this length are left to insertion.
const INSERTION_LIMIT: usize = 16;

fn partition_long_ranges(mut items: &mut [usize], mut depth: u32, before: &impl Fn(usize, usize) -> bool) {
    while items.len() > INSERTION_LIMIT {
        if depth == 0 {
            // Never reached by lists with as many ties as neighbour counts have.
            items.sort_by(|&a, &b| before(b, a).cmp(&before(a, b)));
            return;
        }
        depth -= 1;
        let cut = partition(items, before);
        let (left, right) = items.split_at_mut(cut);
        partition_long_ranges(right, depth, before);
        items = left;
    }
}

/// Moves the median of the second, middle and last item to the front and partitions the rest about it.
fn partition(items: &mut [usize], before: &impl Fn(usize, usize) -> bool) -> usize {
    let (a, b, c) = (1, items.len() / 2, items.len() - 1);
    let [va, vb, vc] = [items[a], items[b], items[c]];
    let median = if before(va, vb) {
        if before(vb, vc) {
            b
        } else if before(va, vc) {
            c
        } else {
            a
        }
    } else if before(va, vc) {
        a
    } else if before(vb, vc) {
        c
    } else {
        b
    };
    items.swap(0, median);
    let pivot = items[0];
    let (mut first, mut last) = (1, items.len());
    loop {
        while before(items[first], pivot) {
            first += 1;
        }
        last -= 1;
        while before(pivot, items[last]) {
            last -= 1;
        }
        if first >= last {
            return first;
        }
        items.swap(first, last);
        first += 1;
    }
}

/// Moves item `i` in front of the items before it that it precedes; one that it does not must exist.
fn insert_before_lesser(items: &mut [usize], i: usize, before: &impl Fn(usize, usize) -> bool) {
    let item = items[i];
    let mut at = i;
    while at > 0 && before(item, items[at - 1]) {
        items[at] = items[at - 1];
        at -= 1;
    }
    items[at] = item;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn up_to_sixteen_equal_scores_keep_their_order() {
        assert_eq!(by_decreasing_score(&[3, 5, 0, 5, 3, 7]), [5, 1, 3, 0, 4]);
        assert_eq!(by_decreasing_score(&[4; 16]), (0..16).collect::<Vec<_>>());
        assert_eq!(by_decreasing_score(&[]), [0; 0]);
    }

    #[test]
    fn ties_among_many_views_fall_as_in_the_gnu_library() {
        // (views, distinct scores, FNV-1a hash of the order), from std::sort of GCC 12 over the same scores.
        let known = [
            (17, 1, 12142191458066772073),
            (17, 3, 4006474272010568720),
            (17, 23, 6963601001238388805),
            (40, 3, 12813289589722902750),
            (100, 1, 1494447923934049643),
            (100, 23, 17106339978156145829),
            (500, 1, 1112577424253981879),
            (500, 3, 1800072113409963990),
            (500, 23, 12534352820270060350),
        ];
        for (views, distinct, expected) in known {
            let scores: Vec<usize> =
                (0..views).map(|i| (i * 7919) % distinct + usize::from(distinct == 1)).collect();
            let order = by_decreasing_score(&scores);
            let hash = order
                .iter()
                .fold(1469598103934665603_u64, |h, &i| (h ^ i as u64).wrapping_mul(1099511628211));
            assert_eq!(hash, expected, "{views} views, {distinct} scores");
        }
    }

    #[test]
    fn irregular_ties_fall_as_in_the_gnu_library() {
        // (views, distinct scores, FNV-1a hash of the order) as above, over scores from a xorshift generator.
        let known = [
            (17, 2, 138625294608479885),
            (17, 4, 1484447143584918439),
            (40, 2, 11476617960903788049),
            (40, 5, 16477457307815274907),
            (200, 1, 10987860983922977155),
            (200, 2, 3667350438184020641),
            (200, 7, 14562236464095186281),
        ];
        for (views, distinct, expected) in known {
            let mut state = 88_172_645_463_325_252_u64 + 1000 * views + distinct;
            let mut next = || {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                1 + (state % distinct) as usize
            };
            let scores: Vec<usize> = (0..views).map(|_| next()).collect();
            let order = by_decreasing_score(&scores);
            let hash = order
                .iter()
                .fold(1469598103934665603_u64, |h, &i| (h ^ i as u64).wrapping_mul(1099511628211));
            assert_eq!(hash, expected, "{views} views, {distinct} scores: {order:?}");
            if (views, distinct) == (17, 2) {
                assert_eq!(scores, [2, 2, 1, 1, 1, 1, 2, 2, 1, 1, 2, 2, 2, 2, 1, 1, 1]);
                assert_eq!(order, [1, 0, 13, 6, 7, 12, 11, 10, 16, 15, 14, 9, 8, 5, 4, 3, 2]);
            }
        }
    }

    #[test]
    fn seventeen_equal_scores_are_mixed_as_by_one_partition() {
        // Of equal items the median rule picks the middle one (index 8) and swaps it to the front; the partition
        // of the other sixteen places then swaps the pairs (1, 16), (2, 15), ... (8, 9).
        let order = by_decreasing_score(&[1; 17]);
        assert_eq!(order, [8, 16, 15, 14, 13, 12, 11, 10, 9, 0, 7, 6, 5, 4, 3, 2, 1]);
    }
}
