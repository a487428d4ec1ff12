//! Files that a reader of others' making understands.

use super::*;
use crate::Limits;
use std::io::Cursor;

/// `n` points whose attributes all differ, about UTM coordinates.
fn points(n: u32) -> Vec<LasPoint> {
    (0..n)
        .map(|i| LasPoint {
            position: [
                500_000.0 + f64::from(i) * 0.001,
                5_200_000.0 - f64::from(i),
                f64::from(i % 7) * 0.3333,
            ],
            classification: [1, 6, 68, 255][i as usize % 4],
            color: [i as u8, 255, 3],
            normal: [0.0, -1.0, i as f32],
            label: [0, 1, 4, 300][i as usize % 4],
            label_confidence: 0.25 * (i % 5) as f32,
            confidence: i as f32,
            views: i as u16,
        })
        .collect()
}

fn header(points: &[LasPoint]) -> Header {
    let bound = |pick: fn(f64, f64) -> f64| -> [f64; 3] {
        std::array::from_fn(|axis| points.iter().map(|p| p.position[axis]).reduce(pick).unwrap())
    };
    let bounds = [bound(f64::min), bound(f64::max)];
    let frame = Frame::fitting(bounds).unwrap();
    Header { frame, bounds, points: points.len() as u64, software: "semvs".into() }
}

fn everything(compressed: bool) -> Layout {
    Layout {
        compressed,
        colors: true,
        extras: vec![Extra::Normal, Extra::Label, Extra::LabelConfidence, Extra::Confidence, Extra::Views],
        class_names: vec![(6, "building".into()), (68, "a name of more than fifteen".into())],
    }
}

fn written(points: &[LasPoint], layout: &Layout) -> Vec<u8> {
    let mut writer = LasWriter::new(Cursor::new(Vec::new()), layout, &header(points)).unwrap();
    points.chunks(1000).for_each(|chunk| writer.write(chunk).unwrap());
    writer.finish().unwrap().into_inner()
}

#[test]
fn another_reader_finds_every_value() {
    // More than the 50 000 points of a compressed chunk.
    let points = points(120_001);
    for compressed in [false, true] {
        let bytes = written(&points, &everything(compressed));
        let mut reader = las::Reader::new(Cursor::new(bytes)).unwrap();
        let header = reader.header().clone();
        assert_eq!((header.version().major, header.version().minor), (1, 4));
        assert_eq!(header.number_of_points(), points.len() as u64);
        assert_eq!(header.number_of_points_by_return(1), Some(points.len() as u64));
        assert_eq!(header.point_format().to_u8().unwrap() & 0x7f, 7);
        assert_eq!((header.date(), header.guid().is_nil()), (None, true));
        assert_eq!(header.bounds().max.y, 5_200_000.0);
        assert!((header.bounds().max.x - 500_120.0).abs() < 1e-9);
        let records: Vec<(String, u16, usize)> =
            header.vlrs().iter().map(|v| (v.user_id.clone(), v.record_id, v.data.len())).collect();
        assert_eq!(records[0], ("LASF_Spec".into(), 0, 4096));
        assert_eq!(records[1], ("LASF_Spec".into(), 4, 7 * 192));
        let mut count = 0;
        for (found, point) in reader.read_all().unwrap().points().zip(&points) {
            let found = found.unwrap();
            for (a, b) in [found.x, found.y, found.z].into_iter().zip(point.position) {
                assert!((a - b).abs() <= 0.500_01e-4, "{a} {b}");
            }
            assert_eq!(u8::from(found.classification), point.classification);
            let color = found.color.unwrap();
            assert_eq!([color.red, color.green, color.blue], point.color.map(|c| u16::from(c) << 8));
            assert_eq!((found.return_number, found.number_of_returns), (1, 1));
            let mut extra = Vec::new();
            extra.extend(point.normal.into_iter().flat_map(f32::to_le_bytes));
            extra.extend(point.label.to_le_bytes());
            extra.extend(point.label_confidence.to_le_bytes());
            extra.extend(point.confidence.to_le_bytes());
            extra.extend(point.views.to_le_bytes());
            assert_eq!(found.extra_bytes, extra);
            count += 1;
        }
        assert_eq!(count, points.len());
    }
}

#[test]
fn classes_and_dimensions_have_their_names() {
    let bytes = written(&points(5), &everything(false));
    let reader = las::Reader::new(Cursor::new(bytes)).unwrap();
    let [classes, extras] = &reader.header().vlrs()[..] else { panic!("two records") };
    let entry = |code: usize| classes.data[16 * code..16 * (code + 1)].to_vec();
    assert_eq!(entry(6), [&[6][..], b"building\0\0\0\0\0\0\0"].concat());
    assert_eq!(entry(68), [&[68][..], b"a name of more "].concat());
    assert_eq!(entry(7)[1..], [0; 15]);
    let names: Vec<String> = extras
        .data
        .chunks(192)
        .map(|entry| String::from_utf8(entry[4..36].to_vec()).unwrap().trim_end_matches('\0').to_owned())
        .collect();
    let expected = ["NormalX", "NormalY", "NormalZ", "label", "label_confidence", "confidence", "views"];
    assert_eq!(names, expected);
    let kinds: Vec<u8> = extras.data.chunks(192).map(|entry| entry[2]).collect();
    assert_eq!(kinds, [9, 9, 9, 3, 9, 9, 3]);
}

#[test]
fn points_alone_need_no_records() {
    let points = points(3);
    let bytes = written(&points, &Layout::default());
    assert_eq!(bytes.len(), 375 + 3 * 30);
    let mut reader = las::Reader::new(Cursor::new(bytes)).unwrap();
    assert_eq!(reader.header().point_format().to_u8().unwrap(), 6);
    assert_eq!(reader.read_all().unwrap().len(), 3);
    let compressed = written(&points, &Layout { compressed: true, ..Layout::default() });
    assert_eq!(las::Reader::new(Cursor::new(compressed)).unwrap().read_all().unwrap().len(), 3);
}

#[test]
fn miscounted_and_far_points_are_errors() {
    let points = points(3);
    let header = header(&points);
    let open = || LasWriter::new(Cursor::new(Vec::new()), &Layout::default(), &header).unwrap();
    let mut writer = open();
    writer.write(&points).unwrap();
    assert!(writer.write(&points[..1]).unwrap_err().to_string().contains("more points than the 3"));
    let mut writer = open();
    writer.write(&points[..1]).unwrap();
    assert!(writer.finish().err().unwrap().to_string().contains("fewer points"));
    let far = LasPoint { position: [1e9; 3], ..LasPoint::default() };
    assert!(open().write(&[far]).unwrap_err().to_string().contains("1000000000"));
}

#[test]
fn the_header_is_read_back() {
    let points = points(9);
    for compressed in [false, true] {
        let info =
            LasInfo::read(written(&points, &everything(compressed)).as_slice(), &Limits::default()).unwrap();
        assert_eq!((info.version, info.format, info.compressed, info.points), ((1, 4), 7, compressed, 9));
        assert_eq!((info.scale, info.offset[0]), ([1e-5; 3], 500_000.0));
        assert_eq!((info.bounds[0][1], info.bounds[1][1]), (5_199_992.0, 5_200_000.0));
        assert_eq!(info.extras[0], "float32 NormalX");
        assert_eq!(info.extras[3..5], ["uint16 label", "float32 label_confidence"]);
        assert_eq!(info.class_names, [(6, "building".to_owned()), (68, "a name of more ".to_owned())]);
        assert_eq!(info.software, "semvs");
    }
    // A file of another's making and an older version.
    let mut writer = las::Writer::new(Cursor::new(Vec::new()), las::Header::from((1, 2))).unwrap();
    writer.write_point(las::Point { x: 1.5, ..las::Point::default() }).unwrap();
    let bytes = writer.into_inner().unwrap().into_inner();
    let info = LasInfo::read(bytes.as_slice(), &Limits::default()).unwrap();
    assert_eq!((info.version, info.format, info.points, info.bounds[1][0]), ((1, 2), 0, 1, 1.5));
}

#[test]
fn broken_headers_are_refused() {
    let whole = written(&points(3), &everything(false));
    let to_points = whole.len() - 3 * 60;
    for end in 0..to_points {
        assert!(LasInfo::read(&whole[..end], &Limits::default()).is_err(), "{end}");
    }
    assert!(LasInfo::read(&whole[..to_points], &Limits::default()).is_ok());
    let changed = |at: usize, values: &[u8]| {
        let mut bytes = whole.clone();
        bytes[at..at + values.len()].copy_from_slice(values);
        LasInfo::read(bytes.as_slice(), &Limits::default()).unwrap_err().to_string()
    };
    assert!(changed(0, b"PLYF").contains("LASF"));
    assert!(changed(94, &[100, 0]).contains("header size"));
    assert!(changed(100, &[255; 4]).contains("variable length records"));
    assert!(changed(96, &[0; 4]).contains("reaches into the points"));
    for at in 0..to_points {
        let mut bytes = whole.clone();
        bytes[at] ^= 0xff;
        let _ = LasInfo::read(bytes.as_slice(), &Limits::default());
    }
}
