//! Per-class figures of a run.

use super::table::{Align, Table, grouped};
use serde::{Deserialize, Serialize};

/// One class of the summary. Counts of pixels are taken in the views that started points.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct ClassRow {
    /// Class id, 0 = void.
    pub id: u16,
    /// Class name.
    pub name: String,
    /// Red, green, blue of the class table.
    pub color: [u8; 3],
    /// Whether points of the class belong in the cloud.
    pub kept: bool,
    /// Pixels with this label, at the size of the depth maps.
    pub pixels: u64,
    /// Those of `pixels` that have a depth.
    pub depths: u64,
    /// Points of the cloud.
    pub points: u64,
    /// `points` over all points of the cloud, 0..1; 0 in an empty cloud. [`fill_shares`] sets it.
    pub share: f64,
    /// Mean label confidence of the points, 0..1; `None` without points.
    pub mean_confidence: Option<f64>,
    /// Pixels of this class whose point was rejected by the check of labels across views.
    pub rejected: u64,
    /// Pixels of this class that started no point because it, or the class voted for, is not kept.
    pub excluded: u64,
}

/// Sets every row's share of all points.
pub fn fill_shares(rows: &mut [ClassRow]) {
    let all: u64 = rows.iter().map(|row| row.points).sum();
    for row in rows {
        row.share = row.points as f64 / all.max(1) as f64;
    }
}

/// The summary as text: one line per class that occurs, and a line of totals.
pub fn class_table(rows: &[ClassRow]) -> String {
    use Align::{Left, Right};
    let mut table = Table::new(&[
        ("class", Left),
        ("id", Right),
        ("pixels", Right),
        ("depths", Right),
        ("points", Right),
        ("share", Right),
        ("confidence", Right),
        ("rejected", Right),
    ]);
    let occurs = |row: &&ClassRow| row.pixels + row.points > 0;
    for row in rows.iter().filter(occurs) {
        table.row([
            row.name.clone(),
            row.id.to_string(),
            grouped(row.pixels),
            grouped(row.depths),
            if row.kept { grouped(row.points) } else { "dropped".to_owned() },
            if row.kept { format!("{:.1} %", 100.0 * row.share) } else { String::new() },
            row.mean_confidence.map(|c| format!("{c:.3}")).unwrap_or_default(),
            grouped(row.rejected),
        ]);
    }
    let total = |value: fn(&ClassRow) -> u64| grouped(rows.iter().map(value).sum());
    table.row([
        "all".to_owned(),
        String::new(),
        total(|row| row.pixels),
        total(|row| row.depths),
        total(|row| row.points),
        String::new(),
        String::new(),
        total(|row| row.rejected),
    ]);
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(id: u16, counts: [u64; 4], mean_confidence: Option<f64>) -> ClassRow {
        let [pixels, depths, points, rejected] = counts;
        let name = format!("c{id}");
        ClassRow {
            id,
            name,
            kept: id != 2,
            pixels,
            depths,
            points,
            rejected,
            mean_confidence,
            ..ClassRow::default()
        }
    }

    fn rows() -> Vec<ClassRow> {
        let mut rows = vec![
            row(0, [2, 1, 1, 0], Some(0.0)),
            row(1, [4000, 1, 2, 4], Some(0.75)),
            row(2, [6, 1, 0, 0], None),
            row(9, [0; 4], None),
        ];
        fill_shares(&mut rows);
        rows
    }

    #[test]
    fn shares_are_of_all_points() {
        let shares: Vec<f64> = rows().iter().map(|row| row.share).collect();
        assert_eq!(shares, [1.0 / 3.0, 2.0 / 3.0, 0.0, 0.0]);
        let mut empty = vec![row(1, [5, 0, 0, 0], None)];
        fill_shares(&mut empty);
        assert_eq!(empty[0].share, 0.0);
    }

    #[test]
    fn the_text_is_aligned_and_leaves_out_absent_classes() {
        let expected = "\
class  id  pixels  depths   points   share  confidence  rejected
c0      0       2       1        1  33.3 %       0.000         0
c1      1   4 000       1        2  66.7 %       0.750         4
c2      2       6       1  dropped                             0
all         4 008       3        3                             4
";
        assert_eq!(class_table(&rows()), expected);
    }
}
