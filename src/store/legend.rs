//! A picture that says what class colours mean.

use super::cloud::ClassPoints;
use super::drawing::{put_text, text_width, write_picture};
use crate::error::Result;
use crate::geometry::Size;
use crate::scene::ColorImage;
use crate::semantics::{ClassId, ClassTable};
use std::collections::BTreeMap;
use std::path::Path;

/// Pixels from line to line.
const LINE: usize = 30;
/// Pixels about everything.
const MARGIN: usize = 12;
/// Width and height of the patches of colour.
const PATCH: (usize, usize) = (40, 20);
/// Characters of a name that are shown.
const MOST_NAME: usize = 32;
/// Classes in one column.
const MOST_LINES: usize = 40;
const WHITE: [u8; 3] = [255; 3];
const GREY: [u8; 3] = [160; 3];

/// Writes to `path` a line for each of `classes`: its colour in `table`, its id, its name, its share of the points.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write_legend(
    path: &Path,
    table: &ClassTable,
    classes: &BTreeMap<ClassId, ClassPoints>,
) -> Result<()> {
    write_picture(path, &draw(table, classes))
}

fn draw(table: &ClassTable, classes: &BTreeMap<ClassId, ClassPoints>) -> ColorImage {
    let lines = lines(table, classes);
    let longest = lines.iter().map(|(_, text)| text.chars().count()).max().unwrap_or(0);
    let column = PATCH.0 + MARGIN + text_width(&"m".repeat(longest));
    let columns = lines.len().div_ceil(MOST_LINES).max(1);
    let rows = lines.len().div_ceil(columns).max(1);
    let width = MARGIN + columns * (column + MARGIN);
    let size = Size::new(width as u32, (2 * MARGIN + rows * LINE) as u32);
    let mut image = ColorImage::filled(size, WHITE);
    for (i, (color, text)) in lines.iter().enumerate() {
        let x = MARGIN + (i / rows) * (column + MARGIN);
        let y = MARGIN + (i % rows) * LINE + (LINE - PATCH.1) / 2;
        patch(&mut image, x, y, *color);
        put_text(&mut image, x + PATCH.0 + MARGIN, y, text);
    }
    image
}

/// Colour and text of each class, all texts equally long.
fn lines(table: &ClassTable, classes: &BTreeMap<ClassId, ClassPoints>) -> Vec<([u8; 3], String)> {
    let all: u64 = classes.values().map(|class| class.points).sum();
    let names: Vec<String> = classes.keys().map(|&id| shortened(&table.class_name(id))).collect();
    let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
    let last = classes.keys().map(|id| id.to_string().len()).max().unwrap_or(0);
    let line = |((&id, class), name): ((&ClassId, &ClassPoints), &String)| {
        let share = 100.0 * class.points as f64 / all.max(1) as f64;
        (table.color(id), format!("{id:>last$} {name:<longest$} {share:5.1} %"))
    };
    classes.iter().zip(&names).map(line).collect()
}

fn shortened(name: &str) -> String {
    match name.chars().count() {
        n if n > MOST_NAME => name.chars().take(MOST_NAME - 2).chain("..".chars()).collect(),
        _ => name.to_owned(),
    }
}

/// A patch of `color` with a frame, so that white shows too.
fn patch(image: &mut ColorImage, x: usize, y: usize, color: [u8; 3]) {
    for dy in 0..PATCH.1 {
        for dx in 0..PATCH.0 {
            let is_frame = dx == 0 || dy == 0 || dx == PATCH.0 - 1 || dy == PATCH.1 - 1;
            image[(x + dx, y + dy)] = if is_frame { GREY } else { color };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn classes(ids: impl IntoIterator<Item = u16>) -> BTreeMap<ClassId, ClassPoints> {
        ids.into_iter().map(|id| (ClassId(id), ClassPoints { points: 1, confidence_sum: 1.0 })).collect()
    }

    #[test]
    fn every_class_with_points_has_its_colour_and_its_line() {
        let table = ClassTable::builtin("3dom-facade").unwrap();
        let image = draw(&table, &classes([0, 1, 4]));
        assert_eq!(image.height(), 2 * MARGIN + 3 * LINE);
        let middle = |line: usize| image[(MARGIN + PATCH.0 / 2, MARGIN + line * LINE + LINE / 2)];
        assert_eq!([middle(0), middle(1), middle(2)], [[0, 0, 0], [0, 0, 255], [0, 255, 0]]);
        let text = lines(&table, &classes([0, 1, 4]));
        assert_eq!(text[1].1, "1 building  33.3 %");
        assert_eq!(text[0].1.len(), text[1].1.len());
        // The name is there: dark pixels right of the patch.
        let right = MARGIN + PATCH.0 + MARGIN;
        let dark = (right..image.width()).any(|x| image[(x, MARGIN + LINE / 2)][0] < 100);
        assert!(dark);
    }

    #[test]
    fn many_classes_stand_in_columns_and_odd_names_fit() {
        let table = ClassTable::builtin("ade20k").unwrap();
        let image = draw(&table, &classes(1..=150));
        assert_eq!(image.height(), 2 * MARGIN + 38 * LINE);
        let text = "class = [{ id = 65535, name = \"façade 建 and a name that goes on and on and on\" }]";
        let table = ClassTable::from_toml(text, Path::new("t.toml")).unwrap();
        let lines = lines(&table, &classes([65535]));
        assert_eq!(lines[0].1, "65535 façade 建 and a name that goes .. 100.0 %");
        draw(&table, &classes([65535]));
        draw(&table, &BTreeMap::new());
    }

    #[test]
    fn the_same_classes_give_the_same_bytes() {
        let scratch = tempfile::tempdir().unwrap();
        let table = ClassTable::builtin("cityscapes").unwrap();
        let [a, b] = ["a.png", "b.png"].map(|name| scratch.path().join(name));
        write_legend(&a, &table, &classes(0..=19)).unwrap();
        write_legend(&b, &table, &classes(0..=19)).unwrap();
        assert_eq!(std::fs::read(a).unwrap(), std::fs::read(b).unwrap());
    }
}
