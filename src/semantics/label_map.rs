//! Label maps at other sizes, and what of them is certain.

use crate::geometry::Size;
use crate::scene::{Grid, LabelMap};

/// The labels at another size: each pixel takes the label of the source pixel whose centre is nearest to its own,
/// between two the one to the left or above. A label is never interpolated.
///
/// An empty map is void at any size.
pub fn nearest_labels(labels: &LabelMap, size: Size) -> LabelMap {
    if labels.size() == size {
        return labels.clone();
    }
    let mut out = Grid::filled(size, 0);
    if labels.size().area() == 0 || size.area() == 0 {
        return out;
    }
    let columns = nearest_indices(labels.width(), size.width as usize);
    let rows = nearest_indices(labels.height(), size.height as usize);
    for (target, &y) in out.data_mut().chunks_exact_mut(columns.len()).zip(&rows) {
        let source = labels.row(y);
        for (label, &x) in target.iter_mut().zip(&columns) {
            *label = source[x];
        }
    }
    out
}

/// Source index of each of `to` targets: the centre of target `i` lies at `(i + 1/2) from / to - 1/2`.
fn nearest_indices(from: usize, to: usize) -> Vec<usize> {
    (0..to).map(|i| ((2 * i + 1) * from).div_ceil(2 * to) - 1).collect()
}

/// The labels with every pixel within `width` pixels of a pixel of another id set to void.
///
/// Distance is the larger of the column and the row distance; 1 means the two pixels that touch a border, 0 changes
/// nothing. Segmentations are least certain there: such pixels count as void in the semantic check but still vote.
pub fn void_borders(labels: &LabelMap, width: u32) -> LabelMap {
    if width == 0 || labels.size().area() == 0 {
        return labels.clone();
    }
    let lowest = over_window(labels, width as usize, u16::min);
    let highest = over_window(labels, width as usize, u16::max);
    let mut out = labels.clone();
    for (label, (low, high)) in out.data_mut().iter_mut().zip(lowest.into_iter().zip(highest)) {
        if low != high {
            *label = 0;
        }
    }
    out
}

/// The extreme, in the sense of `pick`, of the ids within `radius` columns and rows of every pixel.
fn over_window(labels: &LabelMap, radius: usize, pick: impl Fn(u16, u16) -> u16) -> Vec<u16> {
    let width = labels.width();
    let mut out = labels.data().to_vec();
    for (row, source) in out.chunks_exact_mut(width).zip(labels.data().chunks_exact(width)) {
        over_line(row, source, radius, 1, &pick);
    }
    let rows = out.clone();
    over_line(&mut out, &rows, radius, width, &pick);
    out
}

/// Folds into every value of `out` the values of `source` up to `radius` strides before and after it.
fn over_line(out: &mut [u16], source: &[u16], radius: usize, stride: usize, pick: impl Fn(u16, u16) -> u16) {
    let strides = (1..=radius).map(|s| s * stride).take_while(|&shift| shift < source.len());
    for shift in strides {
        out[shift..].iter_mut().zip(source).for_each(|(o, &v)| *o = pick(*o, v));
        out.iter_mut().zip(&source[shift..]).for_each(|(o, &v)| *o = pick(*o, v));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(rows: &[&[u16]]) -> LabelMap {
        let size = Size::new(rows[0].len() as u32, rows.len() as u32);
        Grid::from_vec(size, rows.concat()).unwrap()
    }

    #[test]
    fn the_nearest_centre_is_taken_up_and_down() {
        let labels = map(&[&[1, 2, 3, 4, 5, 6, 7, 8]]);
        let at = |width| nearest_labels(&labels, Size::new(width, 1)).into_vec();
        assert_eq!(at(4), [1, 3, 5, 7]);
        assert_eq!(at(2), [2, 6]);
        assert_eq!(at(1), [4]);
        assert_eq!(at(3), [2, 4, 7]);
        assert_eq!(at(16), [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 8]);
        let rows = map(&[&[1], &[2], &[3]]);
        assert_eq!(nearest_labels(&rows, Size::new(1, 1)).data(), [2]);
        assert_eq!(nearest_labels(&rows, Size::new(1, 3)), rows);
        assert_eq!(nearest_labels(&Grid::default(), Size::new(2, 1)).data(), [0, 0]);
    }

    #[test]
    fn resampling_invents_no_label() {
        let labels = map(&[&[0, 300, 7], &[9, 0, 300]]);
        for size in [Size::new(11, 13), Size::new(2, 1), Size::new(1, 40)] {
            let out = nearest_labels(&labels, size);
            assert!(out.data().iter().all(|l| [0, 300, 7, 9].contains(l)));
        }
    }

    #[test]
    fn the_band_is_as_wide_as_asked_on_both_sides() {
        let labels = map(&[&[1, 1, 1, 1, 2, 2, 2, 2]]);
        assert_eq!(void_borders(&labels, 0), labels);
        assert_eq!(void_borders(&labels, 1).data(), [1, 1, 1, 0, 0, 2, 2, 2]);
        assert_eq!(void_borders(&labels, 3).data(), [1, 0, 0, 0, 0, 0, 0, 2]);
    }

    #[test]
    fn the_band_agrees_with_its_definition_on_a_ragged_map() {
        let mut state = 7u32;
        let mut data = Vec::new();
        for _ in 0..29 * 23 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            data.push(if state >> 24 < 12 { 2 } else { 1 });
        }
        let labels: LabelMap = Grid::from_vec(Size::new(29, 23), data).unwrap();
        for width in 1..5i64 {
            let out = void_borders(&labels, width as u32);
            for y in 0..23i64 {
                for x in 0..29i64 {
                    let here = labels[(x as usize, y as usize)];
                    let near = (-width..=width).any(|dy| {
                        (-width..=width).any(|dx| {
                            let (nx, ny) = (x + dx, y + dy);
                            (0..29).contains(&nx)
                                && (0..23).contains(&ny)
                                && labels[(nx as usize, ny as usize)] != here
                        })
                    });
                    assert_eq!(out[(x as usize, y as usize)] == 0, near, "{x} {y} at {width}");
                }
            }
        }
    }

    #[test]
    fn a_map_of_one_class_has_no_border() {
        let labels = Grid::filled(Size::new(5, 4), 3);
        assert_eq!(void_borders(&labels, 10), labels);
    }
}
