//! Writing of raw depth maps (`DR`).

use std::io::Write;

use super::{CONFIDENCE, DEPTH, DepthMapFile, DepthMapHeader, MAGIC, NORMAL, VIEWS, finite, usable};
use crate::wire::{Writer, vec3f_bytes};
use crate::{Error, Result};

impl DepthMapFile {
    /// The header that [`DepthMapFile::write`] would write.
    pub fn header(&self) -> DepthMapHeader {
        DepthMapHeader {
            image_width: self.image_width,
            image_height: self.image_height,
            width: self.width,
            height: self.height,
            depth_min: self.depth_min,
            depth_max: self.depth_max,
            image_name: self.image_name.clone(),
            ids: self.ids.clone(),
            k: self.k,
            rotation: self.rotation,
            center: self.center,
            has_normal: !self.normal.is_empty(),
            has_confidence: !self.confidence.is_empty(),
            has_views: !self.views.is_empty(),
            quantized: false,
        }
    }

    /// Writes a raw depth map (`DR`). Values that mean nothing (negative or not finite depths and confidences,
    /// normals that are not finite) become 0, as readers see them.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the sizes, the planes, the number of IDs (1..255), the name (65 535 bytes) or the
    /// camera are impossible; [`Error::Io`].
    pub fn write(&self, out: impl Write) -> Result<()> {
        self.check()?;
        let mut w = Writer::new(out);
        let kind = [
            (NORMAL, !self.normal.is_empty()),
            (CONFIDENCE, !self.confidence.is_empty()),
            (VIEWS, !self.views.is_empty()),
        ];
        let kind = kind.iter().filter(|(_, present)| *present).fold(DEPTH, |kind, (bit, _)| kind | bit);
        w.bytes(&MAGIC)?;
        w.bytes(&[kind, 0])?;
        for size in [self.image_width, self.image_height, self.width, self.height] {
            w.u32(size)?;
        }
        w.f32s(&[self.depth_min, self.depth_max])?;
        w.bytes(&(self.image_name.len() as u16).to_le_bytes())?;
        w.bytes(&self.image_name)?;
        w.u32(self.ids.len() as u32)?;
        self.ids.iter().try_for_each(|&id| w.u32(id))?;
        w.f64s(&self.k)?;
        w.f64s(&self.rotation)?;
        w.f64s(&self.center)?;
        w.records(&self.depth, |&d| usable(d).to_le_bytes())?;
        w.records(&self.normal, |&n| vec3f_bytes(&finite(n)))?;
        w.records(&self.confidence, |&c| usable(c).to_le_bytes())?;
        w.bytes(self.views.as_flattened())?;
        w.finish()
    }

    fn check(&self) -> Result<()> {
        let invalid = |field: &str, what: String| Error::Invalid { field: field.into(), what };
        let header = self.header();
        header.check_size().map_err(|what| invalid("depthWidth", what))?;
        header.check_camera().map_err(|(field, what)| invalid(field, what))?;
        if self.image_name.len() > usize::from(u16::MAX) {
            return Err(invalid("fileName", format!("{} bytes are too many", self.image_name.len())));
        }
        if !(1..=255).contains(&self.ids.len()) {
            return Err(invalid("IDs", format!("{} view IDs, 1 to 255 are possible", self.ids.len())));
        }
        let area = header.area();
        let planes = [
            ("depth", self.depth.len(), false),
            ("normal", self.normal.len(), true),
            ("confidence", self.confidence.len(), true),
            ("views", self.views.len(), true),
        ];
        for (field, length, optional) in planes {
            if length as u64 != area && !(optional && length == 0) {
                return Err(invalid(field, format!("{length} values for {}×{}", self.width, self.height)));
            }
        }
        Ok(())
    }
}
