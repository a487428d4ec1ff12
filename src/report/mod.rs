//! What a run did: tables for people, JSON for programs.

mod classes;
mod label_check;
mod run;
mod table;

pub use classes::{ClassRow, class_table, fill_shares};
pub use label_check::{CheckedView, ClassName, LabelCheck};
pub use run::{OutputReport, RunReport, StageTime, ViewReport};
pub use table::{Align, Table, grouped};
