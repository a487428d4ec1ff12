//! The readers and what they are fed: small files of every kind, and large ones made to cost memory.

mod floods;
mod samples;

use semvs_formats::colmap::{self, ConsistencyGraph, Encoding, Matrix, Model, ModelFile};
use semvs_formats::dmap::DepthMapFile;
use semvs_formats::{Error, Limits, mvs, neighbors_file, npy, pfm, ply, roi};

pub(crate) use floods::floods;
use samples::{Seeds, corpus, depth_map, graph, matrix, model_file, numpy, pfm_map, view_lists};

/// A reader under test.
pub(crate) struct Reader {
    pub(crate) name: &'static str,
    /// Reads a file that is in memory.
    pub(crate) read: fn(&[u8]) -> Result<(), Error>,
    /// Sound small files.
    pub(crate) seeds: fn() -> Seeds,
}

/// Images of the scene that the view-neighbour file belongs to.
const IMAGES: usize = 10;

/// What holds must hold without the user's help.
fn limits() -> Limits {
    Limits::default()
}

fn length(bytes: &[u8]) -> Option<u64> {
    Some(bytes.len() as u64)
}

/// Reads a scene and does with it what every program does next.
fn read_scene(bytes: &[u8]) -> Result<(), Error> {
    let mut file = mvs::SceneFile::from_bytes(bytes, &limits())?;
    let _ = file.scene.repair();
    let _ = file.scene.check();
    Ok(())
}

fn read_model(file: ModelFile, encoding: Encoding, bytes: &[u8]) -> Result<(), Error> {
    let mut model = Model::default();
    model.read_file(file, encoding, bytes, length(bytes), &limits())?;
    let _ = model.check();
    Ok(())
}

/// The reader of a scene archive, of any kind, with these files of the corpus.
macro_rules! scenes {
    ($name:literal, $($file:literal)*) => {
        Reader { name: $name, read: read_scene, seeds: || corpus(&[$($file),*]) }
    };
}

/// The reader of one file of a sparse model in one encoding.
macro_rules! model_reader {
    ($name:literal, $file:ident, $encoding:ident) => {
        Reader {
            name: $name,
            read: |b| read_model(ModelFile::$file, Encoding::$encoding, b),
            seeds: || model_file(ModelFile::$file, Encoding::$encoding),
        }
    };
}

/// The reader of clouds with these files of the corpus.
macro_rules! clouds {
    ($name:literal, $($file:literal)*) => {
        Reader {
            name: $name,
            read: |b| ply::read_cloud(b, &limits()).map(drop),
            seeds: || corpus(&[$($file),*]),
        }
    };
}

/// Every reader of the crate.
pub(crate) const READERS: &[Reader] = &[
    scenes!("mvs interface", "mvsi/i0.mvs" "mvsi/i1.mvs" "mvsi/i2.mvs" "mvsi/i4.mvs" "mvsi/i5.mvs" "mvsi/i7.mvs"),
    scenes!("mvs text", "native/n0_short.mvs"),
    scenes!("mvs binary", "native/n1.mvs"),
    scenes!("mvs zlib", "native/n2.mvs"),
    scenes!("mvs zstd", "native/n3.mvs" "native/n3_2frames.mvs"),
    Reader {
        name: "dmap",
        read: |b| DepthMapFile::from_bytes(b, &limits()).map(drop),
        seeds: || [corpus(&["other/d7.dmap"]), depth_map()].concat(),
    },
    clouds!("ply ascii", "ply/pc_ascii.ply"),
    clouds!("ply binary", "ply/pc_full.ply" "ply/pc_300views.ply" "ply/o_be.ply" "ply/o_mixed.ply" "ply/cfused.ply"),
    Reader { name: "roi", read: |b| roi::parse(b).map(drop), seeds: || corpus(&["other/roi_in.txt"]) },
    Reader {
        name: "view neighbours",
        read: |b| neighbors_file::parse(b, IMAGES).map(drop),
        seeds: || corpus(&["other/nb.txt"]),
    },
    model_reader!("colmap cameras.bin", Cameras, Binary),
    model_reader!("colmap images.bin", Images, Binary),
    model_reader!("colmap points3D.bin", Points, Binary),
    model_reader!("colmap rigs.bin", Rigs, Binary),
    model_reader!("colmap frames.bin", Frames, Binary),
    model_reader!("colmap cameras.txt", Cameras, Text),
    model_reader!("colmap images.txt", Images, Text),
    model_reader!("colmap points3D.txt", Points, Text),
    model_reader!("colmap rigs.txt", Rigs, Text),
    model_reader!("colmap frames.txt", Frames, Text),
    Reader {
        name: "colmap matrix",
        read: |b| {
            let _ = colmap::read_matrix_size(b, length(b));
            Matrix::read(b, length(b), &limits()).map(drop)
        },
        seeds: matrix,
    },
    Reader {
        name: "colmap consistency graph",
        read: |b| ConsistencyGraph::read(b, length(b), &limits()).map(drop),
        seeds: graph,
    },
    Reader {
        name: "colmap visibility",
        read: |b| colmap::read_visibility(b, length(b), &limits()).map(drop),
        seeds: view_lists,
    },
    Reader {
        name: "colmap patch-match.cfg",
        read: |b| colmap::parse_patch_match_config(&String::from_utf8_lossy(b)).map(drop),
        seeds: || {
            vec![(
                "patch-match.cfg".into(),
                b"a.jpg\n__auto__, 20\n# c\nb.jpg\n__all__\nc\na.jpg, b.jpg\n".to_vec(),
            )]
        },
    },
    Reader { name: "pfm", read: |b| pfm::read(b, length(b), &limits()).map(drop), seeds: pfm_map },
    Reader { name: "npy", read: |b| npy::read(b, length(b), &limits()).map(drop), seeds: numpy },
];
