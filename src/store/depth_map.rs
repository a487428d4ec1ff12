//! Between the depth maps of the scene and those of files.

use super::colmap::ColmapMapHeader;
use crate::geometry::{Camera, Size};
use crate::scene::{DepthEstimate, Grid, ImageId};
use nalgebra::{Matrix3, Vector3};
use semvs_formats::dmap::{DepthMapFile, DepthMapHeader};

/// The camera of a depth map at the size of its planes: the file's intrinsics are at the image's size.
pub(super) fn camera_of(header: &DepthMapHeader) -> Camera {
    let k = Matrix3::from_row_slice(&header.k);
    let rotation = Matrix3::from_row_slice(&header.rotation);
    let center = Vector3::from_row_slice(&header.center);
    let image = Camera::new(Size::new(header.image_width, header.image_height), k, rotation, center);
    let size = Size::new(header.width, header.height);
    if image.size() == size { image } else { image.scaled_per_axis(size) }
}

/// The header of a map of COLMAP as that of a depth map of ours.
pub(super) fn colmap_header(id: ImageId, header: ColmapMapHeader) -> DepthMapHeader {
    let camera = &header.camera;
    let row_major = |m: &Matrix3<f64>| std::array::from_fn(|i| m[(i / 3, i % 3)]);
    let (width, height) = (camera.size().width, camera.size().height);
    DepthMapHeader {
        image_width: width,
        image_height: height,
        width,
        height,
        image_name: header.image_name.into_bytes(),
        ids: vec![id.0],
        k: row_major(camera.k()),
        rotation: row_major(camera.rotation()),
        center: (*camera.center()).into(),
        has_normal: header.has_normal,
        ..DepthMapHeader::default()
    }
}

/// The estimate that a file holds.
///
/// Where there is no depth, confidence is 0 whatever the file says; normals may be stale there. The plane of views
/// is dropped.
pub(super) fn estimate_from_file(file: DepthMapFile) -> Result<DepthEstimate, String> {
    let header = file.header();
    let size = Size::new(file.width, file.height);
    let (image_id, source_ids) = file.ids.split_first().ok_or("no image ID")?;
    let depth = Grid::from_vec(size, file.depth).ok_or("the depths do not fill the map")?;
    let normal = plane(size, file.normal).map_err(|()| "the normals do not fill the map")?;
    let mut confidence = plane(size, file.confidence).map_err(|()| "the confidences do not fill the map")?;
    for (c, &d) in confidence.iter_mut().flat_map(|map| map.data_mut()).zip(depth.data()) {
        if d == 0.0 {
            *c = 0.0;
        }
    }
    Ok(DepthEstimate {
        image_id: ImageId(*image_id),
        image_name: String::from_utf8_lossy(&file.image_name).into_owned(),
        source_ids: source_ids.iter().copied().map(ImageId).collect(),
        camera: camera_of(&header),
        depth_range: (file.depth_min, file.depth_max),
        depth,
        normal,
        confidence,
    })
}

/// Changes values that mean nothing to what they are once they have been written and read: depths and confidences that are
/// negative or not finite and confidences without a depth to 0, normals that are not finite to none.
pub(super) fn make_readable(estimate: &mut DepthEstimate) {
    let usable = |v: f32| if v > 0.0 && v < f32::INFINITY { v } else { 0.0 };
    estimate.depth.data_mut().iter_mut().for_each(|d| *d = usable(*d));
    for normal in estimate.normal.iter_mut().flat_map(|map| map.data_mut()) {
        if !normal.iter().all(|v| v.is_finite()) {
            *normal = [0.0; 3];
        }
    }
    for (c, &d) in estimate.confidence.iter_mut().flat_map(|map| map.data_mut()).zip(estimate.depth.data()) {
        *c = if d == 0.0 { 0.0 } else { usable(*c) };
    }
}

/// A plane that may be absent.
fn plane<T>(size: Size, data: Vec<T>) -> Result<Option<Grid<T>>, ()> {
    if data.is_empty() { Ok(None) } else { Grid::from_vec(size, data).map(Some).ok_or(()) }
}

/// The file for an estimate, with its camera in the coordinates of the file; image size is map size, as OpenMVS has it.
pub(super) fn file_from_estimate(
    estimate: &DepthEstimate,
    camera: &Camera,
    image_name: &str,
) -> DepthMapFile {
    let row_major = |m: &Matrix3<f64>| std::array::from_fn(|i| m[(i / 3, i % 3)]);
    let size = estimate.depth.size();
    DepthMapFile {
        image_width: camera.size().width,
        image_height: camera.size().height,
        width: size.width,
        height: size.height,
        depth_min: estimate.depth_range.0,
        depth_max: estimate.depth_range.1,
        image_name: image_name.as_bytes().to_vec(),
        ids: std::iter::once(&estimate.image_id).chain(&estimate.source_ids).map(|id| id.0).collect(),
        k: row_major(camera.k()),
        rotation: row_major(camera.rotation()),
        center: (*camera.center()).into(),
        depth: estimate.depth.data().to_vec(),
        normal: estimate.normal.as_ref().map(|map| map.data().to_vec()).unwrap_or_default(),
        confidence: estimate.confidence.as_ref().map(|map| map.data().to_vec()).unwrap_or_default(),
        views: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> DepthMapFile {
        DepthMapFile {
            image_width: 8,
            image_height: 4,
            width: 2,
            height: 1,
            depth_min: 1.0,
            depth_max: 9.0,
            image_name: b"images/a.jpg".to_vec(),
            ids: vec![3, 1, 2],
            k: [10.0, 0.0, 3.5, 0.0, 12.0, 1.5, 0.0, 0.0, 1.0],
            rotation: [0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            center: [1.0, 2.0, 3.0],
            depth: vec![0.0, 5.0],
            normal: vec![[0.0, 0.0, -1.0]; 2],
            confidence: vec![0.75, 0.5],
            views: vec![[0, 255, 255, 255]; 2],
        }
    }

    #[test]
    fn intrinsics_are_scaled_to_the_map() {
        let estimate = estimate_from_file(file()).unwrap();
        assert_eq!(estimate.camera.size(), Size::new(2, 1));
        assert_eq!(estimate.camera.intrinsics(), (2.5, 3.0, 0.5, 0.0));
        assert_eq!(estimate.camera.rotation()[(0, 1)], 1.0);
        assert_eq!(estimate.source_ids, [ImageId(1), ImageId(2)]);
    }

    #[test]
    fn no_depth_means_no_confidence() {
        assert_eq!(estimate_from_file(file()).unwrap().confidence.unwrap().data(), [0.0, 0.5]);
    }

    #[test]
    fn what_means_nothing_is_made_what_readers_see() {
        let mut odd = file();
        (odd.image_width, odd.width) = (8, 8);
        odd.depth = vec![0.0, 5.0, -1.0, f32::NAN, f32::INFINITY, 2.0, 3.0, 4.0];
        odd.confidence = vec![0.75, 0.5, 0.5, 0.5, 0.5, -1.0, f32::NAN, 1.5];
        odd.normal = vec![[0.0, 0.0, -1.0]; 8];
        odd.normal[6] = [f32::NAN, 0.0, 0.0];
        odd.views.clear();
        let mut bytes = Vec::new();
        odd.write(&mut bytes).unwrap();
        let read = DepthMapFile::from_bytes(&bytes, &semvs_formats::Limits::default()).unwrap();
        let mut made = estimate_from_file(odd).unwrap();
        make_readable(&mut made);
        assert_eq!(made, estimate_from_file(read).unwrap());
    }

    #[test]
    fn an_estimate_survives_the_way_to_the_file_and_back() {
        let mut plain = file();
        plain.confidence.clear();
        for file in [file(), plain] {
            let estimate = estimate_from_file(file).unwrap();
            let back =
                estimate_from_file(file_from_estimate(&estimate, &estimate.camera, "images/a.jpg")).unwrap();
            assert_eq!(back, estimate);
        }
    }
}
