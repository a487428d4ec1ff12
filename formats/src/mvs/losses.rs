//! What a kind of archive cannot hold.

use super::Container;
use super::scene::{IDENTITY4, NO_ID, Scene};

impl Scene {
    /// What this scene has and an archive of this kind cannot hold, in words; empty if nothing is lost. (A mesh in an
    /// interface archive is not lost: it is refused.)
    pub fn losses(&self, container: Container) -> Vec<&'static str> {
        let mut lost = Vec::new();
        let mut check = |is_lost: bool, what: &'static str| {
            if is_lost {
                lost.push(what);
            }
        };
        let cameras = || self.platforms.iter().flat_map(|platform| &platform.cameras);
        let has_bands = cameras().any(|camera| !camera.band.is_empty());
        let has_transform = self.transform != IDENTITY4;
        let depths = self.images.iter().any(|i| i.min_depth != 0.0 || i.max_depth != 0.0);
        match container {
            Container::Interface { version } => {
                let scored = |i: &super::Image| i.avg_depth != 0.0 || !i.view_scores.is_empty();
                let renumbered =
                    |(i, image): (usize, &super::Image)| image.id != NO_ID && image.id as usize != i;
                check(
                    version < 1 && cameras().any(|c| c.width > 0),
                    "the image sizes of cameras (since version 1)",
                );
                check(version < 1 && !self.lines.is_empty(), "lines (since version 1)");
                check(version < 2 && has_transform, "the transform (since version 2)");
                check(
                    version < 3 && self.images.iter().enumerate().any(renumbered),
                    "the global IDs of images, so depth maps get other names (since version 3)",
                );
                check(version < 4 && has_bands, "the spectral bands of cameras (since version 4)");
                check(
                    version < 5 && self.images.iter().any(|i| !i.mask_name.is_empty()),
                    "the names of masks (since version 5)",
                );
                check(version < 6 && self.obb.is_some(), "the region of interest (since version 6)");
                check(
                    version < 7 && (depths || self.images.iter().any(scored)),
                    "the neighbours and depths of images (since version 7)",
                );
            }
            Container::Project { .. } => {
                check(!self.lines.is_empty(), "lines");
                check(has_transform, "the transform");
                check(
                    has_bands || cameras().any(|c| !c.name.is_empty()),
                    "the names and spectral bands of cameras",
                );
                check(depths, "the least and largest depths of images");
            }
        }
        lost
    }
}
