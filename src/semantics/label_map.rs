//! What of a label map is certain.

use crate::scene::LabelMap;

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
    use crate::geometry::Size;
    use crate::scene::Grid;

    fn map(rows: &[&[u16]]) -> LabelMap {
        let size = Size::new(rows[0].len() as u32, rows.len() as u32);
        Grid::from_vec(size, rows.concat()).unwrap()
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
