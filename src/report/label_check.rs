//! What a check of label maps found.

use super::table::{Align, Table};
use serde::Serialize;
use std::fmt::Write;

/// The label maps of a scene.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct LabelCheck {
    /// Class table.
    pub table: String,
    /// Id and name of every class, void first.
    pub classes: Vec<ClassName>,
    /// What the labels of a view are held against: `depth maps`, `sparse points` or, if there is neither, `nothing`.
    pub compared_by: &'static str,
    /// One row per view that has a camera, in the scene's order.
    pub views: Vec<CheckedView>,
    /// Label maps that are missing or cannot be used.
    pub faults: usize,
}

/// A class.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassName {
    /// Id, 0 = void.
    pub id: u16,
    /// Name.
    pub name: String,
}

/// The label map of one view.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CheckedView {
    /// The image as the scene names it.
    pub image: String,
    /// The label map, if there is a file.
    pub file: Option<String>,
    /// What is wrong with it.
    pub fault: Option<String>,
    /// Share of the pixels by class id, for the classes that occur.
    pub shares: std::collections::BTreeMap<u16, f64>,
    /// Pixels or points that this view and others label.
    pub compared: u64,
    /// Share of them on which the others, by majority, say another class.
    pub disagreement: Option<f64>,
}

/// Views named as those that disagree most.
const MOST_NAMED: usize = 5;
/// Classes with a column of their own in the text; the JSON form has all.
const MOST_COLUMNS: usize = 8;

impl LabelCheck {
    /// The findings as text: a line per view, what is wrong, and who disagrees most.
    pub fn text(&self) -> String {
        let columns = self.columns();
        let mut titles: Vec<(&str, Align)> = vec![("image", Align::Left)];
        titles.extend(columns.iter().map(|class| (class.name.as_str(), Align::Right)));
        titles.push(("against others", Align::Right));
        let mut table = Table::new(&titles);
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        for view in &self.views {
            let mut cells = vec![view.image.clone()];
            let shares = columns.iter().map(|class| view.shares.get(&class.id).copied());
            cells.extend(shares.map(|share| share.map(percent).unwrap_or_default()));
            cells.push(view.disagreement.map(percent).unwrap_or_default());
            table.row(cells);
        }
        let mut out = format!("class table {}, compared by {}\n\n{table}", self.table, self.compared_by);
        for view in &self.views {
            if let Some(fault) = &view.fault {
                let _ = writeln!(out, "\n{}: {fault}", view.image);
            }
        }
        let worst = self.most_at_odds();
        if !worst.is_empty() {
            let _ = writeln!(out, "\nmost at odds with the others: {}", worst.join(", "));
        }
        out
    }

    /// The classes that occur most.
    fn columns(&self) -> Vec<&ClassName> {
        let total = |id: u16| self.views.iter().filter_map(|v| v.shares.get(&id)).sum::<f64>();
        let mut occurring: Vec<&ClassName> = self.classes.iter().filter(|c| total(c.id) > 0.0).collect();
        occurring.sort_by(|a, b| total(b.id).total_cmp(&total(a.id)).then(a.id.cmp(&b.id)));
        occurring.truncate(MOST_COLUMNS);
        occurring.sort_by_key(|c| c.id);
        occurring
    }

    /// The views that disagree most, worst first.
    fn most_at_odds(&self) -> Vec<String> {
        let share = |view: &&CheckedView| view.disagreement.unwrap_or(0.0);
        let mut views: Vec<&CheckedView> = self.views.iter().filter(|v| share(v) > 0.0).collect();
        views.sort_by(|a, b| share(b).total_cmp(&share(a)));
        let name = |v: &&CheckedView| format!("{} ({:.1} %)", v.image, 100.0 * share(v));
        views.iter().take(MOST_NAMED).map(name).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_and_the_worst_views_are_named() {
        let class = |id: u16, name: &str| ClassName { id, name: name.to_owned() };
        let view = |image: &str, share: f64, disagreement: Option<f64>| CheckedView {
            image: image.to_owned(),
            shares: [(1, share), (2, 1.0 - share)].into(),
            disagreement,
            ..CheckedView::default()
        };
        let broken = CheckedView { fault: Some("no label map".to_owned()), ..view("c.jpg", 1.0, None) };
        let check = LabelCheck {
            table: "t".to_owned(),
            classes: vec![class(0, "void"), class(1, "wall"), class(2, "sky")],
            compared_by: "depth maps",
            views: vec![view("a.jpg", 0.25, Some(0.01)), view("b.jpg", 0.5, Some(0.2)), broken],
            faults: 1,
        };
        let text = check.text();
        assert!(text.contains("b.jpg   50.0 %  50.0 %          20.0 %"), "{text}");
        assert!(text.contains("c.jpg: no label map"), "{text}");
        assert!(text.contains("most at odds with the others: b.jpg (20.0 %), a.jpg (1.0 %)"), "{text}");
        assert!(!text.contains("void"), "{text}");
    }
}
