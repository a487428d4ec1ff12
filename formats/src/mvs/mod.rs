//! OpenMVS scene files (`.mvs`): the MVSI interface archive and the native project archive.

mod boxes;
mod check;
mod interface;
mod mesh;
mod scene;

use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;

pub use boxes::{Obb, StoredBox};
pub use interface::{NEWEST_VERSION, write_interface};
pub use mesh::{Mesh, Texture};
pub use scene::{Camera, Image, Line, NO_ID, Platform, PointCloud, Pose, Scene, ViewScore, Visibility};

use crate::wire::{Place, Reader};
use crate::{Error, Limits, Result};

/// First bytes of a native archive.
const PROJECT_MAGIC: [u8; 4] = *b"MVS\0";

/// Which archive a scene file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// Interface archive of this version, 0 to [`NEWEST_VERSION`].
    Interface {
        /// Version of the body.
        version: u32,
    },
}

/// A scene with what else its file said.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// What the file holds.
    pub scene: Scene,
    /// Which archive it is.
    pub container: Container,
    /// The header's reserved field, 0 in every file seen.
    pub reserved: u64,
    /// Bytes after the end of the data; they are ignored.
    pub trailing_bytes: u64,
}

/// Tells a scene file by its first eight bytes (more may be given). `None`: not by them; it may still be an
/// interface archive of version 0, which has no header.
///
/// # Errors
/// [`Error::Unsupported`] for a version that this crate does not know.
pub fn identify(head: &[u8]) -> Result<Option<Container>> {
    let Some((magic, version)) = head.split_first_chunk::<4>().zip(head.get(4..8)) else { return Ok(None) };
    let version = version.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte));
    match magic.0 {
        &interface::MAGIC if (1..=NEWEST_VERSION).contains(&version) => {
            Ok(Some(Container::Interface { version }))
        }
        &interface::MAGIC => Err(Error::Unsupported(format!(
            "MVSI interface archive of version {version}; versions 0 to {NEWEST_VERSION} can be read"
        ))),
        &PROJECT_MAGIC => Err(Error::Unsupported("native project archive".into())),
        _ => Ok(None),
    }
}

/// Reads a scene file of any kind.
///
/// # Errors
/// As [`SceneFile::read`].
pub fn read(path: impl AsRef<Path>, limits: &Limits) -> Result<Scene> {
    Ok(SceneFile::read(path, limits)?.scene)
}

impl SceneFile {
    /// Reads a scene file of any kind. A file without a known header is tried as an interface archive of version 0
    /// if its extension is `.mvs`.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Format`] with offset and field, [`Error::Limits`], [`Error::Unsupported`].
    pub fn read(path: impl AsRef<Path>, limits: &Limits) -> Result<SceneFile> {
        let path = path.as_ref();
        let is_mvs = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mvs"));
        read_any(Reader::<File>::open(path, limits)?, is_mvs)
    }

    /// Reads a scene file that is in memory, version 0 included.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<SceneFile> {
        read_any(Reader::from_bytes(bytes, limits), true)
    }

    /// Writes the scene back into the archive it came from. An interface archive gets the same bytes (trailing ones
    /// aside), bad indices included.
    ///
    /// # Errors
    /// As [`write_interface`], but for indices.
    pub fn write(&self, out: impl Write) -> Result<()> {
        match self.container {
            Container::Interface { version } => {
                interface::write(out, &self.scene, version, self.reserved as u32)
            }
        }
    }
}

fn read_any<R: Read>(mut r: Reader<R>, may_lack_header: bool) -> Result<SceneFile> {
    let container = identify(r.peek(8)?)?;
    if let Some(length) = r.remaining() {
        r.cap_budget(interface::memory_bound(length));
    }
    match container {
        Some(container @ Container::Interface { version }) => {
            let header = r.array::<12>(&Place::Root("header"))?;
            let reserved = u64::from(u32::from_le_bytes([header[8], header[9], header[10], header[11]]));
            let scene = interface::read_body(&mut r, version)?;
            Ok(SceneFile { scene, container, reserved, trailing_bytes: r.skip_rest()? })
        }
        None if may_lack_header => read_headerless(r),
        None => Err(no_scene(&r, "")),
    }
}

/// Reads an interface archive of version 0: no header, so nothing but a body without flaw is believed.
fn read_headerless<R: Read>(mut r: Reader<R>) -> Result<SceneFile> {
    let scene = match interface::read_body(&mut r, 0) {
        Ok(scene) => scene,
        Err(Error::Io(e)) => return Err(Error::Io(e)),
        Err(e) => return Err(no_scene(&r, &format!(" nor a version 0 body ({e})"))),
    };
    if scene.platforms.is_empty() || scene.images.is_empty() || !r.at_end()? {
        return Err(no_scene(&r, " nor a plausible version 0 body"));
    }
    Ok(SceneFile { scene, container: Container::Interface { version: 0 }, reserved: 0, trailing_bytes: 0 })
}

fn no_scene<R: Read>(r: &Reader<R>, detail: &str) -> Error {
    r.error(&Place::Root("header"), format!("not an OpenMVS scene: neither an MVSI or MVS header{detail}"))
}
