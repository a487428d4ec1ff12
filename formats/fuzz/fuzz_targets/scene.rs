//! What holds for every scene file; shared by the targets of its kinds.

use semvs_formats::{Limits, mvs};

/// Reads `bytes`, uses the scene as programs do, and checks that what is written back is stable.
pub fn check(bytes: &[u8]) {
    let limits = Limits::default();
    let Ok(file) = mvs::SceneFile::from_bytes(bytes, &limits) else { return };
    let mut written = Vec::new();
    if file.write(&mut written).is_ok() {
        // Bytes are compared, since scenes may hold numbers that equal nothing.
        let again = mvs::SceneFile::from_bytes(&written, &limits).expect("what was written is read");
        let mut rewritten = Vec::new();
        again.write(&mut rewritten).expect("what was read is written");
        assert!(written == rewritten, "rewriting changes the bytes");
    }
    let mut scene = file.scene;
    let _ = scene.check();
    if scene.repair().is_ok() {
        let mut out = Vec::new();
        let _ = mvs::write_interface(&mut out, &scene, mvs::NEWEST_VERSION);
        let _ = mvs::write_project(&mut out, &scene, mvs::ArchiveKind::Text);
    }
}
