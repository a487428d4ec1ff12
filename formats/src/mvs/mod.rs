//! OpenMVS scene files (`.mvs`): the MVSI interface archive and the native project archive.

mod boost;
mod boxes;
mod check;
mod interface;
mod losses;
mod mesh;
mod project;
mod repair;
mod scene;

use std::io::{Read, Write};
use std::path::Path;

pub use boxes::{Obb, StoredBox};
pub use interface::{NEWEST_VERSION, write_interface};
pub use mesh::{IndexLists, Mesh, Texture};
pub use project::{ArchiveKind, write_project};
pub use repair::Repairs;
pub use scene::{Camera, Image, Line, NO_ID, Platform, PointCloud, Pose, Scene, ViewScore, Visibility};

use crate::wire::{self, Place, Reader};
use crate::{Error, Limits, Result};

/// Which archive a scene file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Container {
    /// Interface archive of this version, 0 to [`NEWEST_VERSION`].
    Interface {
        /// Version of the body.
        version: u32,
    },
    /// Native project archive.
    Project {
        /// How its body is stored.
        kind: ArchiveKind,
    },
}

/// A scene with what else its file said.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// What the file holds.
    pub scene: Scene,
    /// Which archive it is.
    pub container: Container,
    /// The header's reserved field (32 bits in interface archives), 0 in every file seen.
    pub reserved: u64,
    /// Bytes after the end of the data; they are ignored. At least so many, if a compressed archive has over 1 MiB.
    pub trailing_bytes: u64,
}

/// Tells a scene file by its first 20 bytes (more may be given, fewer if it ends before). `None`: not by them; it may
/// still be an interface archive of version 0, which has no header.
///
/// # Errors
/// [`Error::Unsupported`] for versions and kinds that this crate does not know; [`Error::Format`] for a header that
/// ends too early.
pub fn identify(head: &[u8]) -> Result<Option<Container>> {
    Ok(parse_head(head)?.map(|(container, _)| container))
}

/// Container and reserved field.
fn parse_head(head: &[u8]) -> Result<Option<(Container, u64)>> {
    let Some((magic, rest)) = head.split_first_chunk::<4>() else { return Ok(None) };
    match *magic {
        interface::MAGIC => {
            let (version, reserved) = interface::parse_header(rest)?;
            Ok(Some((Container::Interface { version }, reserved.into())))
        }
        project::MAGIC => {
            let (kind, reserved) = project::parse_header(head)?;
            Ok(Some((Container::Project { kind }, reserved)))
        }
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
        let (file, length) = wire::open(path)?;
        read_any(file, length, is_mvs, limits)
    }

    /// Reads a scene file that is in memory, version 0 included.
    ///
    /// # Errors
    /// As [`SceneFile::read`].
    pub fn from_bytes(bytes: &[u8], limits: &Limits) -> Result<SceneFile> {
        read_any(bytes, Some(bytes.len() as u64), true, limits)
    }

    /// Writes the scene back into the kind of archive it came from, bad indices included. Interface archives and text
    /// and binary projects get the bytes that OpenMVS gave them (trailing ones aside).
    ///
    /// # Errors
    /// As [`write_interface`] and [`write_project`], but for indices.
    pub fn write(&self, out: impl Write) -> Result<()> {
        match self.container {
            Container::Interface { version } => {
                interface::write(out, &self.scene, version, self.reserved as u32)
            }
            Container::Project { kind } => project::write(out, &self.scene, kind, self.reserved),
        }
    }
}

fn read_any(
    mut source: impl Read,
    length: Option<u64>,
    may_lack_header: bool,
    limits: &Limits,
) -> Result<SceneFile> {
    let mut head = Vec::with_capacity(project::HEADER);
    source.by_ref().take(project::HEADER as u64).read_to_end(&mut head)?;
    match parse_head(&head)? {
        Some((container @ Container::Project { kind }, reserved)) => {
            let length = length.map(|n| n.saturating_sub(head.len() as u64));
            let (scene, trailing_bytes) = project::read_body(source, length, kind, limits)?;
            Ok(SceneFile { scene, container, reserved, trailing_bytes })
        }
        Some((container @ Container::Interface { version }, reserved)) => {
            let mut r = Reader::new(head.as_slice().chain(source), length, limits);
            r.array::<{ interface::HEADER }>(&Place::Root("header"))?;
            let scene = interface::read_body(&mut r, version)?;
            let trailing_bytes = r.remaining().map_or_else(|| r.skip(u64::MAX), Ok)?;
            Ok(SceneFile { scene, container, reserved, trailing_bytes })
        }
        None if may_lack_header => {
            read_headerless(Reader::new(head.as_slice().chain(source), length, limits))
        }
        None => Err(no_scene("")),
    }
}

/// Reads an interface archive of version 0: no header, so nothing but a body without flaw is believed.
fn read_headerless<R: Read>(mut r: Reader<R>) -> Result<SceneFile> {
    let scene = match interface::read_body(&mut r, 0) {
        Ok(scene) => scene,
        Err(Error::Io(e)) => return Err(Error::Io(e)),
        Err(e) => return Err(no_scene(&format!(" nor a version 0 body ({e})"))),
    };
    if scene.platforms.is_empty() || scene.images.is_empty() || !r.at_end()? {
        return Err(no_scene(" nor a plausible version 0 body"));
    }
    Ok(SceneFile { scene, container: Container::Interface { version: 0 }, reserved: 0, trailing_bytes: 0 })
}

fn no_scene(detail: &str) -> Error {
    let what = format!("not an OpenMVS scene: neither an MVSI or MVS header{detail}");
    Error::Format { offset: 0, field: "header".into(), what }
}
