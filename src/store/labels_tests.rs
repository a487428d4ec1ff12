use super::*;
use png::{BitDepth, ColorType};
use std::fs;

/// Writes a PNG of raw sample bytes, row by row as the format wants them.
fn save(path: &Path, size: (u32, u32), color: ColorType, depth: BitDepth, palette: &[u8], rows: &[u8]) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), size.0, size.1);
    encoder.set_color(color);
    encoder.set_depth(depth);
    if !palette.is_empty() {
        encoder.set_palette(palette.to_vec());
    }
    encoder.write_header().unwrap().write_image_data(rows).unwrap();
}

fn save_grey(path: &Path, size: (u32, u32), ids: &[u8]) {
    save(path, size, ColorType::Grayscale, BitDepth::Eight, &[], ids);
}

fn request(folder: &Path, image: &str, size: Option<(u32, u32)>) -> LabelRequest {
    let number: u32 = image.bytes().filter(u8::is_ascii_digit).fold(0, |n, d| n * 10 + u32::from(d - b'0'));
    let size = size.map(|(w, h)| Size::new(w, h));
    LabelRequest { view: ViewIndex(number), image: folder.join(image), mask: None, size }
}

fn sources(folder: &Path, table: &str) -> LabelSources {
    let class_table = (!table.is_empty()).then(|| table.to_owned());
    LabelSources { label_path: Some(folder.to_owned()), class_table, ..LabelSources::default() }
}

/// Reads `0.png` of `folder` for an image of the same size.
fn read_one(folder: &Path, table: &str, size: (u32, u32)) -> Result<Vec<u16>> {
    let store = LabelStore::open(
        &sources(folder, table),
        &[request(folder, "0.jpg", None)],
        Limits::default(),
        &Progress::silent(),
    )?;
    Ok(store.load(ViewIndex(0), Size::new(size.0, size.1))?.data().to_vec())
}

fn error_of<T>(result: Result<T>) -> String {
    let error = result.err().expect("an error").to_string();
    assert!(!error.contains('\n'), "{error}");
    error
}

#[test]
fn grey_values_are_ids_at_every_bit_depth() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0.png");
    let grey = |depth, bytes: &[u8]| {
        save(&path, (5, 2), ColorType::Grayscale, depth, &[], bytes);
        read_one(folder.path(), "ids", (5, 2)).unwrap()
    };
    assert_eq!(grey(BitDepth::One, &[0b0110_1000, 0b1000_0000]), [0, 1, 1, 0, 1, 1, 0, 0, 0, 0]);
    let two = [0b00_01_10_11, 0b01_000000, 0b11_11_00_00, 0b10_000000];
    assert_eq!(grey(BitDepth::Two, &two), [0, 1, 2, 3, 1, 3, 3, 0, 0, 2]);
    let four = [0x12, 0x34, 0x50, 0xfe, 0xdc, 0xb0];
    assert_eq!(grey(BitDepth::Four, &four), [1, 2, 3, 4, 5, 15, 14, 13, 12, 11]);
    let eight: Vec<u8> = (250..=255).chain(0..4).collect();
    assert_eq!(grey(BitDepth::Eight, &eight), [250, 251, 252, 253, 254, 255, 0, 1, 2, 3]);
    let wide: Vec<u16> = (0..10).map(|i| i * 7000).collect();
    let bytes: Vec<u8> = wide.iter().flat_map(|v| v.to_be_bytes()).collect();
    assert_eq!(grey(BitDepth::Sixteen, &bytes), wide);
}

#[test]
fn transparency_is_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0.png");
    save(&path, (2, 1), ColorType::GrayscaleAlpha, BitDepth::Eight, &[], &[7, 0, 9, 255]);
    assert_eq!(read_one(folder.path(), "ids", (2, 1)).unwrap(), [7, 9]);
    save(&path, (2, 1), ColorType::GrayscaleAlpha, BitDepth::Sixteen, &[], &[1, 2, 0, 0, 3, 4, 0, 9]);
    assert_eq!(read_one(folder.path(), "ids", (2, 1)).unwrap(), [0x102, 0x304]);
    save(&path, (2, 1), ColorType::Rgba, BitDepth::Eight, &[], &[0, 0, 255, 0, 0, 255, 0, 9]);
    assert_eq!(read_one(folder.path(), "3dom-facade", (2, 1)).unwrap(), [1, 4]);
}

#[test]
fn colours_are_looked_up_in_true_colour_and_palette() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0.png");
    let rgb = [0, 0, 255, 255, 255, 0, 0, 0, 0, 255, 0, 255];
    save(&path, (2, 2), ColorType::Rgb, BitDepth::Eight, &[], &rgb);
    assert_eq!(read_one(folder.path(), "3dom-facade", (2, 2)).unwrap(), [1, 2, 0, 5]);
    save(&path, (3, 1), ColorType::Indexed, BitDepth::Two, &rgb, &[0b11_00_01_00]);
    assert_eq!(read_one(folder.path(), "3dom-facade", (3, 1)).unwrap(), [5, 1, 2]);
    save(&path, (3, 1), ColorType::Indexed, BitDepth::Two, &rgb[..9], &[0b11_00_01_00]);
    assert!(error_of(read_one(folder.path(), "3dom-facade", (3, 1))).contains("beyond the palette"));
}

#[test]
fn labels_are_never_interpolated() {
    let folder = tempfile::tempdir().unwrap();
    save_grey(&folder.path().join("0.png"), (4, 2), &[1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(read_one(folder.path(), "ids", (2, 1)).unwrap(), [1, 3]);
    assert_eq!(
        read_one(folder.path(), "ids", (8, 2)).unwrap(),
        [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8, 8]
    );
}

#[test]
fn an_unknown_label_is_named_with_its_first_pixel_or_taken_for_void() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0.png");
    let void = LabelSources { unknown: UnknownLabel::Void, ..sources(folder.path(), "3dom-facade") };
    let request = [request(folder.path(), "0.jpg", None)];
    let size = Size::new(2, 2);
    save_grey(&path, (2, 2), &[1, 5, 0, 6]);
    let error = error_of(read_one(folder.path(), "3dom-facade", (2, 2)));
    assert!(error.contains("0.png: id 6 at pixel (1, 1) is not in class table 3dom-facade"), "{error}");
    let store = LabelStore::open(&void, &request, Limits::default(), &Progress::silent()).unwrap();
    assert_eq!(store.load(ViewIndex(0), size).unwrap().data(), [1, 5, 0, 0]);
    assert_eq!(store.pixel_counts(ViewIndex(0)).unwrap()[&ClassId::VOID], 2);
    save(&path, (2, 2), ColorType::Rgb, BitDepth::Eight, &[], &[0, 0, 255, 9, 8, 7, 0, 0, 254, 0, 0, 0]);
    let error = error_of(read_one(folder.path(), "3dom-facade", (2, 2)));
    assert!(error.contains("0.png: colour (9, 8, 7) at pixel (1, 0) is not in"), "{error}");
    let store = LabelStore::open(&void, &request, Limits::default(), &Progress::silent()).unwrap();
    assert_eq!(store.load(ViewIndex(0), size).unwrap().data(), [1, 0, 0, 0]);
}

#[test]
fn names_are_tried_in_the_documented_order() {
    let scratch = tempfile::tempdir().unwrap();
    let (images, labels) = (scratch.path().join("images"), scratch.path().join("labels"));
    fs::create_dir_all(&images).unwrap();
    fs::create_dir_all(&labels).unwrap();
    let mask = scratch.path().join("masks/7.png");
    fs::create_dir_all(mask.parent().unwrap()).unwrap();
    let request = LabelRequest { mask: Some(mask.clone()), ..request(&images, "a.7.jpg", None) };
    let names = ["a.7.png", "a.7.jpg.png", "a.7_l.png", "a.7.label.png", "a.7.mask.png"];
    let mut order: Vec<PathBuf> = names.iter().map(|name| labels.join(name)).collect();
    order.extend([mask, images.join("a.7.mask.png")]);
    assert_eq!(candidate_files(Some(&labels), &request), order);
    for path in order.iter().rev() {
        save_grey(path, (1, 1), &[1]);
        let store = LabelStore::open(
            &sources(&labels, "ids"),
            std::slice::from_ref(&request),
            Limits::default(),
            &Progress::silent(),
        );
        assert_eq!(store.unwrap().file(request.view), Some(path.as_path()));
    }
    assert_eq!(candidate_files(None, &request), order[5..]);
}

#[test]
fn a_photograph_among_the_labels_is_not_a_label_map() {
    let folder = tempfile::tempdir().unwrap();
    save_grey(&folder.path().join("1.png"), (1, 1), &[200]);
    save_grey(&folder.path().join("1_l.png"), (1, 1), &[3]);
    let request = request(folder.path(), "1.png", None);
    let store =
        LabelStore::open(&sources(folder.path(), "ids"), &[request], Limits::default(), &Progress::silent())
            .unwrap();
    assert_eq!(store.load(ViewIndex(1), Size::new(1, 1)).unwrap().data(), [3]);
}

#[test]
fn a_missing_map_is_an_error_that_lists_the_names_or_all_void() {
    let folder = tempfile::tempdir().unwrap();
    save_grey(&folder.path().join("1.png"), (2, 2), &[1, 2, 3, 4]);
    let views = ["1.jpg", "2.jpg", "3.jpg"].map(|name| request(folder.path(), name, Some((2, 2))));
    let mut sources = sources(folder.path(), "ids");
    let error = error_of(LabelStore::open(&sources, &views, Limits::default(), &Progress::silent()));
    assert!(error.starts_with("no label map for 2 of 3 images, such as "), "{error}");
    assert!(
        ["2.png", "2.jpg.png", "2_l.png", "2.label.png", "2.mask.png"].iter().all(|n| error.contains(n)),
        "{error}"
    );
    assert!(error.ends_with("--missing-labels void takes such images as unlabelled"), "{error}");
    sources.missing = MissingLabels::Void;
    let store = LabelStore::open(&sources, &views, Limits::default(), &Progress::silent()).unwrap();
    assert_eq!(store.load(ViewIndex(3), Size::new(2, 1)).unwrap().data(), [0, 0]);
    assert_eq!(store.load(ViewIndex(1), Size::new(2, 2)).unwrap().data(), [1, 2, 3, 4]);
    let error = error_of(LabelStore::open(&sources, &views[1..], Limits::default(), &Progress::silent()));
    assert!(error.starts_with("no image has a label map"), "{error}");
}

#[test]
fn a_map_has_its_images_shape() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("1.png");
    let open = |map: (u32, u32), image: (u32, u32)| {
        save_grey(&path, map, &vec![1; (map.0 * map.1) as usize]);
        LabelStore::open(
            &sources(folder.path(), "ids"),
            &[request(folder.path(), "1.jpg", Some(image))],
            Limits::default(),
            &Progress::silent(),
        )
    };
    for (map, image) in
        [((40, 30), (40, 30)), ((20, 15), (40, 30)), ((80, 60), (40, 30)), ((20, 16), (40, 30))]
    {
        open(map, image).unwrap();
    }
    for (map, image) in [((25, 17), (1000, 667)), ((25, 16), (1000, 667)), ((3, 2), (1000, 667))] {
        open(map, image).unwrap();
    }
    for (map, image) in
        [((30, 40), (40, 30)), ((40, 32), (40, 30)), ((25, 19), (1000, 667)), ((80, 64), (40, 30))]
    {
        let error = error_of(open(map, image));
        let both = [format!("{}×{}", map.0, map.1), format!("{}×{}", image.0, image.1)];
        assert!(both.iter().all(|size| error.contains(size)) && error.contains("1.png"), "{error}");
    }
}

#[test]
fn all_faulty_maps_are_found_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let views: Vec<_> = (1..=6).map(|i| request(folder.path(), &format!("{i}.jpg"), Some((2, 2)))).collect();
    save_grey(&folder.path().join("1.png"), (2, 2), &[1, 2, 3, 4]);
    for i in 2..=6 {
        save_grey(&folder.path().join(format!("{i}.png")), (2, 9), &[0; 18]);
    }
    let error = error_of(LabelStore::open(
        &sources(folder.path(), "ids"),
        &views,
        Limits::default(),
        &Progress::silent(),
    ));
    assert!(error.contains("2.png: the label map has 2×9 pixels"), "{error}");
    assert!(
        error.contains("(faulty as well: ") && error.contains("4.png") && error.ends_with("and 1 more)"),
        "{error}"
    );
}

#[test]
fn damaged_files_are_errors_about_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0.png");
    save_grey(&path, (64, 64), &[3; 64 * 64]);
    let whole = fs::read(&path).unwrap();
    for length in 0..whole.len() - 12 {
        fs::write(&path, &whole[..length]).unwrap();
        let error = error_of(read_one(folder.path(), "ids", (64, 64)));
        assert!(error.contains("0.png: not a readable PNG label map"), "{length}: {error}");
    }
    for i in 0..whole.len() - 12 {
        let mut broken = whole.clone();
        broken[i] ^= 0x55;
        fs::write(&path, &broken).unwrap();
        assert!(read_one(folder.path(), "ids", (64, 64)).is_err(), "byte {i}");
    }
    fs::write(&path, b"\xff\xd8\xff\xe0 a photograph").unwrap();
    assert!(error_of(read_one(folder.path(), "ids", (1, 1))).contains("not a readable PNG"));
}

#[test]
fn nothing_is_allocated_on_a_files_word() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0.png");
    save_grey(&path, (1, 1), &[3]);
    let mut bytes = fs::read(&path).unwrap();
    bytes[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let checksum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    fs::write(&path, &bytes).unwrap();
    let error = error_of(read_one(folder.path(), "ids", (1, 1)));
    assert!(error.contains("claims 65536×65536 pixels, more than the file can hold"), "{error}");
    save_grey(&path, (100, 100), &[3; 10_000]);
    let limits = Limits { max_bytes: 10_000, ..Limits::default() };
    let store = LabelStore::open(
        &sources(folder.path(), "ids"),
        &[request(folder.path(), "0.jpg", None)],
        limits,
        &Progress::silent(),
    );
    assert!(error_of(store).contains("0.png"));
}

/// CRC-32 of the PNG standard.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &b| {
        (0..8).fold(crc ^ u32::from(b), |c, _| if c & 1 == 1 { 0xedb8_8320 ^ c >> 1 } else { c >> 1 })
    })
}

#[test]
fn sixteen_bit_colours_and_missing_tables_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("0.png");
    save(&path, (1, 1), ColorType::Rgb, BitDepth::Sixteen, &[], &[0; 6]);
    assert!(error_of(read_one(folder.path(), "3dom-facade", (1, 1))).contains("16-bit colours"));
    save(&path, (1, 1), ColorType::Rgb, BitDepth::Eight, &[], &[0; 3]);
    let error = error_of(read_one(folder.path(), "", (1, 1)));
    let builtin = "3dom-facade, cityscapes, ade20k, openmvs-aerial, ids";
    assert!(error.contains("no class table says what they mean") && error.contains(builtin), "{error}");
    let error = error_of(read_one(folder.path(), "openmvs-aerial", (1, 1)));
    assert!(error.contains("class table openmvs-aerial has none"), "{error}");
    let error = error_of(read_one(folder.path(), "facade.toml", (1, 1)));
    assert!(error.contains("\"facade.toml\" is neither a file nor built in"), "{error}");
    let error = error_of(read_one(&folder.path().join("none"), "ids", (1, 1)));
    assert!(error.contains("no such folder of label maps"), "{error}");
}

#[test]
fn tables_come_from_the_option_then_from_labels_json_then_from_the_ids() {
    let folder = tempfile::tempdir().unwrap();
    save_grey(&folder.path().join("0.png"), (2, 1), &[0, 2]);
    let table = |name: &str| {
        let views = [request(folder.path(), "0.jpg", None)];
        LabelStore::open(&sources(folder.path(), name), &views, Limits::default(), &Progress::silent())
            .map(|s| s.table().clone())
    };
    let ids = table("").unwrap();
    assert_eq!((ids.name(), ids.classes().len(), ids.classes()[0].name.as_str()), ("ids", 1, "class-2"));
    fs::write(folder.path().join("labels.json"), r#"{"0": "unclassified", "2": "tower"}"#).unwrap();
    assert_eq!(table("").unwrap().class_name(ClassId(2)), "tower");
    assert_eq!(table("3dom-facade").unwrap().class_name(ClassId(2)), "sky");
    let toml = folder.path().join("mine.toml");
    fs::write(&toml, "[[class]]\nid = 2\nname = \"roof\"\n").unwrap();
    assert_eq!(table(toml.to_str().unwrap()).unwrap().class_name(ClassId(2)), "roof");
    fs::write(&toml, b"name = \"\xff\"").unwrap();
    assert!(error_of(table(toml.to_str().unwrap())).contains("UTF-8"));
}

#[test]
fn the_bundled_label_maps_are_read_exactly() {
    let facade = Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/facade6");
    let names = ["0003", "0004", "0005", "0006", "0012", "0013"];
    let views: Vec<LabelRequest> = names
        .iter()
        .map(|n| request(&facade.join("images"), &format!("{n}.jpg"), Some((400, 300))))
        .collect();
    let store = LabelStore::open(
        &sources(&facade.join("labels"), "3dom-facade"),
        &views,
        Limits::default(),
        &Progress::silent(),
    )
    .unwrap();
    for request in &views {
        let labels = store.load(request.view, Size::new(400, 300)).unwrap();
        let path = store.file(request.view).unwrap();
        let decoded = image::open(path).unwrap().to_rgb8();
        let colors = store.table().colors();
        let expected: Vec<u16> = decoded.pixels().map(|p| colors[&p.0].0).collect();
        assert_eq!(labels.data(), expected, "{}", path.display());
        assert_eq!(store.pixel_counts(request.view), Some(&count_classes(&labels)));
        let half = store.load(request.view, Size::new(200, 150)).unwrap();
        assert!((0..150).all(|y| (0..200).all(|x| half[(x, y)] == labels[(2 * x, 2 * y)])));
    }
}
