//! A picture of what the confidence of labels is worth.

use super::drawing::{put_text, text_width, write_picture};
use crate::error::Result;
use crate::geometry::Size;
use crate::scene::ColorImage;
use std::path::Path;

/// Side of the square in which confidences run from left to right and shares from bottom to top.
const SIDE: usize = 480;
/// Left upper corner of the square.
const CORNER: (usize, usize) = (90, 50);
/// Width and height of the picture.
const SIZE: Size = Size::new(620, 610);
const WHITE: [u8; 3] = [255; 3];
const GREY: [u8; 3] = [205; 3];
const DARK: [u8; 3] = [60; 3];
const BLUE: [u8; 3] = [90, 140, 210];

/// The points of one range of confidences.
#[derive(Clone, Copy, Debug)]
pub struct Bar {
    /// Smallest confidence, 0..1.
    pub from: f64,
    /// Largest confidence, at most 1.
    pub to: f64,
    /// Share of right labels, 0..1; `None`: no points.
    pub right: Option<f64>,
}

/// Draws a reliability diagram to `path`: over the confidences of each of `bars` a bar as high as the share of right labels,
/// and the diagonal on which they would meet.
///
/// # Errors
/// The file cannot be written.
pub fn write_reliability_diagram(path: &Path, bars: &[Bar]) -> Result<()> {
    write_picture(path, &draw(bars))
}

fn draw(bars: &[Bar]) -> ColorImage {
    let mut image = ColorImage::filled(SIZE, WHITE);
    let x_of = |v: f64| CORNER.0 + (v * SIDE as f64).round() as usize;
    let y_of = |v: f64| CORNER.1 + SIDE - (v * SIDE as f64).round() as usize;
    for tenth in 0..=10 {
        let v = f64::from(tenth) / 10.0;
        fill(&mut image, (x_of(0.0), y_of(v)), (x_of(1.0), y_of(v) + 1), GREY);
        if tenth % 2 == 0 {
            let text = format!("{v:.1}");
            put_text(&mut image, CORNER.0 - text_width(&text) - 10, y_of(v) - 10, &text);
            put_text(&mut image, x_of(v) - text_width(&text) / 2, y_of(0.0) + 10, &text);
        }
    }
    for bar in bars {
        if let Some(right) = bar.right {
            let (left, end) = (x_of(bar.from) + 1, x_of(bar.to));
            fill(&mut image, (left, y_of(right)), (end, y_of(0.0)), BLUE);
        }
    }
    for i in 0..=SIDE {
        let (x, y) = (CORNER.0 + i, CORNER.1 + SIDE - i);
        fill(&mut image, (x, y), (x + 2, y + 1), DARK);
    }
    fill(&mut image, (x_of(0.0), y_of(0.0)), (x_of(1.0), y_of(0.0) + 2), DARK);
    put_text(&mut image, CORNER.0, 14, "share of right labels");
    put_text(&mut image, CORNER.0 + 150, y_of(0.0) + 38, "label_confidence");
    image
}

/// Fills columns and rows from `from` up to `to`.
fn fill(image: &mut ColorImage, from: (usize, usize), to: (usize, usize), color: [u8; 3]) {
    for y in from.1..to.1 {
        (from.0..to.0).for_each(|x| image[(x, y)] = color);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_are_as_high_as_the_share_of_right_labels() {
        let bar = |from, to, right| Bar { from, to, right };
        let image = draw(&[bar(0.0, 0.5, None), bar(0.5, 1.0, Some(0.25))]);
        let at = |x: f64, y: f64| {
            image[(CORNER.0 + (x * SIDE as f64) as usize, CORNER.1 + ((1.0 - y) * SIDE as f64) as usize)]
        };
        assert_eq!([at(0.8, 0.15), at(0.8, 0.35), at(0.3, 0.15)], [BLUE, WHITE, WHITE]);
        assert_eq!(at(0.35, 0.35), DARK);
    }
}
