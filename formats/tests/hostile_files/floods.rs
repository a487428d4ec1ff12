//! Large files that hold as many and as large values per byte as their format allows, and announce more.

use std::io::Write;

use semvs_formats::mvs::{self, ArchiveKind};

/// Bytes of a flood: large enough that what a file gets for free does not hide what each byte costs.
const LARGE: usize = 24 << 20;

/// Name of a reader, what the file holds, and the file.
pub(crate) type Flood = (&'static str, &'static str, fn() -> Vec<u8>);

/// `head`, then `unit` again and again up to [`LARGE`] bytes.
fn repeated(head: &[u8], unit: &[u8]) -> Vec<u8> {
    let mut bytes = head.to_vec();
    bytes.extend(unit.iter().cycle().take((LARGE - head.len()) / unit.len() * unit.len()));
    bytes
}

/// A PLY file that announces so many vertices.
fn ply(format: &str, count: u64, properties: &[&str], unit: &[u8]) -> Vec<u8> {
    let properties: String = properties.iter().map(|p| format!("property {p}\n")).collect();
    repeated(
        format!("ply\nformat {format} 1.0\nelement vertex {count}\n{properties}end_header\n").as_bytes(),
        unit,
    )
}

/// An empty project of a kind, cut where the list whose count comes next was announced.
fn project(kind: ArchiveKind) -> Vec<u8> {
    let mut bytes = Vec::new();
    mvs::write_project(&mut bytes, &mvs::Scene::default(), kind).unwrap();
    bytes
}

/// The body of a binary project: no platforms, no images, then a cloud of `points` points whose bytes are all 0.
fn cloud_of_zeros(points: u64, zeros: usize, mut out: impl Write) {
    let empty = project(ArchiveKind::Binary);
    // header 20; classes of scene, platforms, images, cloud, points (5 bytes each) and two empty counts
    let before = 20 + 5 + (5 + 4) + (5 + 4) + 5 + 5;
    out.write_all(&empty[20..before]).unwrap();
    out.write_all(&points.to_le_bytes()).unwrap();
    out.write_all(&[0; 10]).unwrap();
    let block = vec![0; 1 << 20];
    for _ in 0..zeros >> 20 {
        out.write_all(&block).unwrap();
    }
}

fn header(kind: u8) -> Vec<u8> {
    [b"MVS\0\x01\0\0\0".as_slice(), &[kind], &[0; 11]].concat()
}

fn zlib_bomb(points: u64, zeros: usize) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(header(2), flate2::Compression::fast());
    cloud_of_zeros(points, zeros, &mut encoder);
    encoder.finish().unwrap()
}

fn zstd_bomb(points: u64, zeros: usize, window_log: u32) -> Vec<u8> {
    let mut encoder = zstd::stream::write::Encoder::new(header(3), 1).unwrap();
    encoder.window_log(window_log).unwrap();
    cloud_of_zeros(points, zeros, &mut encoder);
    encoder.finish().unwrap()
}

/// An interface archive of version `version` up to the vertices.
fn interface(version: u32) -> Vec<u8> {
    [b"MVSI".as_slice(), &version.to_le_bytes(), &[0; 4], &[0; 16]].concat()
}

fn count(n: usize) -> [u8; 8] {
    (n as u64).to_le_bytes()
}

/// All of them.
pub(crate) fn floods() -> Vec<Flood> {
    [scenes(), clouds(), others()].concat()
}

fn scenes() -> Vec<Flood> {
    vec![
        ("mvs interface", "empty images", || {
            repeated(&[&interface(1)[..20], &count((LARGE - 28) / 20)].concat(), &[0; 20])
        }),
        ("mvs interface", "points without views", || {
            repeated(&[&interface(7)[..], &count((LARGE - 36) / 20)].concat(), &[0; 20])
        }),
        ("mvs interface", "points with a view each", || {
            let unit = [[0; 12].as_slice(), &count(1), &[1; 8]].concat();
            repeated(&[&interface(7)[..], &count((LARGE - 36) / 28)].concat(), &unit)
        }),
        ("mvs interface", "a point with all views", || {
            let n = (LARGE - 64) / 8;
            repeated(&[&interface(7)[..], &count(1), &[0; 12], &count(n)].concat(), &[1; 8])
        }),
        ("mvs binary", "points without views", || {
            let mut bytes = header(1);
            cloud_of_zeros(((LARGE - 100) / 16) as u64, LARGE, &mut bytes);
            bytes
        }),
        ("mvs text", "numbers of one digit", || {
            let empty = project(ArchiveKind::Text);
            let tokens: Vec<&[u8]> = empty[20..].split(|&b| b == b' ').collect();
            // classes of scene, platforms, images, cloud, points (two tokens each) and two empty counts
            let before = tokens[..12].join(&b' ');
            let points = format!(" {} 0 0 0 0 ", LARGE / 8);
            repeated(&[&header(0), &before[..], points.as_bytes()].concat(), b"0 ")
        }),
        ("mvs text", "more points than digits", || {
            let empty = project(ArchiveKind::Text);
            let tokens: Vec<&[u8]> = empty[20..].split(|&b| b == b' ').collect();
            let before = tokens[..12].join(&b' ');
            let points = format!(" {} 0 0 0 0 ", LARGE - 1000);
            repeated(&[&header(0), &before[..], points.as_bytes()].concat(), b"0 ")
        }),
        ("mvs text", "nothing but blanks", || repeated(&header(0), b" ")),
        ("mvs zlib", "a bomb of points", || zlib_bomb(1 << 26, 1 << 30)),
        ("mvs zlib", "a bomb that announces all points there can be", || zlib_bomb(u64::MAX / 12, 1 << 20)),
        ("mvs zlib", "a bomb after the data", || zlib_bomb(1 << 10, 1 << 30)),
        ("mvs zstd", "a bomb of points", || zstd_bomb(1 << 26, 1 << 30, 20)),
        ("mvs zstd", "a bomb with a large window", || zstd_bomb(1 << 26, 1 << 30, 27)),
        ("mvs zstd", "a bomb that announces all points there can be", || {
            zstd_bomb(u64::MAX / 12, 1 << 20, 20)
        }),
        ("mvs zstd", "a bomb after the data", || zstd_bomb(1 << 10, 1 << 30, 20)),
    ]
}

fn clouds() -> Vec<Flood> {
    const SHORT: [&str; 3] = ["char x", "char y", "char z"];
    const LISTS: [&str; 5] =
        ["char x", "char y", "char z", "list uchar uchar view_indices", "list uchar uchar view_weights"];
    const BINARY: &str = "binary_little_endian";
    vec![
        ("ply binary", "8-bit coordinates", || ply(BINARY, LARGE as u64, &SHORT, &[7])),
        ("ply binary", "empty lists of views", || ply(BINARY, LARGE as u64, &LISTS, &[0])),
        ("ply binary", "8-bit views", || {
            let unit = [&[1, 2, 3, 255][..], &[9; 255], &[255], &[1; 255]].concat();
            ply(BINARY, LARGE as u64, &LISTS, &unit)
        }),
        ("ply binary", "a record of the size of the file", || {
            let properties = ["char x", "char y", "char z", "list uint char view_indices"];
            let mut bytes = ply(BINARY, 1, &properties, &[0]);
            let n = bytes.len() - 300;
            let at = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 14;
            bytes[at..at + 4].copy_from_slice(&(n as u32).to_le_bytes());
            bytes
        }),
        ("ply binary", "a first element that never ends", || {
            let head = "ply\nformat binary_little_endian 1.0\nelement face 18446744073709551615\nproperty list uint \
                        double i\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
            repeated(head.as_bytes(), &[0xff, 0xff, 0xff, 0])
        }),
        ("ply ascii", "short points", || ply("ascii", LARGE as u64, &SHORT, b"0 0 0\n")),
        ("ply ascii", "short lists", || ply("ascii", LARGE as u64, &LISTS, b"0 0 0 0 0\n")),
        ("ply ascii", "a line of the size of the file", || {
            let properties = ["char x", "char y", "char z", "list uint double view_indices"];
            let mut bytes = ply("ascii", 1, &properties, b"0 ");
            let at = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
            bytes[at..at + 16].copy_from_slice(b"0 0 0 00011000000 ".first_chunk::<16>().unwrap());
            bytes
        }),
        ("ply ascii", "nothing but line ends", || ply("ascii", LARGE as u64, &SHORT, b"\n")),
        ("ply ascii", "comments", || repeated(b"ply\nformat ascii 1.0\n", b"comment\n")),
        ("ply ascii", "elements", || repeated(b"ply\nformat ascii 1.0\n", b"element e 1\n")),
        ("ply ascii", "properties", || {
            let mut text = "ply\nformat ascii 1.0\nelement vertex 1\n".to_owned();
            (0..200_000).for_each(|i| text += &format!("property char p{i}\n"));
            text.into_bytes()
        }),
    ]
}

fn others() -> Vec<Flood> {
    vec![
        ("view neighbours", "one line", || repeated(b"0 ", b"1 2 ")),
        ("view neighbours", "short lines", || repeated(b"", b"0 1\n")),
        ("roi", "digits", || repeated(b"", b"1")),
        ("colmap cameras.txt", "short cameras", || repeated(b"", b"1 SIMPLE_PINHOLE 1 1 1 1 1\n")),
        ("colmap images.txt", "short images", || repeated(b"", b"1 1 0 0 0 0 0 0 1 a\n\n")),
        ("colmap images.txt", "one line of observations", || repeated(b"1 1 0 0 0 0 0 0 1 a\n", b"0 0 1 ")),
        ("colmap images.txt", "lines of observations of 12 MiB", || {
            let line =
                [b"1 1 0 0 0 0 0 0 1 a\n".to_vec(), b"0 0 1 ".repeat(2 << 20), b"\n".to_vec()].concat();
            repeated(b"", &line)
        }),
        ("colmap points3D.txt", "short points", || repeated(b"", b"1 0 0 0 0 0 0 0\n")),
        ("colmap points3D.txt", "one track", || repeated(b"1 0 0 0 0 0 0 0 ", b"0 0 ")),
        ("colmap rigs.txt", "short sensors", || repeated(b"1 4000000000 ", b"IMU 1 0 ")),
        ("colmap frames.txt", "short frames", || repeated(b"", b"1 1 1 0 0 0 0 0 0 0\n")),
        ("colmap images.bin", "short images", || {
            repeated(&count((LARGE - 8) / 73), &[&[1; 64][..], &[0; 9]].concat())
        }),
        ("colmap points3D.bin", "points without tracks", || repeated(&count((LARGE - 8) / 51), &[0; 51])),
        ("colmap rigs.bin", "empty rigs", || repeated(&count((LARGE - 8) / 8), &[0; 8])),
        ("colmap frames.bin", "empty frames", || repeated(&count((LARGE - 8) / 68), &[0; 68])),
        ("colmap visibility", "empty lists", || repeated(&count((LARGE - 8) / 4), &[0; 4])),
        ("colmap visibility", "short lists", || repeated(&count((LARGE - 8) / 8), &[1, 0, 0, 0, 5, 0, 0, 0])),
        ("colmap consistency graph", "pixels without images", || repeated(b"9&9&1&", &[0; 12])),
        ("colmap matrix", "a header without end", || repeated(b"", b"1")),
        ("npy", "no values in dimensions without end", || {
            let text = "{'descr': '<f4', 'fortran_order': True, 'shape': (1152921504606846976, 0), }\n";
            [b"\x93NUMPY\x01\0".as_slice(), &(text.len() as u16).to_le_bytes(), text.as_bytes()].concat()
        }),
        ("pfm", "blanks before the header", || repeated(b"", b" ")),
    ]
}
