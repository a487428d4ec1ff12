//! What a run did: tables and a page with pictures for people, JSON for programs.

mod build;
mod classes;
mod comparison_page;
mod document;
mod label_check;
mod page;
mod pictures;
mod run;
mod table;
mod viewer_points;

pub use build::{VERSION, build, commit, with_commit};
pub use classes::{ClassRow, class_table, fill_shares};
pub use comparison_page::{
    ComparisonPage, ComparisonRamps, ComparisonScales, PageCheck, PageDifferences, PageFigures, PagePair,
    PairLayers,
};
pub use document::data_address;
pub use label_check::{CheckedView, ClassName, LabelCheck};
pub use page::{
    BARS, PageCamera, PageCloud, PageCloudClass, PageLayers, PageRamps, PageView, ReportPage, add_to,
};
pub use pictures::{
    NOTHING, Ramp, amount_picture, confidence_picture, depth_picture, depth_scale, label_overlay,
    label_picture, marked_picture, normal_picture, presence_picture, signed_picture,
};
pub use run::{OutputReport, RunReport, StageTime, ViewReport};
pub use table::{Align, Table, grouped};
pub use viewer_points::{ViewerPoint, chosen, packed, shuffled};
