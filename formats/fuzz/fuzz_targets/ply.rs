#![no_main]
//! Point clouds in every encoding.

use libfuzzer_sys::fuzz_target;
use semvs_formats::Limits;
use semvs_formats::ply::{Cloud, Field, Layout, PointReader, read_cloud, write_cloud};

/// Bits of the values that a layout without rounding keeps.
fn bits(cloud: &Cloud) -> (Vec<[u32; 3]>, &[[u8; 3]], Vec<[u32; 3]>, &[u64], &[u32]) {
    let vectors = |v: &[[f32; 3]]| v.iter().map(|v| v.map(f32::to_bits)).collect();
    (
        vectors(&cloud.positions),
        &cloud.colors,
        vectors(&cloud.normals),
        &cloud.views.offsets,
        &cloud.views.images,
    )
}

fuzz_target!(|bytes: &[u8]| {
    let limits = Limits::default();
    if let Ok(mut points) = PointReader::new(bytes, &limits) {
        let mut cloud = Cloud::default();
        while let Ok(1..) = points.read(&mut cloud, 3) {
            cloud.clear();
        }
    }
    let Ok(cloud) = read_cloud(bytes, &limits) else { return };
    let mut layout = Layout::openmvs(!cloud.colors.is_empty(), !cloud.normals.is_empty(), false);
    let short = cloud.views.offsets.windows(2).all(|w| w[1] - w[0] < 256);
    if !cloud.has_views() || !short {
        layout.fields.retain(|field| *field != Field::ViewIndices);
    }
    let mut written = Vec::new();
    write_cloud(&mut written, &layout, &cloud).expect("a cloud that was read is written");
    let again = read_cloud(written.as_slice(), &limits).expect("what was written is read");
    if short && (cloud.has_views() || cloud.views.offsets.is_empty()) {
        assert_eq!(bits(&cloud), bits(&again));
    }
});
