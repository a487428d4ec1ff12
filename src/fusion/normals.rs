//! Normals of a finished cloud from the points around each point.

use crate::error::{Error, Result};
use crate::geometry::NearestIndex;
use crate::scene::{CloudLayout, CloudPoint, PointSource};
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Points that define a normal, the point itself included.
const NEIGHBORS: usize = 16;

/// A cloud whose points have been given normals.
pub struct WithNormals<'a> {
    cloud: &'a dyn PointSource,
    normals: Vec<[f32; 3]>,
}

impl<'a> WithNormals<'a> {
    /// Gives every point of `cloud` the normal of the plane through its 16 nearest points (principal component
    /// analysis, Hoppe 1992), turned towards the camera of its lowest view; `centers` are the camera centres by view.
    /// Positions of all points are held in memory. A point whose surroundings span no plane gets whatever direction is
    /// perpendicular to them.
    ///
    /// # Errors
    /// Those of `cloud`, and [`Error::Invalid`] if its points have no views.
    pub fn estimate(cloud: &'a dyn PointSource, centers: &[Vector3<f64>]) -> Result<Self> {
        if !cloud.layout().views && !cloud.is_empty() {
            return Err(Error::invalid(
                "normals after fusion need points with views: they tell where the outside is",
            ));
        }
        let mut positions: Vec<[f64; 3]> = Vec::with_capacity(cloud.len() as usize);
        let mut cameras = Vec::with_capacity(cloud.len() as usize);
        cloud.for_each(&mut |point| {
            positions.push(point.position.map(f64::from));
            cameras.push(point.views.first().map_or(0, |v| v.index()));
            Ok(())
        })?;
        if positions.is_empty() {
            return Ok(WithNormals { cloud, normals: Vec::new() });
        }
        let index = NearestIndex::new(&positions);
        let normals = positions
            .par_iter()
            .zip(&cameras)
            .map(|(position, &camera)| {
                let nearest = index.nearest_n(position, NEIGHBORS);
                let normal = plane_normal(nearest.iter().map(|n| Vector3::from(positions[n.index as usize])));
                let to_camera = centers.get(camera).map_or(-Vector3::z(), |c| c - Vector3::from(*position));
                let facing = if normal.dot(&to_camera) < 0.0 { -normal } else { normal };
                facing.map(|v| v as f32).into()
            })
            .collect();
        Ok(WithNormals { cloud, normals })
    }
}

impl PointSource for WithNormals<'_> {
    fn layout(&self) -> CloudLayout {
        CloudLayout { normals: true, ..self.cloud.layout() }
    }

    fn len(&self) -> u64 {
        self.cloud.len()
    }

    fn for_each(&self, visit: &mut dyn FnMut(&CloudPoint<'_>) -> Result<()>) -> Result<()> {
        let mut normals = self.normals.iter();
        self.cloud.for_each(&mut |point| {
            visit(&CloudPoint { normal: normals.next().copied().unwrap_or_default(), ..*point })
        })
    }
}

/// Direction in which the points vary least.
fn plane_normal(points: impl Iterator<Item = Vector3<f64>> + Clone) -> Vector3<f64> {
    let count = points.clone().count() as f64;
    let mean = points.clone().sum::<Vector3<f64>>() / count;
    let covariance: Matrix3<f64> = points.map(|p| (p - mean) * (p - mean).transpose()).sum();
    let eigen = covariance.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    eigen.eigenvectors.column(least).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{PointCloud, PointSink, ViewIndex};

    /// Error of a normal on the curved test surface, degrees.
    const MAX_DEG: f64 = 3.0;

    #[test]
    fn normals_of_a_sphere_point_outwards_to_the_cameras() {
        let layout = CloudLayout { views: true, ..CloudLayout::default() };
        let mut cloud = PointCloud::new(layout);
        let direction = |i: u32| {
            // Points spread evenly over the sphere: the golden-angle spiral.
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 2000.0;
            let (s, c) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            Vector3::new(r * c, r * s, z)
        };
        let centers = [Vector3::new(0.0, 0.0, 10.0), Vector3::new(0.0, 0.0, -10.0)];
        for i in 0..2000 {
            let d = direction(i);
            let views = [ViewIndex(u32::from(d.z < 0.0)), ViewIndex(7)];
            let position = (d * 3.0).map(|v| v as f32).into();
            cloud.push(&CloudPoint { position, views: &views, ..CloudPoint::default() }).unwrap();
        }
        let with_normals = WithNormals::estimate(&cloud, &centers).unwrap();
        assert!(with_normals.layout().normals);
        let mut i = 0;
        with_normals
            .for_each(&mut |point| {
                let d = direction(i);
                // At the equator neither side faces its camera clearly.
                if d.z.abs() > 0.4 {
                    let cos = Vector3::from(point.normal.map(f64::from)).dot(&d);
                    assert!(cos > MAX_DEG.to_radians().cos(), "{i}: {cos}");
                }
                i += 1;
                Ok(())
            })
            .unwrap();
        assert_eq!(i, 2000);
    }

    #[test]
    fn identical_points_and_few_points_do_no_harm() {
        let mut cloud = PointCloud::new(CloudLayout { views: true, ..CloudLayout::default() });
        for _ in 0..100 {
            let views = [ViewIndex(0)];
            cloud.push(&CloudPoint { views: &views, ..CloudPoint::default() }).unwrap();
        }
        let normals = WithNormals::estimate(&cloud, &[]).unwrap().normals;
        assert!(normals.iter().flatten().all(|v| v.is_finite()));
        let empty = PointCloud::new(CloudLayout::default());
        assert!(WithNormals::estimate(&empty, &[]).unwrap().is_empty());
    }
}
