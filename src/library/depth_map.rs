//! The depths of one view.

use super::{Camera, Cloud};
use crate::error::{Error, Result};
use crate::fusion::{FusionMaps, project_maps};
use crate::scene::{CloudLayout, DepthEstimate, Grid, ImageId, PointCloud, ViewIndex};
use crate::store::depth_store::{read_depth_map, write_depth_map};
use semvs_formats::Limits;
use std::path::Path;
use std::sync::Arc;

/// The depth of every pixel of a photograph, as far as it is known, with the camera that sees it. See the
/// [crate's page](crate#read-a-depth-map-and-project-it).
#[derive(Clone, Debug, PartialEq)]
pub struct DepthMap(pub(super) Arc<DepthEstimate>);

/// A [`DepthMap`] in the making, from depths of any source.
#[derive(Clone, Debug)]
pub struct DepthMapBuilder {
    camera: Camera,
    depths: Vec<f32>,
    normals: Option<Vec<[f32; 3]>>,
    confidences: Option<Vec<f32>>,
    id: u32,
    image_name: String,
}

impl DepthMap {
    /// Reads a `.dmap` file, of semvs or OpenMVS.
    ///
    /// # Errors
    /// [`Error`]: not there, not a depth map, damaged.
    pub fn read(path: impl AsRef<Path>) -> Result<Self> {
        Ok(DepthMap(Arc::new(read_depth_map(path.as_ref(), Limits::default())?)))
    }

    /// A depth map from `depths` in rows from the top, as many as the camera has pixels; 0 where none is known.
    ///
    /// ```
    /// let k = [[2.0, 0.0, 0.5], [0.0, 2.0, 0.0], [0.0, 0.0, 1.0]];
    /// let ahead = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let camera = semvs::Camera::new((2, 1), k, ahead, [0.0; 3])?;
    /// let map = semvs::DepthMap::builder(camera, vec![4.0, 0.0]).id(7).build()?;
    /// let points: Vec<[f64; 3]> = map.to_cloud().points().map(|point| point.position()).collect();
    /// assert_eq!(points, [[-1.0, 0.0, 4.0]]);
    /// # Ok::<(), semvs::Error>(())
    /// ```
    pub fn builder(camera: Camera, depths: Vec<f32>) -> DepthMapBuilder {
        DepthMapBuilder { camera, depths, normals: None, confidences: None, id: 0, image_name: String::new() }
    }

    /// Writes a `.dmap` file, whole or not at all.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<()> {
        write_depth_map(path.as_ref(), &self.0, &self.0.image_name)
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.0.depth.size().width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.0.depth.size().height
    }

    /// The camera for images of the map's size.
    pub fn camera(&self) -> Camera {
        Camera(self.0.camera.clone())
    }

    /// Number of the photograph in its scene.
    pub fn id(&self) -> u32 {
        self.0.image_id.0
    }

    /// The photograph, from the folder of the file.
    pub fn image_name(&self) -> &str {
        &self.0.image_name
    }

    /// The photographs that it was matched with, best first.
    pub fn source_ids(&self) -> impl ExactSizeIterator<Item = u32> {
        self.0.source_ids.iter().map(|id| id.0)
    }

    /// The depth of the pixel in column `x` and row `y`, scene units; `None` where none is known or outside.
    pub fn depth(&self, x: u32, y: u32) -> Option<f32> {
        if x >= self.width() || y >= self.height() {
            return None;
        }
        let depth = self.depths()[y as usize * self.width() as usize + x as usize];
        (depth > 0.0).then_some(depth)
    }

    /// All depths, by rows from the top; 0 where none is known.
    pub fn depths(&self) -> &[f32] {
        self.0.depth.data()
    }

    /// Unit normals in the axes of the camera, if there are any; without meaning where no depth is known.
    pub fn normals(&self) -> Option<&[[f32; 3]]> {
        self.0.normal.as_ref().map(Grid::data)
    }

    /// Confidences, 0 worst and 1 best for a map that no filter has added to, if there are any.
    pub fn confidences(&self) -> Option<&[f32]> {
        self.0.confidence.as_ref().map(Grid::data)
    }

    /// A point for every depth, in the order of the pixels, without any test; with normals and confidences if the map has them.
    pub fn to_cloud(&self) -> Cloud {
        let origin = *self.0.camera.center();
        let local = DepthEstimate { camera: self.0.camera.moved(&-origin), ..DepthEstimate::clone(&self.0) };
        let layout = CloudLayout {
            normals: self.0.normal.is_some(),
            confidence: self.0.confidence.is_some(),
            views: true,
            ..CloudLayout::default()
        };
        let mut points = PointCloud::new(layout);
        // Neither a cloud in memory nor maps of one size can fail.
        let _ = project_maps(ViewIndex(0), &FusionMaps::new(Arc::new(local)), None, layout, &mut points);
        Cloud { points, origin: origin.into(), classes: None }
    }
}

impl DepthMapBuilder {
    /// Unit normals in the axes of the camera, facing it.
    pub fn normals(mut self, normals: Vec<[f32; 3]>) -> Self {
        self.normals = Some(normals);
        self
    }

    /// Confidences, 0 worst, 1 best.
    pub fn confidences(mut self, confidences: Vec<f32>) -> Self {
        self.confidences = Some(confidences);
        self
    }

    /// Number of the photograph in its scene. Default: 0.
    pub fn id(mut self, id: u32) -> Self {
        self.id = id;
        self
    }

    /// The photograph, from the folder that the map will be written to.
    pub fn image_name(mut self, name: impl Into<String>) -> Self {
        self.image_name = name.into();
        self
    }

    /// The map.
    ///
    /// # Errors
    /// [`Error::Invalid`]: as many values as the camera has pixels are expected, and depths must be finite and not negative.
    pub fn build(self) -> Result<DepthMap> {
        let size = self.camera.0.size();
        let wrong = |what: &str, count: usize| {
            Error::invalid(format!(
                "depth map: {count} {what} for {size} pixels; give one a pixel, by rows from the top"
            ))
        };
        let (depths, normals) = (self.depths.len(), self.normals.as_ref().map_or(0, Vec::len));
        let confidences = self.confidences.as_ref().map_or(0, Vec::len);
        if let Some(depth) = self.depths.iter().find(|d| !(d.is_finite() && **d >= 0.0)) {
            return Err(Error::invalid(format!(
                "depth map: {depth} is no depth; give 0 where none is known"
            )));
        }
        let known = self.depths.iter().copied().filter(|&d| d > 0.0);
        let (min, max) = known.fold((f32::INFINITY, 0.0_f32), |(a, b), d| (a.min(d), b.max(d)));
        Ok(DepthMap(Arc::new(DepthEstimate {
            image_id: ImageId(self.id),
            image_name: self.image_name,
            source_ids: Vec::new(),
            depth_range: if max > 0.0 { (min, max.next_up()) } else { (0.0, 0.0) },
            depth: Grid::from_vec(size, self.depths).ok_or_else(|| wrong("depths", depths))?,
            normal: match self.normals {
                Some(map) => Some(Grid::from_vec(size, map).ok_or_else(|| wrong("normals", normals))?),
                None => None,
            },
            confidence: match self.confidences {
                Some(map) => {
                    Some(Grid::from_vec(size, map).ok_or_else(|| wrong("confidences", confidences))?)
                }
                None => None,
            },
            camera: self.camera.0,
        })))
    }
}
