//! Rasters at another size: area averages, cubic interpolation, nearest values.
//!
//! The arithmetic (weights, order of sums, rounding) is that of OpenCV's `resize`, so that reduced photographs
//! equal those of programs built on it.

use super::resolution::scaled_size;
use super::{ColorImage, GrayImage, Grid};
use crate::geometry::Size;
use rayon::prelude::*;

/// Grey of a colour image, 0 black .. 1 white: 0.114 B + 0.587 G + 0.299 R.
pub fn gray_from_color(image: &ColorImage) -> GrayImage {
    const UNIT: f32 = 1.0 / 255.0;
    let luma = |&[r, g, b]: &[u8; 3]| {
        0.114 * (f32::from(b) * UNIT) + 0.587 * (f32::from(g) * UNIT) + 0.299 * (f32::from(r) * UNIT)
    };
    let mut gray = Grid::filled(image.size(), 0.0);
    gray.data_mut().par_iter_mut().zip(image.data()).with_min_len(1 << 14).for_each(|(v, c)| *v = luma(c));
    gray
}

/// The colour image reduced by `factor` to [`scaled_size`]; each pixel is the mean of the area it covers, rounded
/// to 8 bits. A factor of 1 or more returns a copy.
pub fn area_color(image: &ColorImage, factor: f64) -> ColorImage {
    if factor >= 1.0 { image.clone() } else { area_rgb(image.data().as_flattened(), image.size(), factor) }
}

/// [`area_color`] of interleaved bytes, red first; `factor` < 1.
pub(crate) fn area_rgb(bytes: &[u8], size: Size, factor: f64) -> ColorImage {
    let mut out = Grid::filled(scaled_size(size, factor), [0; 3]);
    let to = out.size();
    area::<u8, 3>(bytes, size, out.data_mut().as_flattened_mut(), to, factor);
    out
}

/// The grey image resized by `factor` on both axes to [`scaled_size`]: area means if it shrinks, cubic
/// interpolation (a = −0.75) if it grows, which may leave \[0, 1\]. A factor of exactly 1 returns a copy.
pub fn resize_gray(image: &GrayImage, factor: f64) -> GrayImage {
    let mut out = Grid::filled(scaled_size(image.size(), factor), 0.0);
    let to = out.size();
    if factor == 1.0 {
        return image.clone();
    } else if factor < 1.0 {
        area::<f32, 1>(image.data(), image.size(), out.data_mut(), to, factor);
    } else if image.size().area() > 0 {
        cubic(image, out.data_mut(), to, factor);
    }
    out
}

/// The raster at size `to` with the nearest values: column `min(floor(x · w / to.width), w − 1)`, rows alike.
/// An empty raster gives default values.
pub fn resize_nearest<T: Copy + Default + Send + Sync>(image: &Grid<T>, to: Size) -> Grid<T> {
    let from = image.size();
    let mut out = Grid::filled(to, T::default());
    if from == to {
        return image.clone();
    }
    if from.area() == 0 || to.area() == 0 {
        return out;
    }
    let source = |i: usize, from: u32, to: u32| {
        let ratio = f64::from(from) / f64::from(to);
        ((i as f64 * ratio) as usize).min(from as usize - 1)
    };
    let columns: Vec<usize> = (0..to.width as usize).map(|x| source(x, from.width, to.width)).collect();
    out.data_mut().par_chunks_mut(to.width as usize).enumerate().for_each(|(y, row)| {
        let source_row = image.row(source(y, from.height, to.height));
        for (value, &x) in row.iter_mut().zip(&columns) {
            *value = source_row[x];
        }
    });
    out
}

/// A channel value that can be averaged.
trait Channel: Copy + Default + Send + Sync {
    /// As a real number.
    fn to_f32(self) -> f32;
    /// Rounded half to even and clamped where the type is an integer.
    fn from_f32(value: f32) -> Self;
    /// Mean of a block of 2×2.
    fn mean_of_four(a: Self, b: Self, c: Self, d: Self) -> Self;
    /// Sum of each channel over the rows of a block, exact for integers; for real numbers in groups of four.
    fn block_sum<'a, const CN: usize>(rows: impl Iterator<Item = &'a [Self]>) -> [f32; CN]
    where
        Self: 'a;
}

impl Channel for u8 {
    #[inline]
    fn to_f32(self) -> f32 {
        f32::from(self)
    }
    #[inline]
    fn from_f32(value: f32) -> u8 {
        /// Adding and subtracting 1.5 · 2²³ rounds half to even in f32.
        const ROUND: f32 = 12_582_912.0;
        ((value + ROUND) - ROUND) as u8
    }
    #[inline]
    fn mean_of_four(a: u8, b: u8, c: u8, d: u8) -> u8 {
        ((u16::from(a) + u16::from(b) + u16::from(c) + u16::from(d) + 2) >> 2) as u8
    }
    #[inline]
    fn block_sum<'a, const CN: usize>(rows: impl Iterator<Item = &'a [u8]>) -> [f32; CN] {
        let mut sums = [0u64; CN];
        for row in rows {
            // The sum of a row of 65,535 pixels fits 32 bits.
            let mut row_sums = [0u32; CN];
            for pixel in row.chunks_exact(CN) {
                for c in 0..CN {
                    row_sums[c] += u32::from(pixel[c]);
                }
            }
            for c in 0..CN {
                sums[c] += u64::from(row_sums[c]);
            }
        }
        sums.map(|sum| sum as f32)
    }
}

impl Channel for f32 {
    #[inline]
    fn to_f32(self) -> f32 {
        self
    }
    #[inline]
    fn from_f32(value: f32) -> f32 {
        value
    }
    #[inline]
    fn mean_of_four(a: f32, b: f32, c: f32, d: f32) -> f32 {
        ((a + b) + (c + d)) * 0.25
    }
    #[inline]
    fn block_sum<'a, const CN: usize>(rows: impl Iterator<Item = &'a [f32]>) -> [f32; CN] {
        // Groups of four run on from row to row.
        let (mut sums, mut group, mut filled) = ([0.0; CN], [[0.0; CN]; 4], 0);
        for row in rows {
            for pixel in row.chunks_exact(CN) {
                group[filled].copy_from_slice(pixel);
                filled += 1;
                if filled == 4 {
                    for c in 0..CN {
                        sums[c] += group[0][c] + group[1][c] + group[2][c] + group[3][c];
                    }
                    filled = 0;
                }
            }
        }
        for pixel in &group[..filled] {
            for c in 0..CN {
                sums[c] += pixel[c];
            }
        }
        sums
    }
}

/// Area averages of interleaved channels: whole blocks where `1 / factor` is a whole number, else weighted cells.
fn area<T: Channel, const CN: usize>(src: &[T], from: Size, dst: &mut [T], to: Size, factor: f64) {
    if from.area() == 0 {
        return;
    }
    let scale = 1.0 / factor;
    let whole = scale.round_ties_even();
    if (scale - whole).abs() < f64::EPSILON && whole < f64::from(from.longest()) {
        area_of_blocks::<T, CN>(src, from, dst, to, whole as usize);
    } else {
        area_of_cells::<T, CN>(src, from, dst, to, scale);
    }
}

/// Means of blocks of `side`×`side` pixels; blocks that the right or bottom edge cuts average what is left.
fn area_of_blocks<T: Channel, const CN: usize>(src: &[T], from: Size, dst: &mut [T], to: Size, side: usize) {
    let (width, height) = (from.width as usize, from.height as usize);
    let whole_columns = (width / side).min(to.width as usize);
    let share = 1.0 / (side * side) as f32;
    dst.par_chunks_mut(to.width as usize * CN).enumerate().for_each(|(y, out)| {
        let top = y * side;
        let rows = side.min(height - top);
        let block = |x: usize, columns: usize| {
            T::block_sum::<CN>((0..rows).map(|r| &src[((top + r) * width + x * side) * CN..][..columns * CN]))
        };
        let mut x = 0;
        if rows == side {
            if side == 2 {
                halve::<T, CN>(
                    &src[top * width * CN..][..2 * width * CN],
                    width,
                    &mut out[..whole_columns * CN],
                );
            } else {
                for (x, pixel) in out[..whole_columns * CN].chunks_exact_mut(CN).enumerate() {
                    let sums = block(x, side);
                    for c in 0..CN {
                        pixel[c] = T::from_f32(sums[c] * share);
                    }
                }
            }
            x = whole_columns;
        }
        for x in x..to.width as usize {
            let columns = side.min(width - x * side);
            let sums = block(x, columns);
            for c in 0..CN {
                out[x * CN + c] = T::from_f32(sums[c] / (rows * columns) as f32);
            }
        }
    });
}

/// One row of 2×2 means from two source rows.
fn halve<T: Channel, const CN: usize>(rows: &[T], width: usize, out: &mut [T]) {
    let (upper, lower) = rows.split_at(width * CN);
    let pairs = upper.chunks_exact(2 * CN).zip(lower.chunks_exact(2 * CN));
    for (pixel, (a, b)) in out.chunks_exact_mut(CN).zip(pairs) {
        for c in 0..CN {
            pixel[c] = T::mean_of_four(a[c], a[CN + c], b[c], b[CN + c]);
        }
    }
}

/// The source pixels that a cell covers on one axis, with the share of each.
struct Cell {
    start: usize,
    weights: std::ops::Range<usize>,
}

/// The cells of one axis: `to` cells of `scale` source pixels each.
fn cells(from: u32, to: u32, scale: f64) -> (Vec<Cell>, Vec<f32>) {
    /// Smaller parts of a pixel are left out.
    const SLIVER: f64 = 1e-3;
    let from = f64::from(from);
    let mut weights = Vec::new();
    let cells = (0..to).map(|i| {
        let begin = f64::from(i) * scale;
        let end = begin + scale;
        let extent = scale.min(from - begin);
        let last = end.floor().min(from - 1.0);
        let first = begin.ceil().min(last);
        let before = weights.len();
        let mut start = first;
        if first - begin > SLIVER {
            start -= 1.0;
            weights.push(((first - begin) / extent) as f32);
        }
        weights.extend(std::iter::repeat_n((1.0 / extent) as f32, (last - first) as usize));
        if end - last > SLIVER {
            weights.push(((end - last).min(1.0).min(extent) / extent) as f32);
        }
        Cell { start: start as usize, weights: before..weights.len() }
    });
    (cells.collect(), weights)
}

/// Means over cells of any size: rows are averaged first, then the averaged rows are.
fn area_of_cells<T: Channel, const CN: usize>(src: &[T], from: Size, dst: &mut [T], to: Size, scale: f64) {
    let (columns, column_weights) = cells(from.width, to.width, scale);
    let (rows, row_weights) = cells(from.height, to.height, scale);
    let (from_stride, to_stride) = (from.width as usize * CN, to.width as usize * CN);
    let outputs = dst.par_chunks_mut(to_stride).zip(&rows);
    outputs.for_each_init(
        || vec![0.0f32; to_stride],
        |sums, (out, cell)| {
            sums.fill(0.0);
            for (r, &row_weight) in row_weights[cell.weights.clone()].iter().enumerate() {
                let row = &src[(cell.start + r) * from_stride..][..from_stride];
                for (sum, column) in sums.chunks_exact_mut(CN).zip(&columns) {
                    let mut mean = [0.0f32; CN];
                    let weights = &column_weights[column.weights.clone()];
                    for (pixel, &weight) in row[column.start * CN..].chunks_exact(CN).zip(weights) {
                        for c in 0..CN {
                            mean[c] += pixel[c].to_f32() * weight;
                        }
                    }
                    for c in 0..CN {
                        sum[c] += row_weight * mean[c];
                    }
                }
            }
            for (value, &sum) in out.iter_mut().zip(sums.iter()) {
                *value = T::from_f32(sum);
            }
        },
    );
}

/// Four neighbouring source positions (clamped to the raster) and their weights.
type CubicTap = ([usize; 4], [f32; 4]);

/// The taps of one axis for cubic convolution with a = −0.75 (Keys 1981, eq. 4 generalised).
fn cubic_taps(from: u32, to: u32, factor: f64) -> Vec<CubicTap> {
    const A: f32 = -0.75;
    let scale = 1.0 / factor;
    let last = i64::from(from) - 1;
    (0..to)
        .map(|i| {
            let x = ((f64::from(i) + 0.5) * scale - 0.5) as f32;
            let floor = x.floor();
            let t = x - floor;
            let near = |t: f32| ((A + 2.0) * t - (A + 3.0)) * t * t + 1.0;
            let far = ((A * (t + 1.0) - 5.0 * A) * (t + 1.0) + 8.0 * A) * (t + 1.0) - 4.0 * A;
            let weights = [far, near(t), near(1.0 - t), 1.0 - far - near(t) - near(1.0 - t)];
            let at = std::array::from_fn(|k| (floor as i64 - 1 + k as i64).clamp(0, last) as usize);
            (at, weights)
        })
        .collect()
}

/// Cubic interpolation: rows first, then columns; edge pixels are repeated outwards.
fn cubic(image: &GrayImage, dst: &mut [f32], to: Size, factor: f64) {
    let width = to.width as usize;
    let columns = cubic_taps(image.size().width, to.width, factor);
    let rows = cubic_taps(image.size().height, to.height, factor);
    let mut wide = vec![0.0f32; width * image.height()];
    wide.par_chunks_mut(width).enumerate().for_each(|(y, out)| {
        let row = image.row(y);
        for (value, (at, w)) in out.iter_mut().zip(&columns) {
            *value = row[at[0]] * w[0] + row[at[1]] * w[1] + row[at[2]] * w[2] + row[at[3]] * w[3];
        }
    });
    dst.par_chunks_mut(width).zip(&rows).for_each(|(out, (at, w))| {
        let [a, b, c, d] = at.map(|y| &wide[y * width..][..width]);
        for (x, value) in out.iter_mut().enumerate() {
            *value = a[x] * w[0] + (b[x] * w[1] + (c[x] * w[2] + d[x] * w[3]));
        }
    });
}

#[cfg(test)]
mod tests;
