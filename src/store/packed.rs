//! Results that are kept for comparison: scenes, depth maps and clouds, as they are or compressed (`.zst`).

use super::depth_map::estimate_from_file;
use super::depth_store::read_depth_map;
use crate::error::{Error, Result};
use crate::scene::DepthEstimate;
use semvs_formats::dmap::DepthMapFile;
use semvs_formats::mvs::{self, SceneFile};
use semvs_formats::{Limits, ply};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// `path` without the `.zst` that a compressed file ends in.
pub(crate) fn unpacked_name(path: &Path) -> PathBuf {
    if is_packed(path) { path.with_extension("") } else { path.to_owned() }
}

fn is_packed(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("zst"))
}

/// The content of a file, decompressed on the way.
fn open(path: &Path) -> Result<Box<dyn Read>> {
    let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
    Ok(match is_packed(path) {
        true => Box::new(zstd::Decoder::new(file).map_err(|e| Error::io(path, "decompress", e))?),
        false => Box::new(file),
    })
}

/// All of a compressed file.
fn unpack(path: &Path, limits: &Limits) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let most = limits.max_bytes.saturating_add(1);
    open(path)?.take(most).read_to_end(&mut bytes).map_err(|e| Error::io(path, "decompress", e))?;
    if bytes.len() as u64 > limits.max_bytes {
        let (needed, limit) = (bytes.len() as u64, limits.max_bytes);
        return Err(Error::format(
            path,
            semvs_formats::Error::Limits { field: "content".into(), needed, limit },
        ));
    }
    Ok(bytes)
}

/// The first bytes of a file, at most `count`.
///
/// # Errors
/// The file cannot be read or decompressed.
pub(crate) fn read_head(path: &Path, count: u64) -> Result<Vec<u8>> {
    let mut head = Vec::new();
    open(path)?.take(count).read_to_end(&mut head).map_err(|e| Error::io(path, "read", e))?;
    Ok(head)
}

/// Reads a scene.
///
/// # Errors
/// [`Error`] about `path`.
pub(crate) fn read_scene(path: &Path, limits: &Limits) -> Result<mvs::Scene> {
    let scene = match is_packed(path) {
        true => SceneFile::from_bytes(&unpack(path, limits)?, limits).map(|file| file.scene),
        false => mvs::read(path, limits),
    };
    scene.map_err(|e| Error::format(path, e))
}

/// Reads a depth map.
///
/// # Errors
/// [`Error`] about `path`.
pub(crate) fn read_map(path: &Path, limits: &Limits) -> Result<DepthEstimate> {
    if !is_packed(path) {
        return read_depth_map(path, *limits);
    }
    let file =
        DepthMapFile::from_bytes(&unpack(path, limits)?, limits).map_err(|e| Error::format(path, e))?;
    estimate_from_file(file).map_err(|what| Error::content(path, what))
}

/// Reads a cloud.
///
/// # Errors
/// [`Error`] about `path`.
pub(crate) fn read_cloud(path: &Path, limits: &Limits) -> Result<ply::Cloud> {
    ply::read_cloud(open(path)?, limits).map_err(|e| Error::format(path, e))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_files_are_read_like_others() {
        let scratch = tempfile::tempdir().unwrap();
        let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures/format-corpus");
        let pack = |file: &str| {
            let path = corpus.join(file);
            let packed = scratch.path().join(path.file_name().unwrap()).with_added_extension("zst");
            std::fs::write(&packed, zstd::encode_all(&std::fs::read(&path).unwrap()[..], 3).unwrap())
                .unwrap();
            (path, packed)
        };
        let limits = Limits::default();
        let (path, packed) = pack("mvsi/i7.mvs");
        assert_eq!(read_scene(&path, &limits).unwrap(), read_scene(&packed, &limits).unwrap());
        assert_eq!(read_head(&packed, 4).unwrap(), b"MVSI");
        assert_eq!(unpacked_name(&packed).file_name(), path.file_name());
        assert_eq!(unpacked_name(&path), path);
        let (path, packed) = pack("other/d7.dmap");
        assert_eq!(read_map(&path, &limits).unwrap(), read_map(&packed, &limits).unwrap());
        let small = Limits { max_bytes: 100, ..limits };
        assert!(read_map(&packed, &small).unwrap_err().to_string().contains("limit"));
        let (path, packed) = pack("ply/pc_full.ply");
        assert_eq!(read_cloud(&path, &limits).unwrap(), read_cloud(&packed, &limits).unwrap());
        std::fs::write(&packed, b"not compressed").unwrap();
        assert!(read_cloud(&packed, &limits).is_err() && read_head(&packed, 4).is_err());
    }
}
