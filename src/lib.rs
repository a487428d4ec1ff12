//! Oriented photographs to dense, semantically labelled 3D point clouds.
//!
//! What the program `semvs` does to whole folders, and the parts of it that are of use in programs of your own. The
//! files alone, without geometry, are the business of the crate `semvs-formats`.
//!
//! # Everything at once
//!
//! [`Densify`] is `semvs densify`: depth maps of all photographs, filters, fusion, the cloud.
//!
//! ```no_run
//! # fn main() -> semvs::Result<()> {
//! let summary = semvs::Densify::new("scene.mvs")
//!     .output("out/cloud.ply")
//!     .depth_maps("out")
//!     .label_folder("labels")
//!     .class_table("3dom-facade")
//!     .exclude_classes(["sky", "obstacle"])
//!     .run()?;
//! println!("{} points", summary.points());
//! # Ok(())
//! # }
//! ```
//!
//! # Read a scene
//!
//! ```
//! # fn main() -> semvs::Result<()> {
//! let scene = semvs::Scene::read("compat-fixtures/facade6/scene.mvs")?;
//! assert_eq!(scene.views().len(), 6);
//! let view = scene.views().next().unwrap();
//! assert!(view.photograph().is_file());
//!
//! // Where the first sparse point is in that photograph, and how far away.
//! let camera = view.camera().unwrap();
//! let point = scene.sparse_points().next().unwrap();
//! let pixel = camera.project(point).unwrap();
//! let back = camera.unproject([pixel.x, pixel.y], pixel.depth);
//! assert!((0..3).all(|i| (back[i] - point[i]).abs() < 1e-9));
//! # Ok(())
//! # }
//! ```
//!
//! # Read a depth map and project it
//!
//! ```
//! # fn main() -> semvs::Result<()> {
//! # let folder = unpacked();
//! let map = semvs::DepthMap::read(folder.path().join("depth0000.dmap"))?;
//! assert_eq!((map.width(), map.height()), (200, 150));
//! assert!(map.depth(100, 75).is_some_and(|depth| depth > 0.0));
//!
//! let cloud = map.to_cloud();
//! let depths = map.depths().iter().filter(|&&depth| depth > 0.0).count();
//! assert_eq!(cloud.len(), depths);
//! cloud.write(folder.path().join("depth0000.ply"))?;
//! # Ok(())
//! # }
//! # fn unpacked() -> tempfile::TempDir {
//! #     let folder = tempfile::tempdir().unwrap();
//! #     let packed = std::fs::read("compat-fixtures/facade6/openmvs-2.3.0/post7/depth0000.dmap.zst").unwrap();
//! #     std::fs::write(folder.path().join("depth0000.dmap"), zstd::decode_all(&packed[..]).unwrap()).unwrap();
//! #     folder
//! # }
//! ```
//!
//! # Fuse two views and label the cloud
//!
//! Depth maps that agree become one cloud; with label maps every point carries the class that its views voted for, and
//! pixels of different classes do not become one point.
//!
//! ```
//! use semvs::{ClassTable, DepthMap, FuseOptions, FuseView, LabelMap, fuse};
//!
//! # fn main() -> semvs::Result<()> {
//! # let folder = unpacked();
//! let classes = ClassTable::named("3dom-facade")?;
//! let mut views = Vec::new();
//! for (map, image) in [("depth0000.dmap", "0003"), ("depth0001.dmap", "0004")] {
//!     let map = DepthMap::read(folder.path().join(map))?;
//!     let labels = LabelMap::read(format!("compat-fixtures/facade6/labels/{image}_l.png"), &classes)?;
//!     let photograph = format!("compat-fixtures/facade6/images/{image}.jpg");
//!     views.push(FuseView::new(map).with_photograph(photograph)?.with_labels(labels));
//! }
//! let options = FuseOptions::new().min_views(2).classes(&classes).exclude_classes(["sky", "obstacle"]);
//! let cloud = fuse(&views, &options)?;
//!
//! let window = classes.id("window")?;
//! let windows = cloud.points().filter(|point| point.label() == Some(window)).count();
//! assert!(windows > 100 && windows < cloud.len());
//! cloud.write(folder.path().join("labelled.laz"))?;
//! # Ok(())
//! # }
//! # fn unpacked() -> tempfile::TempDir {
//! #     let folder = tempfile::tempdir().unwrap();
//! #     for i in 0..2 {
//! #         let name = format!("depth000{i}.dmap");
//! #         let packed = format!("compat-fixtures/facade6/openmvs-2.3.0/post7/{name}.zst");
//! #         let bytes = zstd::decode_all(&std::fs::read(packed).unwrap()[..]).unwrap();
//! #         std::fs::write(folder.path().join(name), bytes).unwrap();
//! #     }
//! #     folder
//! # }
//! ```
//!
//! # What is promised
//!
//! What this page shows follows [Semantic Versioning](https://semver.org): while the version is 0.x, a change that breaks
//! programs raises the middle number, and the changelog says so. Enumerations may get more values and options more
//! setters at any time. No type of another crate is part of an interface here, but for
//! [`semvs_formats::Error`] inside [`Error`]. The same input and options give the same bytes for any number of threads
//! within one version. What is not on this page is not promised.
//!
//! The layout of the source and the flow of data are described in `docs/ARCHITECTURE.md`.
#![deny(unsafe_code)]

mod cli;
mod cloud_filter;
mod depth_filter;
mod error;
mod evaluate;
mod fusion;
mod geometry;
mod library;
mod pipeline;
mod progress;
mod report;
mod scene;
mod semantics;
mod stereo;
mod store;
mod sub_scenes;

pub use error::{Error, Result};
pub use library::{Camera, Pixel};
pub use library::{ClassTable, LabelMap};
pub use library::{Cloud, Point};
pub use library::{Densify, Step, Summary};
pub use library::{DepthMap, DepthMapBuilder};
pub use library::{FuseOptions, FuseView, fuse};
pub use library::{Scene, View};
pub use semantics::Consistency;
pub use stereo::Quality;

/// What the programs, tests and benchmarks of this package use besides. Nothing here is promised: any release may change or
/// remove it.
#[doc(hidden)]
pub mod internals {
    macro_rules! doors {
        ($($module:ident)*) => {
            $(
                /// A module of the package, without any promise.
                pub mod $module {
                    pub use crate::$module::*;
                }
            )*
        };
    }

    doors! {
        cli cloud_filter depth_filter evaluate fusion geometry pipeline progress report scene semantics stereo
        store sub_scenes
    }
}
