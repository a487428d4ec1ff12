//! Fusion of synthetic views with known answers.

mod geometry;
mod labels;
mod streaming;

use super::*;
use crate::error::Result;
use crate::progress::Progress;
use crate::scene::synthetic::{Plane, row_of_views};
use crate::scene::{DepthEstimate, Grid, PointCloud, ViewIndex};
use crate::semantics::ClassPolicy;
use std::sync::Arc;

/// Views that all know each other.
struct TestScene {
    maps: Vec<FusionMaps>,
}

impl TestScene {
    /// `count` views of 48 × 36 pixels in a row before a slanted wall 8 units away; view `i` is all of colour
    /// `[10 i, 100, 200]`.
    fn wall(count: u32) -> Self {
        Self::of(row_of_views(count, 48, 36, 0.2, wall()))
    }

    fn of(estimates: Vec<DepthEstimate>) -> Self {
        let maps = estimates.into_iter().enumerate().map(|(i, estimate)| {
            let color = Grid::filled(estimate.depth.size(), [(10 * i) as u8, 100, 200]);
            FusionMaps { color: Some(Arc::new(color)), ..FusionMaps::new(Arc::new(estimate)) }
        });
        TestScene { maps: maps.collect() }
    }

    /// The estimate of view `i`, to be changed.
    fn estimate(&mut self, i: usize) -> &mut DepthEstimate {
        Arc::make_mut(&mut self.maps[i].estimate)
    }

    fn label(&mut self, i: usize, label_at: impl Fn(usize, usize) -> u16) {
        let mut labels = Grid::filled(self.maps[i].size(), 0);
        for y in 0..labels.height() {
            for x in 0..labels.width() {
                labels[(x, y)] = label_at(x, y);
            }
        }
        self.maps[i].labels = Some(Arc::new(labels));
    }

    fn views(&self) -> Vec<FusionView> {
        let n = self.maps.len() as u32;
        let view = |i: u32| FusionView {
            maps: Some(MapInfo::of(&self.maps[i as usize])),
            neighbors: (1..n).map(|k| ViewIndex((i + k) % n)).collect(),
            neighbor_count: n as usize - 1,
        };
        (0..n).map(view).collect()
    }

    fn try_fuse(
        &self,
        options: &FusionOptions,
        policy: Option<&ClassPolicy>,
    ) -> Result<(PointCloud, FusionSummary)> {
        let views = self.views();
        let input = FusionInput { views: &views, source: self, policy };
        let mut points = PointCloud::new(input.layout(options));
        let summary = fuse(&input, options, &Progress::silent(), &mut points)?;
        Ok((points, summary))
    }

    fn fuse(&self, options: &FusionOptions) -> (PointCloud, FusionSummary) {
        self.try_fuse(options, None).unwrap()
    }
}

impl MapSource for TestScene {
    fn load(&self, view: ViewIndex) -> Result<FusionMaps> {
        Ok(self.maps[view.index()].clone())
    }
}

fn wall() -> Plane {
    Plane::slanted(8.0, 0.15, -0.1)
}

fn with_min_views(number_views_fuse: u32) -> FusionOptions {
    FusionOptions { number_views_fuse, ..FusionOptions::default() }
}
