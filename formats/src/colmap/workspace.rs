//! The files of a sparse model's folder.

use super::model::Model;
use super::{sparse_binary, sparse_text, sparse_text_write};
use crate::wire::Reader;
use crate::{Error, Limits, Result};
use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

/// How the files of a sparse model are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// `.bin`
    Binary,
    /// `.txt`
    Text,
}

/// A file of a sparse model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFile {
    /// [`Model::cameras`]
    Cameras,
    /// [`Model::images`]
    Images,
    /// [`Model::points`]
    Points,
    /// [`Model::rigs`]
    Rigs,
    /// [`Model::frames`]
    Frames,
}

impl ModelFile {
    /// The files that every model has.
    pub const REQUIRED: [ModelFile; 3] = [ModelFile::Cameras, ModelFile::Images, ModelFile::Points];
    /// The files that only models with rigs have.
    pub const OPTIONAL: [ModelFile; 2] = [ModelFile::Rigs, ModelFile::Frames];

    /// File name without extension.
    pub fn stem(self) -> &'static str {
        match self {
            ModelFile::Cameras => "cameras",
            ModelFile::Images => "images",
            ModelFile::Points => "points3D",
            ModelFile::Rigs => "rigs",
            ModelFile::Frames => "frames",
        }
    }

    /// File name.
    pub fn name(self, encoding: Encoding) -> String {
        let extension = match encoding {
            Encoding::Binary => "bin",
            Encoding::Text => "txt",
        };
        format!("{}.{extension}", self.stem())
    }
}

impl Model {
    /// How the model in `folder` is stored: binary if all three basic binary files are there, else text, else `None`.
    pub fn encoding_in(folder: &Path) -> Option<Encoding> {
        let complete =
            |e: &Encoding| ModelFile::REQUIRED.iter().all(|file| folder.join(file.name(*e)).is_file());
        [Encoding::Binary, Encoding::Text].into_iter().find(complete)
    }

    /// Reads and checks the model in `folder`; rigs and frames if they are there.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file, also where there is no model; [`Error::Format`] for broken files and models that
    /// fail [`Model::check`]; [`Error::Unsupported`] for unknown camera models; [`Error::Limits`].
    pub fn read(folder: impl AsRef<Path>, limits: &Limits) -> Result<Model> {
        let folder = folder.as_ref();
        let Some(encoding) = Self::encoding_in(folder) else {
            let what = "no COLMAP model here: cameras, images and points3D as .bin or .txt are needed";
            return Err(Error::Io(io::Error::new(io::ErrorKind::NotFound, what)));
        };
        let mut model = Model::default();
        let optional = ModelFile::OPTIONAL.into_iter().filter(|f| folder.join(f.name(encoding)).is_file());
        for file in ModelFile::REQUIRED.into_iter().chain(optional) {
            let name = file.name(encoding);
            let named = |e: io::Error| io::Error::new(e.kind(), format!("{name}: {e}"));
            let source = File::open(folder.join(&name)).map_err(named)?;
            let length = source.metadata().map_err(named)?.len();
            model.read_file(file, encoding, source, Some(length), limits)?;
        }
        model.check()?;
        Ok(model)
    }

    /// Reads one file into its part of the model. `length` is the number of bytes in `source`, if known; of a binary
    /// file without it only [`Limits::max_bytes`] bounds what is allocated.
    ///
    /// # Errors
    /// As [`Model::read`], without its check.
    pub fn read_file(
        &mut self,
        file: ModelFile,
        encoding: Encoding,
        source: impl Read,
        length: Option<u64>,
        limits: &Limits,
    ) -> Result<()> {
        match encoding {
            Encoding::Binary => {
                sparse_binary::read_file(self, file, &mut Reader::new(source, length, limits))
            }
            Encoding::Text => sparse_text::read_file(self, file, source, limits),
        }
    }

    /// Writes the part of the model that belongs into one file.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a name that the encoding cannot hold; [`Error::Io`].
    pub fn write_file(&self, file: ModelFile, encoding: Encoding, out: impl Write) -> Result<()> {
        match encoding {
            Encoding::Binary => sparse_binary::write_file(self, file, out),
            Encoding::Text => sparse_text_write::write_file(self, file, out),
        }
    }
}
