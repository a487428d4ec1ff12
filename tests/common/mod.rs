//! The bundled files, a folder to work in, and the programs to run there.
#![allow(dead_code, reason = "every test program uses its own part")]

use semvs_formats::{Limits, ply};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// `semvs`.
pub(crate) const SEMVS: &str = env!("CARGO_BIN_EXE_semvs");
/// The drop-in.
pub(crate) const DENSIFY: &str = env!("CARGO_BIN_EXE_DensifyPointCloud");

/// Options for depth maps at half the size of the bundled photographs, without a region of interest.
pub(crate) const SMALL: &str = "--resolution-level 1 --min-resolution 160 --estimate-roi 0";
/// Options under which nothing is estimated: the maps that exist are fused as they are.
pub(crate) const FUSE_ONLY: &str =
    "--resolution-level 1 --min-resolution 160 --estimate-roi 0 --geometric-iters 0 --postprocess-dmaps 0";

/// The bundled scene.
pub(crate) fn facade6() -> PathBuf {
    fixtures().join("facade6")
}

/// `compat-fixtures/`.
pub(crate) fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("compat-fixtures")
}

/// Reference data that is not bundled, if it is there.
pub(crate) fn shared(relative: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared").join(relative);
    let found = path.exists();
    println!("{relative}: {}", if found { "compared" } else { "not there, skipped" });
    found.then_some(path)
}

/// The bytes of `path`, decompressed if the name ends in `.zst`.
pub(crate) fn bytes(path: &Path) -> Vec<u8> {
    let raw = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    if path.extension().is_some_and(|e| e == "zst") { zstd::decode_all(&raw[..]).unwrap() } else { raw }
}

/// A cloud file, which may be compressed.
pub(crate) fn cloud(path: &Path) -> ply::Cloud {
    ply::read_cloud(bytes(path).as_slice(), &Limits::default()).unwrap()
}

/// A temporary folder, removed at the end of the test.
pub(crate) struct Scratch {
    folder: tempfile::TempDir,
}

/// How a program ended.
#[derive(Debug)]
pub(crate) struct Outcome {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Outcome {
    /// Asserts success.
    #[track_caller]
    pub(crate) fn ok(self) -> Self {
        assert_eq!(self.code, Some(0), "{}\n{}", self.stdout, self.stderr);
        self
    }

    /// Asserts exit code 1, no panic, and one error line on stderr that holds every one of `needles`.
    #[track_caller]
    pub(crate) fn fails_naming(self, needles: &[&str]) -> Self {
        assert_eq!(self.code, Some(1), "{}\n{}", self.stdout, self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        let errors: Vec<&str> = self.stderr.lines().filter(|l| l.starts_with("error: ")).collect();
        assert_eq!(errors.len(), 1, "one error line expected:\n{}", self.stderr);
        for needle in needles {
            assert!(errors[0].contains(needle), "{needle:?} not in: {}", errors[0]);
        }
        self
    }
}

impl Scratch {
    /// An empty folder.
    pub(crate) fn new() -> Self {
        Scratch { folder: tempfile::tempdir().unwrap() }
    }

    /// A folder with a copy of facade6's scene, images and labels.
    pub(crate) fn facade6() -> Self {
        let scratch = Scratch::new();
        std::fs::copy(facade6().join("scene.mvs"), scratch.path("scene.mvs")).unwrap();
        for folder in ["images", "labels"] {
            std::fs::create_dir(scratch.path(folder)).unwrap();
            for entry in std::fs::read_dir(facade6().join(folder)).unwrap() {
                let entry = entry.unwrap();
                std::fs::copy(entry.path(), scratch.path(folder).join(entry.file_name())).unwrap();
            }
        }
        scratch
    }

    /// The same with OpenMVS's filtered depth maps beside the scene.
    pub(crate) fn with_maps() -> Self {
        let scratch = Scratch::facade6();
        scratch.add_maps("post7", ".");
        scratch
    }

    /// Adds OpenMVS's depth maps of `step` (raw, post3, post7) to `folder`.
    pub(crate) fn add_maps(&self, step: &str, folder: &str) {
        std::fs::create_dir_all(self.path(folder)).unwrap();
        for i in 0..6 {
            let name = format!("depth{i:04}.dmap");
            let packed = facade6().join("openmvs-2.3.0").join(step).join(format!("{name}.zst"));
            std::fs::write(self.path(folder).join(name), bytes(&packed)).unwrap();
        }
    }

    /// A path in the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).unwrap();
        path
    }

    /// Reads a file.
    #[track_caller]
    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Reads a cloud.
    #[track_caller]
    pub(crate) fn cloud(&self, name: &str) -> ply::Cloud {
        ply::read_cloud(self.read(name).as_slice(), &Limits::default()).unwrap()
    }

    /// Changes a file's bytes.
    pub(crate) fn edit(&self, name: &str, change: impl FnOnce(&mut Vec<u8>)) {
        let mut bytes = self.read(name);
        change(&mut bytes);
        self.write(name, bytes);
    }

    /// Whether there is such a file or folder.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    /// All file names below the folder, sorted, `/` between parts.
    pub(crate) fn files(&self) -> Vec<String> {
        let mut found = Vec::new();
        walk(self.folder.path(), self.folder.path(), &mut found);
        found.sort();
        found
    }

    /// Runs `program` in the folder.
    pub(crate) fn run<S: AsRef<OsStr>>(&self, program: &str, args: &[S]) -> Outcome {
        self.run_with(program, args, &[])
    }

    /// Runs `program` in the folder with more variables in its environment.
    pub(crate) fn run_with<S: AsRef<OsStr>>(
        &self,
        program: &str,
        args: &[S],
        variables: &[(&str, &str)],
    ) -> Outcome {
        let mut command = Command::new(program);
        command.args(args).current_dir(self.folder.path()).envs(variables.iter().copied());
        let output = command.output().unwrap();
        Outcome {
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }

    /// Runs `semvs` with words separated by spaces.
    pub(crate) fn semvs(&self, words: &str) -> Outcome {
        self.run(SEMVS, &words.split_whitespace().collect::<Vec<_>>())
    }

    /// Runs `DensifyPointCloud` with words separated by spaces.
    pub(crate) fn densify_point_cloud(&self, words: &str) -> Outcome {
        self.run(DENSIFY, &words.split_whitespace().collect::<Vec<_>>())
    }
}

fn walk(root: &Path, folder: &Path, found: &mut Vec<String>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            walk(root, &path, found);
        } else {
            found.push(path.strip_prefix(root).unwrap().to_string_lossy().replace('\\', "/"));
        }
    }
}
