//! What a run did: tables and a page with pictures for people, JSON for programs.

mod build;
mod classes;
mod label_check;
mod page;
mod pictures;
mod run;
mod table;
mod viewer_points;

pub use build::{VERSION, build, commit, with_commit};
pub use classes::{ClassRow, class_table, fill_shares};
pub use label_check::{CheckedView, ClassName, LabelCheck};
pub use page::{
    BARS, PageCamera, PageClass, PageCloud, PageCloudClass, PageLayers, PageRamps, PageView, ReportPage,
    add_to, data_address,
};
pub use pictures::{
    NOTHING, Ramp, confidence_picture, depth_picture, depth_scale, label_overlay, label_picture,
    marked_picture, normal_picture,
};
pub use run::{OutputReport, RunReport, StageTime, ViewReport};
pub use table::{Align, Table, grouped};
pub use viewer_points::{ViewerPoint, chosen, packed, shuffled};
